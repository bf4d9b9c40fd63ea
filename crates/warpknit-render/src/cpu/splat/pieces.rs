//! Yarns as straight pieces between their data points. From afar, a bend between two points is
//! finer than a pixel.
//!
//! In: a scene. Out: [`SplatPieces`], which identifies a piece by its first data point and computes
//! the rest on demand. Memory: none per piece.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::cpu::to_f32;
use crate::oval::Oval;
use crate::paths;
use crate::scene::{Scene, SpanLengths, drawable};

/// Pieces, and data points, in a block. Larger blocks reach into more tiles that only some of their pieces meet.
/// Smaller ones take more memory.
pub(super) const BLOCK: u32 = 16;
/// Blocks that one task handles at a time.
const PART_BLOCKS: u32 = 256;
/// Data points for which the list of strands has one entry. More take longer to search from there.
const LISTED: usize = 128;

/// All pieces of a scene's yarns.
pub(super) struct SplatPieces<'a> {
    pub(super) scene: &'a Scene,
    /// The scene's centre, to which positions are relative.
    pub(super) centre: Vec3,
    lengths: SpanLengths,
    /// The strand of every [`LISTED`]th data point.
    strands: Vec<u32>,
    /// Whether all data points can be drawn, so that none has to be looked at again.
    is_whole: bool,
}

/// From where pieces are seen, and where they are drawn.
pub(super) trait Viewpoint {
    /// Column, row and depth of a point. `None` for points that are not drawn.
    fn project(&self, point: Vec3) -> Option<Vec3>;

    /// The direction from a point toward the viewer, of any length.
    fn toward_viewer(&self, point: Vec3) -> Vec3;
}

/// A piece: a capsule.
#[derive(Clone, Copy, Debug)]
pub(super) struct SplatPiece {
    pub(super) ends: [Vec3; 2],
    /// Radius, mm; of a flattened yarn that of the circle of the same area.
    pub(super) radius: f32,
    pub(super) oval: Oval,
}

/// What a viewer sees of a piece's section.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenSection {
    /// Half of its width, mm.
    pub(super) half_width: f32,
    /// How far it rises from the axis toward the viewer, mm.
    pub(super) rise: f32,
}

impl SplatPiece {
    /// Its direction, and any for a ball.
    pub(super) fn tangent(&self) -> Vec3 {
        (self.ends[1] - self.ends[0]).normalize_or(Vec3::X)
    }

    /// The section's shorter half-axis, mm.
    pub(super) fn half_height(&self) -> f32 {
        self.radius * self.oval.height()
    }

    /// Half of its width as seen by a viewer in a direction of any length, mm.
    pub(super) fn half_width(&self, toward: Vec3) -> f32 {
        let width = self.tangent().cross(toward).normalize_or_zero();
        self.half_height() * self.oval.reach(width)
    }
}

impl<'a> SplatPieces<'a> {
    pub(super) fn new(scene: &'a Scene, centre: Vec3) -> Self {
        let lengths = scene.span_lengths();
        let spans = scene.strands.iter().map(|strand| strand.points.len().saturating_sub(1));
        // A strand of one point has no span that would tell.
        let is_whole = lengths.count == spans.sum::<usize>() as u64
            && scene.strands.iter().all(|strand| strand.points.len() > 1);
        let mut strands = Vec::with_capacity(scene.positions.len() / LISTED + 1);
        for (number, strand) in (0..).zip(&scene.strands) {
            while strands.len() * LISTED < strand.points.end as usize {
                strands.push(number);
            }
        }
        Self { scene, centre, lengths, strands, is_whole }
    }

    /// Length of the longest piece, mm.
    pub(super) fn longest(&self) -> f32 {
        to_f32(self.lengths.longest)
    }

    /// Whether strands lie one after another in memory. The search in [`Self::strand_of`] needs that.
    pub(super) fn are_in_order(&self) -> bool {
        self.scene.strands.is_sorted_by(|one, other| one.points.end <= other.points.start)
    }

    /// Calls `draw` with both ends of each piece as a view projects them, and with its
    /// silhouette, in parallel. Points that are not drawn are left out.
    pub(super) fn for_each(
        &self,
        view: &(impl Viewpoint + Sync),
        draw: impl Fn([Vec3; 2], SeenSection) + Sync,
    ) {
        self.parts().into_par_iter().for_each(|(strand, points)| {
            self.walk(strand, points, view, |_, ends, silhouette| draw(ends, silhouette));
        });
    }

    /// Calls `draw` with the number, both projected ends and the silhouette of each piece of the
    /// block that starts at data point `first`.
    #[inline]
    pub(super) fn for_each_in_block(
        &self,
        first: u32,
        view: &impl Viewpoint,
        draw: impl FnMut(u32, [Vec3; 2], SeenSection),
    ) {
        let strand = self.strand_of(first);
        let end = self.scene.strands[strand].points.end.min(first.saturating_add(BLOCK));
        self.walk(strand, first..end, view, draw);
    }

    /// Calls `draw` for each piece that starts among these points of a strand. A single point, the
    /// last one, and one before a gap are balls. So each end of a piece is the start of another.
    #[inline]
    fn walk(
        &self,
        strand: usize,
        points: Range<u32>,
        view: &impl Viewpoint,
        mut draw: impl FnMut(u32, [Vec3; 2], SeenSection),
    ) {
        let strand = &self.scene.strands[strand];
        let Some(radius) = self.scene.radius(strand) else { return };
        // Each joint is computed once: the end of a piece is the start of the next.
        let placed = |number: u32| {
            let joint = self.joint(number, &strand.points)?;
            Some((joint, view.project(joint)?, self.scene.press(number)))
        };
        let mut number = points.start;
        let mut start = placed(number);
        while number < points.end {
            let next = number + 1;
            let end = placed(next);
            if let Some(start) = start {
                let end = end.unwrap_or(start);
                let radius = radius * self.scene.thickness(strand, number);
                let [half_width, rise] = match (start.2, end.2) {
                    // A ball has no width.
                    _ if start.0 == end.0 => [radius; 2],
                    (Some(one), Some(other)) => one
                        .lerp(other, 0.5)
                        .silhouette(end.0 - start.0, view.toward_viewer(start.0))
                        .map(|factor| factor * radius),
                    _ => [radius; 2],
                };
                draw(number, [start.1, end.1], SeenSection { half_width, rise });
            }
            (number, start) = (next, end);
        }
    }

    /// The piece between two joints that starts at data point `first`.
    fn pressed(&self, ends: [Vec3; 2], radius: f32, first: u32) -> SplatPiece {
        let piece = SplatPiece { ends, radius, oval: Oval::ROUND };
        match [first, first + 1].map(|point| self.scene.press(point)) {
            // The last point of all is a ball.
            [Some(start), Some(end)] if ends[0] != ends[1] => {
                SplatPiece { oval: start.lerp(end, 0.5).oval(piece.tangent()), ..piece }
            }
            _ => piece,
        }
    }

    /// All drawable points.
    pub(super) fn points(&self) -> impl ParallelIterator<Item = Vec3> {
        self.parts()
            .into_par_iter()
            .filter(|(strand, _)| self.scene.radius(&self.scene.strands[*strand]).is_some())
            .flat_map_iter(|(_, points)| {
                let positions = &self.scene.positions[points.start as usize..points.end as usize];
                positions.iter().filter(|point| drawable(**point)).map(|point| *point - self.centre)
            })
    }

    /// The piece that starts at data point `first` of a strand, if there is one.
    pub(super) fn piece(&self, strand: usize, first: u32) -> Option<SplatPiece> {
        let strand = &self.scene.strands[strand];
        let start = self.joint(first, &strand.points)?;
        let ends = [start, self.joint(first + 1, &strand.points).unwrap_or(start)];
        let radius = self.scene.radius(strand)? * self.scene.thickness(strand, first);
        Some(self.pressed(ends, radius, first))
    }

    /// The strand of a data point.
    pub(super) fn strand_of(&self, point: u32) -> usize {
        let from = self.strands[point as usize / LISTED] as usize;
        let after = self.scene.strands[from..].iter().position(|strand| point < strand.points.end);
        from + after.expect("a data point belongs to a strand")
    }

    /// Arc length at fraction `s` of that piece, mm, as if all pieces had the mean length. Exact
    /// lengths would need 4 bytes a point; they only shift the texture along the yarn.
    pub(super) fn along(&self, strand: usize, first: u32, s: f32) -> f32 {
        let pieces = f64::from(first - self.scene.strands[strand].points.start) + f64::from(s);
        to_f32(
            paths::phase(self.scene.strands[strand].yarn)
                + pieces * (self.lengths.sum / self.lengths.count.max(1) as f64),
        )
    }

    /// The point where two pieces meet. It is moved outward from the bend there, so that on average
    /// the pieces lie on the curve and not inside it. A span of a uniform Catmull-Rom curve lies
    /// (p1 + p2 - p0 - p3) / 24 beside its chord on average. The mean of that over the two spans at
    /// a point gives the shift.
    #[inline]
    fn joint(&self, point: u32, strand: &Range<u32>) -> Option<Vec3> {
        if point >= strand.end {
            return None;
        }
        let positions = &self.scene.positions;
        let point = point as usize;
        let here = positions[point];
        if !self.is_whole && !drawable(here) {
            return None;
        }
        let inner = strand.start as usize + 2 <= point && point + 2 < strand.end as usize;
        // No shift at the ends, where a span has no neighbour beyond it.
        let bend = if inner {
            here * 2.0 - positions[point - 2] - positions[point + 2]
        } else {
            Vec3::ZERO
        };
        let is_bend = self.is_whole || drawable(bend);
        Some(here - self.centre + if is_bend { bend / 48.0 } else { Vec3::ZERO })
    }

    /// Strands cut into parts for tasks.
    pub(super) fn parts(&self) -> Vec<(usize, Range<u32>)> {
        let mut parts = Vec::new();
        for (number, strand) in self.scene.strands.iter().enumerate() {
            let Range { start, end } = strand.points;
            let part = PART_BLOCKS * BLOCK;
            for first in (start..end).step_by(part as usize) {
                parts.push((number, first..end.min(first.saturating_add(part))));
            }
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::YarnLook;

    /// A view that leaves points where they are.
    struct InPlace;

    impl Viewpoint for InPlace {
        fn project(&self, point: Vec3) -> Option<Vec3> {
            Some(point)
        }

        fn toward_viewer(&self, _: Vec3) -> Vec3 {
            Vec3::Z
        }
    }

    fn drawn(scene: &Scene) -> Vec<(u32, [Vec3; 2])> {
        let pieces = SplatPieces::new(scene, Vec3::ZERO);
        let mut found = Vec::new();
        for (_, points) in pieces.parts() {
            for first in points.step_by(BLOCK as usize) {
                pieces.for_each_in_block(first, &InPlace, |number, ends, _| {
                    found.push((number, ends));
                });
            }
        }
        found
    }

    #[test]
    fn gaps_and_ends_are_balls_and_what_has_no_radius_is_left_out() {
        let mut scene = Scene {
            looks: vec![YarnLook::plain(Vec3::ONE, 0.5, 0.1), YarnLook::plain(Vec3::ONE, 0.5, 0.0)],
            ..Scene::default()
        };
        scene.push_strand([Vec3::ZERO, Vec3::X, Vec3::NAN, Vec3::Y], 0);
        scene.push_strand([Vec3::ZERO, Vec3::X], 1);
        scene.push_strand([Vec3::Z], 0);
        let expected =
            [(0, [Vec3::ZERO, Vec3::X]), (1, [Vec3::X; 2]), (3, [Vec3::Y; 2]), (6, [Vec3::Z; 2])];
        assert_eq!(drawn(&scene), expected);
        let pieces = SplatPieces::new(&scene, Vec3::ZERO);
        assert_eq!([0, 3, 4, 5, 6].map(|point| pieces.strand_of(point)), [0, 0, 1, 1, 2]);
        assert_eq!((pieces.longest(), pieces.points().count()), (1.0, 4));
    }

    #[test]
    fn pieces_of_an_arc_lie_on_it_on_the_average() {
        let mut scene =
            Scene { looks: vec![YarnLook::plain(Vec3::ONE, 0.5, 0.01)], ..Scene::default() };
        scene.push_strand(
            (0_u8..60)
                .map(|i| Vec3::new((f32::from(i) * 0.5).cos(), (f32::from(i) * 0.5).sin(), 0.0)),
            0,
        );
        let pieces = drawn(&scene);
        let inner = &pieces[10..50];
        let places = inner.iter().flat_map(|(_, [one, other])| {
            (0_u8..100).map(move |i| one.lerp(*other, f32::from(i) / 100.0).length())
        });
        let mean = places.sum::<f32>() / 4000.0;
        assert!((mean - 1.0).abs() < 0.003, "{mean}; chords alone lie at .98");
    }
}
