//! Yarns of endless cloth: one repeat of each, closed, and copies of it side by side.
//!
//! In: the control points of a yarn over one repeat, and the way to the next repeat. Out: a
//! [`ClosedPath`], whose end continues its start, and [`YarnPaths`] of as many copies as reach into
//! a rectangle. All copies are equal but for their place, so whatever is drawn of them repeats.
//!
//! A rotation-minimising frame has turned about the yarn's axis when it comes to the next repeat
//! (the holonomy of parallel transport). That angle is taken back evenly along the yarn. Cost:
//! linear in the points of all copies.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3, Quat, Vec3, Vec3A};

use crate::octahedral::PackedUnit;
use crate::oval::{Oval, PackedPress};
use crate::paths::{PLAIN_SHADE, YarnPaths, pieces};
use crate::tangent_frame::TangentFrame;
use warpknit_core::number::narrow;
use warpknit_core::yarn::curve;

/// A point of a closed path.
#[derive(Clone, Copy, Debug)]
struct PathPoint {
    position: DVec3,
    tangent: Vec3A,
    across: Vec3A,
    /// The section, where yarns are flattened.
    oval: Option<Oval>,
    /// Arc length from the start of the repeat, mm.
    along: f64,
}

/// One repeat of a yarn as a polyline. The point after the last one is the first one, moved by
/// `period`.
#[derive(Clone, Debug)]
pub(super) struct ClosedPath {
    points: Vec<PathPoint>,
    /// From a point to the same point in the next repeat, mm.
    period: DVec3,
    /// Arc length of one repeat, mm.
    pub(super) length: f64,
}

/// Which copies of a closed path are drawn, and how.
pub(super) struct Copies {
    /// The rectangle that they reach into: its lowest-left and its upper right corner, mm.
    pub(super) within: [DVec2; 2],
    /// Width and height of the repeat, mm.
    pub(super) cell: DVec2,
    /// Radius of the yarn, mm.
    pub(super) radius: f32,
    /// Index of the look.
    pub(super) look: u16,
}

impl ClosedPath {
    /// Subdivides one repeat of a yarn as pictures do whose pixels are `pixel` mm wide. `controls` are
    /// its control points, at least one, and `ratios` the width over the height of its section at
    /// each, or none where yarns are round.
    pub(super) fn new(controls: &[DVec3], ratios: &[f32], period: DVec3, pixel: f64) -> Self {
        let unrolled = unrolled(controls, period);
        let mut frame = TangentFrame::default();
        let (mut points, mut along) = (Vec::new(), 0.0);
        for index in 1..=controls.len() {
            let span = curve::span(&unrolled, index);
            let count = pieces(&span, |_| pixel);
            for piece in 0..count {
                let t = f64::from(piece) / f64::from(count);
                let position = span.at(t);
                along += frame.advance(position, span.tangent(t));
                let (tangent, across) = (frame.tangent, frame.across);
                let ends = ratios.get(index - 1).zip(ratios.get(index % controls.len()));
                let oval = ends.map(|(start, end)| {
                    let [start, end] =
                        [start, end].map(|ratio| PackedPress::new(Vec3::Z, *ratio).unpack());
                    start.lerp(end, narrow(t)).oval(tangent.into())
                });
                points.push(PathPoint { position, tangent, across, oval, along });
            }
        }
        let last = curve::span(&unrolled, controls.len());
        let length = along + frame.advance(last.at(1.0), last.tangent(1.0));
        let mut path = Self { points, period, length };
        path.close(frame.across);
        path
    }

    /// Turns the frames so that they continue at the next repeat, where `arrived` is the direction
    /// across the yarn that the first point's has become.
    fn close(&mut self, arrived: Vec3A) {
        let PathPoint { tangent, across, .. } = self.points[0];
        let turned = tangent.dot(across.cross(arrived)).atan2(across.dot(arrived));
        for point in &mut self.points {
            let back = -turned * narrow(point.along / self.length.max(f64::MIN_POSITIVE));
            let turn = Quat::from_axis_angle(Vec3::from(point.tangent).normalize_or(Vec3::X), back);
            point.across = turn * point.across;
        }
    }

    /// Lowest and highest coordinates of the axis over one repeat.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        let positions = self.points.iter().map(|point| point.position);
        let low = positions.clone().fold(DVec3::INFINITY, DVec3::min);
        [low, positions.fold(DVec3::NEG_INFINITY, DVec3::max)]
    }
}

impl YarnPaths {
    /// Appends all copies of a yarn that reach into a rectangle. Copies that follow each other along
    /// the yarn are one strand. Arc lengths count from the strand's first repeat on, whole repeats
    /// included.
    pub(super) fn push_copies(&mut self, path: &ClosedPath, copies: &Copies) {
        let [low, high] = path.bounds();
        let widest = path.points.iter().filter_map(|point| Some(point.oval?.half_width()));
        let reach = DVec3::splat(f64::from(copies.radius * widest.fold(1.0, f32::max)));
        let (low, high) = (low - reach, high + reach);
        // The period is along one axis of the cell, and strands lie side by side along the other.
        let runs_across = path.period.x.abs() > path.period.y.abs();
        let axis = usize::from(!runs_across);
        let beside = if runs_across { DVec3::Y } else { DVec3::X } * copies.cell.extend(0.0);
        let [from, to] = copies.within;
        let along = images(from[axis]..=to[axis], low[axis]..=high[axis], path.period[axis]);
        let side = 1 - axis;
        for strand in images(from[side]..=to[side], low[side]..=high[side], beside[side]) {
            for image in along.clone() {
                let shift = path.period * f64::from(image) + beside * f64::from(strand);
                let before = path.length * f64::from(image - along.start());
                for point in &path.points {
                    self.push_copy(point, shift, before, copies);
                }
            }
            let after = path.period * f64::from(along.end() + 1) + beside * f64::from(strand);
            let before = path.length * f64::from(along.end() + 1 - along.start());
            self.push_copy(&path.points[0], after, before, copies);
            // A radius of 0 marks the end: no piece starts there.
            if let Some(last) = self.points.last_mut() {
                last.w = 0.0;
            }
        }
    }

    /// Appends a point, moved by `shift` and by an arc length.
    fn push_copy(&mut self, point: &PathPoint, shift: DVec3, before: f64, copies: &Copies) {
        let position = point.position + shift - self.centre;
        let mut radius = copies.radius;
        if let Some(oval) = point.oval {
            radius *= oval.height();
            self.ovals.push(oval.pack());
        }
        self.points.push(position.as_vec3().extend(radius));
        self.tangents.push(PackedUnit::new(point.tangent.into()));
        self.across.push(PackedUnit::new(point.across.into()));
        self.along.push(narrow(before + point.along));
        self.looks.push(copies.look);
        self.shades.push(PLAIN_SHADE);
    }
}

/// The points of a repeat, with one before them and two after them, which shape its first and its
/// last span.
fn unrolled(controls: &[DVec3], period: DVec3) -> Vec<DVec3> {
    let count = i32::try_from(controls.len()).expect("repeats are limited");
    let point = |at: i32| {
        let place = usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative");
        controls[place] + period * f64::from(at.div_euclid(count))
    };
    (-1..count + 2).map(point).collect()
}

/// The numbers of the images, each moved by `period` times its number, of what lies in `own` that
/// reach into `within`.
fn images(
    within: RangeInclusive<f64>,
    own: RangeInclusive<f64>,
    period: f64,
) -> RangeInclusive<i32> {
    let ends = [(within.start() - own.end()) / period, (within.end() - own.start()) / period];
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounded before, and some hundreds at most"
    )]
    let [first, last] = [ends[0].ceil() as i32, ends[1].floor() as i32];
    first..=last
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A helix is the hardest: its frames turn all the way.
    fn helix() -> ClosedPath {
        let points: Vec<DVec3> = (0_u8..12)
            .map(|at| {
                let angle = f64::from(at) * std::f64::consts::TAU / 12.0;
                DVec3::new(0.3 * angle.cos(), f64::from(at) / 12.0, 0.3 * angle.sin())
            })
            .collect();
        ClosedPath::new(&points, &[], DVec3::Y, 1e-3)
    }

    fn copies(within: [DVec2; 2]) -> YarnPaths {
        let mut paths = YarnPaths::default();
        let cell = DVec2::ONE;
        paths.push_copies(&helix(), &Copies { within, cell, radius: 0.05, look: 0 });
        paths
    }

    #[test]
    fn frames_and_lengths_continue_in_the_next_repeat() {
        let path = helix();
        let (first, last) = (path.points[0], *path.points.last().unwrap());
        let carried = last.across - first.tangent * last.across.dot(first.tangent);
        // From the last point to the next repeat's first is a step as between any two.
        assert!(carried.normalize().dot(first.across) > 0.99);
        let turn = std::f64::consts::TAU * 0.3;
        assert!((path.length - turn.hypot(1.0)).abs() < 0.02, "{}", path.length);
    }

    #[test]
    fn copies_fill_the_rectangle_and_are_equal() {
        let paths = copies([DVec2::ZERO, DVec2::new(2.0, 3.0)]);
        let ends = paths.points.iter().filter(|point| point.w == 0.0).count();
        // Strands at x = 0, 1 and 2: each is 0.35 wide to both sides.
        assert_eq!(ends, 3);
        let strand = paths.points.len() / 3;
        for (one, next) in paths.points.iter().zip(&paths.points[strand..]) {
            assert!((next.x - one.x - 1.0).abs() < 1e-6 && (next.z - one.z).abs() < 1e-6);
        }
        let [low, high] = [f32::min, f32::max]
            .map(|choose| paths.points.iter().map(|point| point.y).reduce(choose).unwrap());
        assert!(low <= 0.0 && high >= 3.0, "{low} {high}");
    }
}
