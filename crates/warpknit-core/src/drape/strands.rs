//! Where yarns end: at the panel's edge.
//!
//! In: a yarn's data points and where each lies on the panel, if at all. Out: [`Strands`],
//! uninterrupted runs of points that all lie on the panel. With [`Edge::Clip`] the last segment is
//! cut where it crosses the border; with [`Edge::Drop`] every stitch with a point off the panel
//! goes whole.

use std::ops::Range;

use glam::DVec3;

use crate::ids::{YarnId, index32};
use crate::knit::Knitted;
use crate::locate::{Locator, SurfacePoint, Traced};

/// What happens to yarns at the panel's edge.
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
    /// The yarn of which it is part.
    pub yarn: YarnId,
    /// Its points in [`Strands`]; at least two.
    pub points: Range<u32>,
    /// Its pieces in [`Strands::pieces`].
    pub pieces: Range<u32>,
}

/// The strands of a block: structure of arrays, a point an entry.
#[derive(Clone, Debug, Default)]
pub struct Strands {
    /// Flat positions in panel axes (u, v, depth), mm.
    pub flat: Vec<DVec3>,
    /// Where on the panel each point lies.
    pub located: Vec<SurfacePoint>,
    /// Index of the data point, or [`CUT`] for an end that was cut between two.
    pub sources: Vec<u32>,
    /// First point of each piece: a stitch, or what the edge left of it. A piece runs to the next
    /// one's first point or to the strand's end.
    pub pieces: Vec<u32>,
    /// The strands, in yarn order.
    pub strands: Vec<Strand>,
    /// What was counted on the way.
    pub losses: Losses,
}

/// The source of a point that is no data point.
pub const CUT: u32 = u32::MAX;

/// What the panel's edge and its defects took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Stitches with a point on the panel.
    pub stitches: usize,
    /// Those of them with a point off it: cut or, with [`Edge::Drop`], left out.
    pub clipped: usize,
    /// Data points off the panel, of stitches with a point on it.
    pub off_panel: usize,
    /// Data points, of any stitch, that lie within the panel's outline but in triangles that can't
    /// be knitted.
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
    /// Its points in arrays that have an entry a point of [`Strands`].
    #[must_use]
    pub fn range(&self) -> Range<usize> {
        self.points.start as usize..self.points.end as usize
    }
}

impl Strands {
    /// Forgets everything but keeps the memory.
    pub fn clear(&mut self) {
        self.flat.clear();
        self.located.clear();
        self.sources.clear();
        self.pieces.clear();
        self.strands.clear();
        self.losses = Losses::default();
    }

    /// The pieces of a strand as ranges of its own points, counted from its first. Neighbouring
    /// pieces share a point: the next one's first.
    pub fn pieces_of(&self, strand: &Strand) -> impl Iterator<Item = Range<usize>> {
        let (start, last) = (strand.points.start, strand.points.end - 1);
        let pieces = &self.pieces[strand.pieces.start as usize..strand.pieces.end as usize];
        pieces.iter().enumerate().map(move |(at, &first)| {
            let next = pieces.get(at + 1).copied().unwrap_or(last);
            (first - start) as usize..(next - start) as usize + 1
        })
    }

    /// Adds what the panel holds of one yarn, whose stitches in `knitted` are `stitches`.
    pub(super) fn add_yarn(
        &mut self,
        yarn: YarnId,
        knitted: &Knitted,
        stitches: Range<usize>,
        located: &[Option<SurfacePoint>],
        locator: &Locator<'_>,
        edge: Edge,
    ) {
        let mut builder =
            Builder { strands: self, yarn, locator, open: None, counted_as_clipped: false };
        for stitch in stitches {
            let first = knitted.stitches[stitch] as usize;
            let last = knitted
                .stitches
                .get(stitch + 1)
                .map_or(knitted.points.len(), |&next| next as usize);
            let whole = builder.count(&knitted.points[first..last], &located[first..last]);
            if edge == Edge::Drop && !whole {
                builder.end();
                continue;
            }
            builder.begin_piece();
            builder.add_stitch(first, &knitted.points[first..last], &located[first..last]);
        }
        builder.end();
    }
}

/// The last point that was seen.
#[derive(Clone, Copy)]
struct Last {
    flat: DVec3,
    located: Option<SurfacePoint>,
}

/// Builds the strands of one yarn, point by point.
struct Builder<'a, 'b> {
    strands: &'a mut Strands,
    yarn: YarnId,
    locator: &'a Locator<'b>,
    /// The point before, if it belongs to the yarn's unbroken run of stitches.
    open: Option<Last>,
    /// Whether the stitch at hand counts as clipped already.
    counted_as_clipped: bool,
}

impl Builder<'_, '_> {
    /// Counts a stitch; true if all of it lies on the panel.
    fn count(&mut self, points: &[DVec3], located: &[Option<SurfacePoint>]) -> bool {
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

    /// Starts a new stitch within the running strand, if there is one.
    fn begin_piece(&mut self) {
        if self.open.is_some_and(|last| last.located.is_some()) {
            self.strands.pieces.push(index32(self.strands.flat.len()));
        }
    }

    /// Adds a stitch's data points, the first of which is number `first`.
    fn add_stitch(&mut self, first: usize, flat: &[DVec3], located: &[Option<SurfacePoint>]) {
        if flat.is_empty() {
            return;
        }
        if self.stays(flat, located) {
            // Nearly every stitch: no point needs a look of its own.
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

    /// Whether the yarn is on the panel and all of the stitch is too.
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

    /// Adds the next data point, cutting the yarn where the way to it leaves the panel.
    fn add(&mut self, source: u32, flat: DVec3, located: Option<SurfacePoint>) {
        match (self.open.and_then(|last| last.located.map(|at| (last.flat, at))), located) {
            (Some((before, from)), Some(to)) => {
                if let Some(share) = self.cut(before, from, flat, to) {
                    self.end_at(before, flat, share.0, share.1);
                    self.strands.losses.clipped +=
                        usize::from(!std::mem::replace(&mut self.counted_as_clipped, true));
                    self.finish_strand();
                    self.enter(flat, to, before);
                }
            }
            (Some((before, from)), None) => {
                if let Traced::Left { at, share } =
                    self.locator.trace(before.truncate(), from, flat.truncate())
                {
                    self.end_at(before, flat, share, at);
                }
                self.finish_strand();
            }
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

    /// Where the straight way between two points of the panel leaves it, if it does. Points in one
    /// triangle need no look.
    fn cut(
        &self,
        from: DVec3,
        start: SurfacePoint,
        to: DVec3,
        end: SurfacePoint,
    ) -> Option<(f64, SurfacePoint)> {
        if start.triangle == end.triangle {
            return None;
        }
        match self.locator.trace(from.truncate(), start, to.truncate()) {
            Traced::Arrived => None,
            Traced::Left { at, share } => Some((share, at)),
        }
    }

    /// Starts a strand at the border on the way from `outside` to a point of the panel.
    fn enter(&mut self, flat: DVec3, located: SurfacePoint, outside: DVec3) {
        self.start_strand();
        match self.locator.trace(flat.truncate(), located, outside.truncate()) {
            Traced::Left { at, share } => self.end_at(flat, outside, share, at),
            Traced::Arrived => {}
        }
    }

    /// Adds a cut end on the way from `inside` to `outside`. A point on the border itself needs
    /// none: it would only repeat it.
    fn end_at(&mut self, inside: DVec3, outside: DVec3, share: f64, at: SurfacePoint) {
        if share > 0.0 {
            self.push(CUT, inside.lerp(outside, share), at);
        }
    }

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

    /// Closes the running strand. One of a single point draws nothing and goes; so does a last
    /// piece of a single point.
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

    /// Ends the yarn's unbroken run of stitches.
    fn end(&mut self) {
        if self.open.take().is_some_and(|last| last.located.is_some()) {
            self.finish_strand();
        }
    }
}
