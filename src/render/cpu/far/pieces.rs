//! Yarns as the straight pieces between their data points: from afar, a bend between two of them is finer than a pixel shows.
//!
//! In: a scene. Out: [`Pieces`], which names a piece by its first data point and keeps nothing of it.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::ids::index32;
use crate::render::cpu::narrow;
use crate::render::paths;
use crate::scene::{Scene, Strand, drawable};

/// Data points of which a thread draws the pieces at a time.
const PART: u32 = 4096;

/// All pieces of a scene's yarns.
pub(super) struct Pieces<'a> {
    pub(super) scene: &'a Scene,
    /// The scene's middle, to which places are relative.
    centre: Vec3,
    /// Mean length of a piece, mm.
    length: f64,
}

/// A piece: a line with round ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) ends: [Vec3; 2],
    pub(super) radius: f32,
}

impl<'a> Pieces<'a> {
    pub(super) fn new(scene: &'a Scene, centre: Vec3) -> Self {
        Self { scene, centre, length: mean_length(scene) }
    }

    /// Largest radius of a yarn, mm.
    pub(super) fn thickest(&self) -> f32 {
        self.scene.strands.iter().filter_map(|strand| self.scene.radius(strand)).fold(0.0, f32::max)
    }

    /// Calls `draw` with every piece's number, both ends as `place` puts them, and the radius, in parallel. What has no place is left out.
    pub(super) fn for_each(&self, place: impl Fn(Vec3) -> Option<Vec3> + Sync, draw: impl Fn(u32, [Vec3; 2], f32) + Sync) {
        self.parts().into_par_iter().for_each(|(strand, points)| {
            let strand = &self.scene.strands[strand];
            let Some(radius) = self.scene.radius(strand) else { return };
            let placed = |point: u32| self.axis(point, &strand.points).and_then(&place);
            let mut start = placed(points.start);
            for number in points {
                let next = placed(number + 1);
                if let Some(start) = start {
                    // A last point, and one before a gap, is a ball.
                    draw(number, [start, next.unwrap_or(start)], radius);
                }
                start = next;
            }
        });
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
    pub(super) fn piece(&self, strand: usize, first: u32) -> Option<Piece> {
        let strand = &self.scene.strands[strand];
        let start = self.axis(first, &strand.points)?;
        let ends = [start, self.axis(first + 1, &strand.points).unwrap_or(start)];
        Some(Piece { ends, radius: self.scene.radius(strand)? })
    }

    /// The strand of a data point.
    pub(super) fn strand_of(&self, point: u32) -> usize {
        self.scene.strands.partition_point(|strand| strand.points.end <= point)
    }

    /// The yarn's direction at share `s` of the piece that starts at data point `first`: turns evenly from piece to piece.
    pub(super) fn tangent(&self, strand: usize, first: u32, s: f32) -> Vec3 {
        let points = &self.scene.strands[strand].points;
        let slope = |point: u32| {
            let ends = [point.saturating_sub(1).max(points.start), (point + 1).min(points.end - 1)];
            let [before, after] = ends.map(|end| self.scene.positions[end as usize]);
            (after - before).normalize_or_zero()
        };
        slope(first).lerp(slope((first + 1).min(points.end - 1)), s).normalize_or(Vec3::X)
    }

    /// Arc length at share `s` of that piece, mm: as if all pieces were of one length.
    pub(super) fn along(&self, strand: usize, first: u32, s: f32) -> f32 {
        let pieces = f64::from(first - self.scene.strands[strand].points.start) + f64::from(s);
        narrow(paths::phase(index32(strand)) + pieces * self.length)
    }

    /// Where the pieces at a data point meet: moved out of the bend there, so that pieces lie where the curve does on the average. A span of a
    /// Catmull-Rom curve (here taken for a uniform one) lies (p1 + p2 - p0 - p3) / 24 aside of its chord.
    #[inline]
    fn axis(&self, point: u32, strand: &Range<u32>) -> Option<Vec3> {
        let at = |point: u32| self.scene.positions[point as usize];
        let here = at(point.min(strand.end - 1));
        if point >= strand.end || !drawable(here) {
            return None;
        }
        let inner = strand.start + 2 <= point && point + 2 < strand.end;
        let bend = if inner { here * 2.0 - at(point - 2) - at(point + 2) } else { Vec3::ZERO };
        Some(here - self.centre + if drawable(bend) { bend / 48.0 } else { Vec3::ZERO })
    }

    fn parts(&self) -> Vec<(usize, Range<u32>)> {
        let parts = |(number, strand): (usize, &Strand)| {
            let Range { start, end } = strand.points;
            (start..end).step_by(PART as usize).map(move |first| (number, first..end.min(first.saturating_add(PART))))
        };
        self.scene.strands.iter().enumerate().flat_map(parts).collect()
    }
}

/// Mean distance between neighbouring data points, mm.
fn mean_length(scene: &Scene) -> f64 {
    let length = |strand: &Strand| {
        let points = &scene.positions[strand.points.start as usize..strand.points.end as usize];
        points.windows(2).map(|ends| f64::from(ends[0].distance(ends[1]))).filter(|length| length.is_finite()).sum::<f64>()
    };
    // Summed in order, so that any number of threads finds the same.
    let lengths: Vec<f64> = scene.strands.par_iter().map(length).collect();
    lengths.iter().sum::<f64>() / f64::from(index32(scene.positions.len().max(1)))
}
