//! Clipping of yarns at the panel's edge.
//!
//! In: a yarn's data points, and the location of each on the panel, if it has one. Out:
//! [`Strands`], uninterrupted runs of points that all lie on the panel.
//!
//! Method: polyline clipping by tracing. Between two neighbouring points the straight line is
//! traced through the triangles from the point that is on the panel ([`Locator::trace`]). With
//! [`Edge::Clip`] it is cut where it leaves the panel. With [`Edge::Drop`] every stitch with a
//! point off the panel is left out as a whole.
//!
//! Cost: linear in the points. Stitches far from the border are copied many at a time, and nothing of
//! them is traced; near it, lines within one triangle are not traced either.
//!
//! Not promised: clipping of the curve. Straight lines between points are clipped, and the curve is
//! drawn through what is left.

use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::ids::{YarnId, index32};
use crate::knit::Knitted;
use crate::locate::{Locator, SurfacePoint, Traced};

/// The treatment of yarns at the panel's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edge {
    /// The yarn is cut at the edge.
    #[default]
    Clip,
    /// A stitch that crosses the edge is left out.
    Drop,
}

/// A run of yarn on the panel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Strand {
    /// The yarn that it is a part of.
    pub yarn: YarnId,
    /// Its points in [`Strands`], at least two.
    pub points: Range<u32>,
    /// Its pieces in [`Strands::pieces`].
    pub pieces: Range<u32>,
}

/// The strands of a block, as a structure of arrays with an entry for each point.
#[derive(Clone, Debug, Default)]
pub struct Strands {
    /// Flat positions in panel axes (u, v, depth), mm.
    pub flat: Vec<DVec3>,
    /// The location of each point on the panel.
    pub located: Vec<SurfacePoint>,
    /// Index of the data point, or [`CUT`] for an end that was cut between two.
    pub sources: Vec<u32>,
    /// First point of each piece. A piece is a stitch, or the part of one that the edge left. It
    /// ends at the first point of the next piece, or at the strand's end.
    pub pieces: Vec<u32>,
    /// The strands, in yarn order.
    pub strands: Vec<Strand>,
    /// Counts of what the edge and defects removed.
    pub losses: Losses,
}

/// The source of a point that is no data point: an end at the panel's edge.
pub const CUT: u32 = u32::MAX;

/// Counts of the stitches and points that the panel's edge and its defects removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Stitches with a point on the panel.
    pub stitches: usize,
    /// Those of them with a point off the panel. They are cut or, with [`Edge::Drop`], left out.
    pub clipped: usize,
    /// Data points off the panel that belong to stitches with a point on it.
    pub off_panel: usize,
    /// Data points of any stitch that lie within the panel's outline, but in triangles that cannot
    /// hold stitches.
    pub in_defects: usize,
}

impl std::ops::AddAssign for Losses {
    fn add_assign(&mut self, other: Self) {
        self.stitches += other.stitches;
        self.clipped += other.clipped;
        self.off_panel += other.off_panel;
        self.in_defects += other.in_defects;
    }
}

impl Strand {
    /// The range of its points, for arrays with an entry for each point of [`Strands`].
    #[must_use]
    pub fn range(&self) -> Range<usize> {
        self.points.start as usize..self.points.end as usize
    }
}

impl Strands {
    /// Removes everything but keeps the memory.
    pub fn clear(&mut self) {
        self.flat.clear();
        self.located.clear();
        self.sources.clear();
        self.pieces.clear();
        self.strands.clear();
        self.losses = Losses::default();
    }

    /// The data point of a strand's point. An end that was cut has that of the point beside it: only
    /// the first and the last point of a strand can be cut, and another one is beside each.
    #[inline]
    #[must_use]
    pub fn source_near(&self, point: usize) -> u32 {
        match self.sources[point] {
            CUT if self.starts_strand(point) => self.sources[point + 1],
            CUT => self.sources[point - 1],
            source => source,
        }
    }

    /// Whether a point is the first of a strand.
    fn starts_strand(&self, point: usize) -> bool {
        self.strands.binary_search_by_key(&point, |strand| strand.points.start as usize).is_ok()
    }

    /// The pieces of a strand as ranges of its points, counted from the strand's first.
    /// Neighbouring pieces share the point between them.
    pub fn pieces_of(&self, strand: &Strand) -> impl Iterator<Item = Range<usize>> {
        let (start, last) = (strand.points.start, strand.points.end - 1);
        let pieces = &self.pieces[strand.pieces.start as usize..strand.pieces.end as usize];
        pieces.iter().enumerate().map(move |(at, &first)| {
            let next = pieces.get(at + 1).copied().unwrap_or(last);
            (first - start) as usize..(next - start) as usize + 1
        })
    }

    /// Adds the parts of one yarn that lie on the panel. `stitches` are its stitches in `knitted`.
    pub(super) fn add_yarn(
        &mut self,
        yarn: YarnId,
        knitted: &Knitted,
        stitches: Range<usize>,
        located: &[Option<SurfacePoint>],
        locator: &Locator<'_>,
        edge: Edge,
    ) {
        let mut builder = StrandBuilder {
            strands: self,
            yarn,
            knitted,
            located,
            locator,
            open: None,
            counted_as_clipped: false,
            pending: 0..0,
            disc: FreeDisc::default(),
        };
        for stitch in stitches {
            let first = knitted.stitches[stitch] as usize;
            let last = knitted
                .stitches
                .get(stitch + 1)
                .map_or(knitted.points.len(), |&next| next as usize);
            if builder.add_far_from_border(first..last) {
                continue;
            }
            builder.copy_pending();
            let whole = builder.count(&knitted.points[first..last], &located[first..last]);
            if edge == Edge::Drop && !whole {
                builder.end();
                continue;
            }
            builder.begin_piece();
            builder.add_stitch(first, &knitted.points[first..last], &located[first..last]);
        }
        builder.copy_pending();
        builder.end();
    }
}

/// A disc on the flat panel that the border doesn't meet.
#[derive(Clone, Copy, Default)]
struct FreeDisc {
    middle: DVec2,
    /// The square of its radius, mm².
    radius_squared: f64,
}

impl FreeDisc {
    fn holds(&self, points: &[DVec3]) -> bool {
        let is_inside =
            |p: &DVec3| p.truncate().distance_squared(self.middle) < self.radius_squared;
        points.iter().all(is_inside)
    }
}

/// The previous data point.
#[derive(Clone, Copy)]
struct Last {
    flat: DVec3,
    located: Option<SurfacePoint>,
}

/// Builds the strands of one yarn, point by point.
struct StrandBuilder<'a, 'b> {
    strands: &'a mut Strands,
    yarn: YarnId,
    knitted: &'a Knitted,
    located: &'a [Option<SurfacePoint>],
    locator: &'a Locator<'b>,
    /// The point before the pending ones, on the panel or off it. To keep it up to date with these
    /// takes an eighth of the stage's time. Nothing at the start of the yarn and behind a
    /// stitch that was left out: then there is no line to the next point.
    open: Option<Last>,
    /// Whether the current stitch is already counted as clipped.
    counted_as_clipped: bool,
    /// The data points of the last stitches far from the border, which are yet to be copied.
    pending: Range<usize>,
    /// Holds all points of the last pending stitches.
    disc: FreeDisc,
}

impl StrandBuilder<'_, '_> {
    /// Takes a stitch that lies so far from the border that neither it nor the line to it can leave
    /// the panel. That is nearly every stitch. False for any other.
    fn add_far_from_border(&mut self, points: Range<usize>) -> bool {
        let stitch = &self.knitted.points[points.clone()];
        if stitch.is_empty() {
            return false;
        }
        if self.pending.is_empty() || !self.disc.holds(stitch) {
            let before = match self.open {
                _ if !self.pending.is_empty() => self.knitted.points[self.pending.end - 1],
                Some(Last { flat, located: Some(_) }) => flat,
                _ => return false,
            };
            let room = self.locator.room(before.truncate());
            self.disc = FreeDisc { middle: before.truncate(), radius_squared: room * room };
            if !self.disc.holds(stitch) {
                return false;
            }
        }
        self.strands.losses.stitches += 1;
        self.strands.pieces.push(index32(self.strands.flat.len() + self.pending.len()));
        let start = if self.pending.is_empty() { points.start } else { self.pending.start };
        self.pending = start..points.end;
        true
    }

    /// Adds the pending stitches to the current strand, all at once.
    fn copy_pending(&mut self) {
        let points = std::mem::take(&mut self.pending);
        let Some(last) = points.clone().last() else { return };
        let located = self.located[points.clone()].iter();
        // Location is exact: no place within the border is without a triangle.
        let located = located.map(|at| at.expect("far from the border is on the panel"));
        self.strands.flat.extend_from_slice(&self.knitted.points[points.clone()]);
        self.strands.located.extend(located);
        self.strands.sources.extend(index32(points.start)..index32(points.end));
        self.open = Some(Last { flat: self.knitted.points[last], located: self.located[last] });
    }

    /// Counts a stitch; true if all of it lies on the panel.
    fn count(&mut self, points: &[DVec3], located: &[Option<SurfacePoint>]) -> bool {
        // A stitch without a point on the panel is not counted as lost: yarns are planned a little
        // longer than the panel.
        let off = located.iter().filter(|at| at.is_none()).count();
        let losses = &mut self.strands.losses;
        if off > 0 {
            let lost = points
                .iter()
                .zip(located)
                .filter(|(p, at)| at.is_none() && self.locator.is_defect(p.truncate()));
            losses.in_defects += lost.count();
        }
        if off < located.len() {
            losses.stitches += 1;
            losses.clipped += usize::from(off > 0);
            losses.off_panel += off;
        }
        self.counted_as_clipped = off > 0;
        off == 0
    }

    /// Starts a new piece in the current strand, if there is one.
    fn begin_piece(&mut self) {
        if self.open.is_some_and(|last| last.located.is_some()) {
            self.strands.pieces.push(index32(self.strands.flat.len()));
        }
    }

    /// Adds a stitch's data points. `first` is the index of the first one.
    fn add_stitch(&mut self, first: usize, flat: &[DVec3], located: &[Option<SurfacePoint>]) {
        if flat.is_empty() {
            return;
        }
        if self.stays(flat, located) {
            // The fast path, taken by nearly every stitch: whole slices are copied.
            let sources = index32(first)..index32(first + flat.len());
            self.strands.flat.extend_from_slice(flat);
            self.strands
                .located
                .extend(located.iter().map(|at| at.expect("it stays on the panel")));
            self.strands.sources.extend(sources);
            self.open =
                flat.last().zip(located.last()).map(|(&flat, &located)| Last { flat, located });
        } else {
            for ((source, flat), located) in (first..).zip(flat).zip(located) {
                self.add(index32(source), *flat, *located);
            }
        }
    }

    /// Whether the previous point and the whole stitch are on the panel, with all lines between
    /// them.
    fn stays(&self, flat: &[DVec3], located: &[Option<SurfacePoint>]) -> bool {
        let Some(Last { flat: mut before, located: Some(mut from) }) = self.open else {
            return false;
        };
        flat.iter().zip(located).all(|(&flat, &located)| {
            let Some(to) = located else { return false };
            let stays = self.cut(before, from, flat, to).is_none();
            (before, from) = (flat, to);
            stays
        })
    }

    /// Adds the next data point, and cuts the yarn where the line to it leaves the panel.
    fn add(&mut self, source: u32, flat: DVec3, located: Option<SurfacePoint>) {
        match (self.open.and_then(|last| last.located.map(|at| (last.flat, at))), located) {
            // Both points on the panel: the line between them may cross a notch or a hole. It is
            // traced from both ends, so that the strand is cut at either border.
            (Some((before, from)), Some(to)) => {
                if let Some(share) = self.cut(before, from, flat, to) {
                    self.end_at(before, flat, share.0, share.1);
                    self.strands.losses.clipped +=
                        usize::from(!std::mem::replace(&mut self.counted_as_clipped, true));
                    self.finish_strand();
                    self.enter(flat, to, before);
                }
            }
            // From the panel to outside: the strand ends at the border.
            (Some((before, from)), None) => {
                if let Traced::Left { at, share } =
                    self.locator.trace(before.truncate(), from, flat.truncate())
                {
                    self.end_at(before, flat, share, at);
                }
                self.finish_strand();
            }
            // From outside to the panel. Without a previous point the yarn simply starts here.
            (None, Some(to)) => match self.open {
                Some(outside) => self.enter(flat, to, outside.flat),
                None => self.start_strand(),
            },
            (None, None) => {}
        }
        if let Some(at) = located {
            self.push(source, flat, at);
        }
        self.open = Some(Last { flat, located });
    }

    /// The place where the straight line between two points of the panel leaves it, as a fraction
    /// of the line and a point on the border. Nothing if the line stays on the panel.
    fn cut(
        &self,
        from: DVec3,
        start: SurfacePoint,
        to: DVec3,
        end: SurfacePoint,
    ) -> Option<(f64, SurfacePoint)> {
        // Triangles are convex, so a line within one triangle needs no trace. Nor does a line that
        // is shorter than the way to the border. This spares nearly all traces.
        let (from, to) = (from.truncate(), to.truncate());
        if start.triangle == end.triangle || self.locator.stays_inside(from, to) {
            return None;
        }
        match self.locator.trace(from, start, to) {
            Traced::Arrived => None,
            Traced::Left { at, share } => Some((share, at)),
        }
    }

    /// Starts a strand at the border, on the line from `outside` to a point of the panel.
    fn enter(&mut self, flat: DVec3, located: SurfacePoint, outside: DVec3) {
        self.start_strand();
        // Traced from the inside: a trace needs a triangle to start in.
        match self.locator.trace(flat.truncate(), located, outside.truncate()) {
            Traced::Left { at, share } => self.end_at(flat, outside, share, at),
            Traced::Arrived => {}
        }
    }

    /// Adds a cut end on the line from `inside` to `outside`. If `inside` lies on the border itself
    /// the end would only repeat it, so nothing is added.
    fn end_at(&mut self, inside: DVec3, outside: DVec3, share: f64, at: SurfacePoint) {
        if share > 0.0 {
            self.push(CUT, inside.lerp(outside, share), at);
        }
    }

    /// Opens a strand and its first piece at the next point.
    fn start_strand(&mut self) {
        let (point, piece) = (index32(self.strands.flat.len()), index32(self.strands.pieces.len()));
        self.strands.pieces.push(point);
        self.strands.strands.push(Strand {
            yarn: self.yarn,
            points: point..point,
            pieces: piece..piece,
        });
    }

    fn push(&mut self, source: u32, flat: DVec3, located: SurfacePoint) {
        self.strands.flat.push(flat);
        self.strands.located.push(located);
        self.strands.sources.push(source);
    }

    /// Closes the current strand. A strand of a single point draws nothing and is removed, as is a
    /// last piece of a single point.
    fn finish_strand(&mut self) {
        let strands = &mut *self.strands;
        let Some(strand) = strands.strands.last_mut() else { return };
        strand.points.end = index32(strands.flat.len());
        if strands.pieces.last().is_some_and(|&first| first + 1 >= strand.points.end) {
            strands.pieces.pop();
        }
        strand.pieces.end = index32(strands.pieces.len());
        if strand.points.len() < 2 {
            strands.flat.truncate(strand.points.start as usize);
            strands.located.truncate(strand.points.start as usize);
            strands.sources.truncate(strand.points.start as usize);
            strands.pieces.truncate(strand.pieces.start as usize);
            strands.strands.pop();
        }
    }

    /// Ends the yarn's uninterrupted run of stitches.
    fn end(&mut self) {
        if self.open.take().is_some_and(|last| last.located.is_some()) {
            self.finish_strand();
        }
    }
}
