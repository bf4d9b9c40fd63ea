//! Yarns as chains of short capsules.
//!
//! In: a scene and the size that a pixel has on it. Out: [`Segments`], structure of arrays, 36 bytes a segment: points on
//! the centripetal Catmull-Rom curve, with the curve's own tangent and a rotation-minimising frame (double reflection, Wang et al.
//! 2008) at each. Curves are cut so that a chord leaves its curve by less than [`CHORD_ERROR`] pixels, where [`MAX_PIECES`] allows.
//! Coordinates are relative to the scene's middle, which keeps `f32` good to a ten-thousandth of a millimetre on a garment. A
//! strand is broken where a point is not [`drawable`]; a lone point becomes a ball.

use crate::ids::index32;
use crate::render::Camera;
use crate::scene::{Bounds, Scene, Strand, drawable};
use crate::yarn::curve::{self, Span};
use crate::yarn::frame;
use glam::{DVec3, I16Vec3, Vec3, Vec4};
use rayon::prelude::*;

/// Largest distance between a curve and its chord, pixels.
const CHORD_ERROR: f64 = 0.2;
/// Most pieces between two data points; at 8, a half turn is a sixteen-sided polygon's.
const MAX_PIECES: u32 = 8;
/// Unit vectors are stored as 16-bit integers of this length.
const UNIT: f32 = 32_767.0;

/// Most segments that share a box in the hierarchy: two halve the memory of building it, for boxes that are hardly looser.
const LINK: usize = 2;

/// Capsules between consecutive points. A segment is named by its first point; strands end with a point of radius 0, which starts
/// none. A link is one or more segments in a row.
#[derive(Debug, Default)]
pub(super) struct Segments {
    /// What to add to a point to be in the world.
    pub(super) centre: DVec3,
    /// The axis, and in w the radius of the segment that starts here.
    pub(super) points: Vec<Vec4>,
    /// First points of the links.
    pub(super) links: Vec<u32>,
    tangents: Vec<I16Vec3>,
    /// Unit vectors across the yarn from which angles around it count.
    across: Vec<I16Vec3>,
    /// Arc length, mm, from a start that differs from strand to strand.
    along: Vec<f32>,
    looks: Vec<u16>,
}

/// A place on a segment's axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisPoint {
    pub(super) position: Vec3,
    pub(super) radius: f32,
    /// Unit tangent of the curve, continuous from segment to segment.
    pub(super) tangent: Vec3,
    pub(super) across: Vec3,
    pub(super) along: f32,
}

impl Segments {
    /// Cuts up all strands for a picture `height` pixels high; `bounds` are the scene's.
    pub(super) fn of(scene: &Scene, bounds: &Bounds, camera: &Camera, height: u32) -> Self {
        let centre = bounds.centre().as_dvec3();
        let eye = camera.eye() - centre;
        let pieces = |span: &Span| pieces(span, |distance| camera.pixel_size(distance, height), eye);
        let parts: Vec<Self> = (scene.strands.par_chunks(64).enumerate())
            .map(|(chunk, strands)| {
                let mut part = Self { centre, ..Self::default() };
                for (offset, strand) in strands.iter().enumerate() {
                    part.push_strand(scene, strand, index32(chunk * 64 + offset), &pieces);
                }
                part
            })
            .collect();
        Self::joined(centre, parts)
    }

    fn joined(centre: DVec3, parts: Vec<Self>) -> Self {
        let points = parts.iter().map(|part| part.points.len()).sum();
        let mut all = Self {
            centre,
            points: Vec::with_capacity(points),
            links: Vec::with_capacity(points / LINK),
            tangents: Vec::with_capacity(points),
            across: Vec::with_capacity(points),
            along: Vec::with_capacity(points),
            looks: Vec::with_capacity(points),
        };
        for part in parts {
            let first = index32(all.points.len());
            all.links.extend(part.links.iter().map(|link| link + first));
            all.points.extend(part.points);
            all.tangents.extend(part.tangents);
            all.across.extend(part.across);
            all.along.extend(part.along);
            all.looks.extend(part.looks);
        }
        all
    }

    fn push_strand(&mut self, scene: &Scene, strand: &Strand, number: u32, pieces: &impl Fn(&Span) -> u32) {
        let Some(radius) = scene.radius(strand) else { return };
        let positions = &scene.positions[strand.points.start as usize..strand.points.end as usize];
        for run in positions.split(|&point| !drawable(point)).filter(|run| !run.is_empty()) {
            let mut points: Vec<DVec3> = run.iter().map(|point| point.as_dvec3() - self.centre).collect();
            if points.len() == 1 {
                points.push(points[0]);
            }
            self.push_run(&points, radius, strand.look, phase(number), pieces);
        }
    }

    fn push_run(&mut self, points: &[DVec3], radius: f32, look: u16, mut along: f64, pieces: &impl Fn(&Span) -> u32) {
        let mut frame = Frame::default();
        let first = self.points.len();
        for index in 0..points.len() - 1 {
            let span = curve::span(points, index);
            let count = pieces(&span);
            let last = u32::from(index + 2 == points.len());
            for piece in 0..count + last {
                let t = f64::from(piece) / f64::from(count);
                let (position, tangent) = (span.at(t), span.tangent(t));
                along += frame.advance(position, tangent);
                self.points.push(position.as_vec3().extend(radius));
                self.tangents.push((frame.tangent.as_vec3() * UNIT).as_i16vec3());
                self.across.push((frame.across.as_vec3() * UNIT).as_i16vec3());
                self.along.push(narrow(along));
                self.looks.push(look);
            }
        }
        let last = self.points.len() - 1;
        self.points[last].w = 0.0;
        self.links.extend((first..last).step_by(LINK).map(index32));
    }

    /// The segments of a link.
    pub(super) fn of_link(&self, link: u32) -> impl Iterator<Item = u32> {
        (link..).take(LINK).take_while(|&start| self.points[start as usize].w > 0.0)
    }

    /// The look of the segment that starts at point `start`.
    pub(super) fn look(&self, start: u32) -> u16 {
        self.looks[start as usize]
    }

    /// The axis point nearest to `position` of the segment that starts at point `start`.
    pub(super) fn axis_point(&self, start: u32, position: Vec3) -> AxisPoint {
        let (i, j) = (start as usize, start as usize + 1);
        let a = self.points[i].truncate();
        let ab = self.points[j].truncate() - a;
        let length2 = ab.length_squared();
        let s = if length2 > 0.0 { ((position - a).dot(ab) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let between = |units: &[I16Vec3]| units[i].as_vec3().lerp(units[j].as_vec3(), s);
        AxisPoint {
            position: a + ab * s,
            radius: self.points[i].w,
            tangent: between(&self.tangents).normalize_or(Vec3::X),
            across: between(&self.across),
            along: self.along[i] + s * length2.sqrt(),
        }
    }
}

/// Pieces that keep the chord error of `span` below [`CHORD_ERROR`], given the size of a pixel at a distance from `eye`.
fn pieces(span: &Span, pixel_size: impl Fn(f64) -> f64, eye: DVec3) -> u32 {
    let (start, middle, end) = (span.tangent(0.0), span.tangent(0.5), span.tangent(1.0));
    // The second derivative is linear in t, so its largest value is at an end; a chord of 1/n leaves the curve by |p''| / (8 n^2).
    let cubic = 2.0 * (start + end) - 4.0 * middle;
    let bend = (end - start - cubic).length().max((end - start + cubic).length());
    let pixel = pixel_size(span.at(0.5).distance(eye));
    let wanted = (bend / (8.0 * CHORD_ERROR * pixel.max(f64::MIN_POSITIVE))).sqrt();
    (1..MAX_PIECES).find(|&count| f64::from(count) >= wanted).unwrap_or(MAX_PIECES)
}

/// Where a strand's arc length starts, mm: spread out, so that neighbours don't show the same plies side by side.
fn phase(strand: u32) -> f64 {
    f64::from(crate::render::ply::hash(strand) >> 20) * 0.37
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// A rotation-minimising frame on its way along a yarn.
#[derive(Debug, Default)]
struct Frame {
    position: DVec3,
    tangent: DVec3,
    across: DVec3,
}

impl Frame {
    /// Moves on to `position`, where the curve runs along `derivative`; the distance moved, 0 for the first point.
    fn advance(&mut self, position: DVec3, derivative: DVec3) -> f64 {
        let fallback = if self.tangent == DVec3::ZERO { DVec3::X } else { self.tangent };
        let tangent = derivative.try_normalize().unwrap_or(fallback);
        let first = self.tangent == DVec3::ZERO;
        let across = if first {
            frame::across(DVec3::Z, tangent)
        } else {
            frame::carry(self.across, self.position, self.tangent, position, tangent)
        };
        let moved = if first { 0.0 } else { position.distance(self.position) };
        *self = Self { position, tangent, across };
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::YarnLook;

    fn scene(strands: &[&[Vec3]]) -> Scene {
        let mut scene = Scene::default();
        scene.looks.push(YarnLook::plain(Vec3::ONE, 0.5, 0.1));
        strands.iter().for_each(|points| scene.push_strand(points.iter().copied(), 0));
        scene
    }

    fn segments(scene: &Scene, height: u32) -> Segments {
        let bounds = scene.bounds().unwrap();
        let camera = Camera::view(crate::render::View::Front, &scene.positions, 0.5, 1.0, 1.0);
        Segments::of(scene, &bounds, &camera, height)
    }

    fn starts(segments: &Segments) -> Vec<u32> {
        segments.links.iter().flat_map(|&link| segments.of_link(link)).collect()
    }

    #[test]
    fn straight_spans_stay_whole_and_bends_are_cut_as_pixels_ask() {
        let straight = scene(&[&[Vec3::ZERO, Vec3::X, Vec3::X * 2.0]]);
        assert_eq!(starts(&segments(&straight, 1000)), [0, 1]);
        let bent = scene(&[&[Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y]]);
        let counts = [2, 8, 100_000].map(|height| starts(&segments(&bent, height)).len());
        assert!(counts[0] < counts[1] && counts[1] < counts[2] && counts[2] == 24, "{counts:?}");
    }

    #[test]
    fn strands_are_not_joined_and_bad_points_break_them() {
        let broken = scene(&[&[Vec3::ZERO, Vec3::X], &[Vec3::Y, Vec3::NAN, Vec3::Z, Vec3::Z]]);
        let cut = segments(&broken, 10);
        assert_eq!(starts(&cut), [0, 2, 4]);
        assert!(cut.points.iter().all(|point| point.is_finite()));
    }

    #[test]
    fn the_frame_does_not_turn_about_the_axis() {
        // A quarter circle in the plane z = 0: the normal of the plane is carried along unchanged.
        let arc: Vec<Vec3> = (0_u8..=8).map(|i| Vec3::from_angle_xy(f32::from(i) * 0.2)).collect();
        let cut = segments(&scene(&[&arc]), 4000);
        for start in starts(&cut) {
            let axis = cut.axis_point(start, cut.points[start as usize].truncate());
            assert!((axis.across / UNIT - Vec3::Z).length() < 1e-3);
            assert!(axis.tangent.z.abs() < 1e-3);
        }
    }

    trait FromAngle {
        fn from_angle_xy(angle: f32) -> Vec3;
    }

    impl FromAngle for Vec3 {
        fn from_angle_xy(angle: f32) -> Vec3 {
            Self::new(angle.cos(), angle.sin(), 0.0)
        }
    }
}
