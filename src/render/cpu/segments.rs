//! The chains of capsules or strips that rays meet, in links of neighbours that share a box.
//!
//! In: a scene and a camera. Out: [`Segments`]: [`Paths`] whose pieces are capsules, or strips of ribbon, and links, 2 bytes a piece more at most.

use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use super::strip::Strip;
use crate::ids::index32;
use crate::render::paths::{Cut, Paths};
use crate::render::{Camera, Options};
use crate::scene::{Bounds, Scene, Shape};

/// Segments that share a box in the hierarchy: two halve the memory of building it, for boxes that are hardly looser. More of them, where
/// there are so many that building takes longer than tracing, and more again, where memory runs short.
const LINKS: [(usize, u32); 3] = [(0, 2), (LARGE, 4), (8 * LARGE, 8)];
const LARGE: usize = 3_000_000;
/// Strands that are cut at a time before they are put with the others, and strands that a thread takes of them.
const BATCH: usize = 512;
const PART: usize = 8;

/// Capsules, or strips, between consecutive points. A segment is named by its first point; a link is one or more segments in a row.
#[derive(Debug, Default)]
pub(super) struct Segments {
    pub(super) shape: Shape,
    pub(super) paths: Paths,
    /// First points of the links.
    pub(super) links: Vec<u32>,
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
    /// Cuts up all strands for a picture; `bounds` are the scene's.
    pub(super) fn of(scene: &Scene, bounds: &Bounds, camera: &Camera, options: &Options) -> Self {
        let centre = bounds.centre().as_dvec3();
        let count = scene.strands.len();
        let mut paths = Paths { centre, ..Paths::default() };
        for batch in (0..count).step_by(BATCH) {
            let end = count.min(batch + BATCH);
            let parts: Vec<Paths> = ((batch..end).into_par_iter().step_by(PART))
                .map(|first| Paths::of(scene, first..end.min(first + PART), centre, Cut::Picture(camera, options)))
                .collect();
            parts.iter().for_each(|part| paths.append(part));
        }
        let mut segments = Self { shape: scene.shape, paths, links: Vec::new() };
        segments.links = links(&segments.paths, segments.most_in_link());
        segments
    }

    /// Whether there are so many that building the hierarchy counts for more than tracing it.
    pub(super) fn is_large(&self) -> bool {
        self.paths.points.len() > LARGE
    }

    fn most_in_link(&self) -> u32 {
        LINKS.iter().rev().find(|(least, _)| self.paths.points.len() >= *least).map_or(1, |(_, most)| *most)
    }

    /// The segments of a link.
    pub(super) fn of_link(&self, link: u32) -> impl Iterator<Item = u32> {
        (link..link + self.most_in_link()).take_while(|&start| self.paths.points[start as usize].w > 0.0)
    }

    /// The strip of ribbon that starts at point `start`.
    pub(super) fn strip(&self, start: u32) -> Strip {
        let (i, j) = (start as usize, start as usize + 1);
        let points = &self.paths.points;
        // A strand's last point has no radius of its own.
        let end_radius = if points[j].w > 0.0 { points[j].w } else { points[i].w };
        Strip { a: self.edge(i, points[i].w), b: self.edge(j, end_radius) }
    }

    /// Both ends of a ribbon's width.
    fn edge(&self, point: usize, radius: f32) -> [Vec3A; 2] {
        let axis = Vec3A::from_vec4(self.paths.points[point]);
        let (tangent, normal) = (self.paths.tangents[point].unpack(), self.paths.across[point].unpack());
        let aside = Vec3A::from(tangent.cross(normal).normalize_or_zero() * radius);
        [axis - aside, axis + aside]
    }

    /// The look of the segment that starts at point `start`.
    pub(super) fn look(&self, start: u32) -> u16 {
        self.paths.looks[start as usize]
    }

    /// Arc length at share `s` of the segment that starts at point `start`.
    pub(super) fn along(&self, start: u32, s: f32) -> f32 {
        let (a, b) = (self.paths.along[start as usize], self.paths.along[start as usize + 1]);
        a + s * (b - a)
    }

    /// Tangent and direction across there, as [`Paths`] has them.
    pub(super) fn directions(&self, start: u32, s: f32) -> (Vec3, Vec3) {
        let (i, j) = (start as usize, start as usize + 1);
        let (tangents, across) = (&self.paths.tangents, &self.paths.across);
        let tangent = tangents[i].unpack().lerp(tangents[j].unpack(), s).normalize_or(Vec3::X);
        (tangent, across[i].unpack().lerp(across[j].unpack(), s))
    }

    /// The axis point nearest to `position` of the segment that starts at point `start`.
    pub(super) fn axis_point(&self, start: u32, position: Vec3) -> AxisPoint {
        let paths = &self.paths;
        let (i, j) = (start as usize, start as usize + 1);
        let a = paths.points[i].truncate();
        let ab = paths.points[j].truncate() - a;
        let length2 = ab.length_squared();
        let s = if length2 > 0.0 { ((position - a).dot(ab) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let (tangent, across) = self.directions(start, s);
        AxisPoint { position: a + ab * s, radius: paths.points[i].w, tangent, across, along: self.along(start, s) }
    }
}

/// Every `most`th segment of a strand, counted from its start.
fn links(paths: &Paths, most: u32) -> Vec<u32> {
    let mut links = Vec::with_capacity(paths.points.len() / most as usize + 1);
    let mut in_row = 0;
    for (start, point) in paths.points.iter().enumerate() {
        if point.w > 0.0 {
            if in_row % most == 0 {
                links.push(index32(start));
            }
            in_row += 1;
        } else {
            in_row = 0;
        }
    }
    links
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
        Segments::of(scene, &bounds, &camera, &Options { height, lod: false, ..Options::default() })
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
    fn pieces_shorter_than_a_pixel_are_put_together_and_lengths_stay() {
        let waves: Vec<Vec3> = (0_u8..=200).map(|i| Vec3::new(f32::from(i), (f32::from(i) * 0.3).sin(), 0.0)).collect();
        let scene = scene(&[&waves]);
        let camera = Camera::view(crate::render::View::Front, &scene.positions, 0.5, 1.0, 1.0);
        let cut = |lod| {
            let options = Options { height: 40, lod, ..Options::default() };
            Segments::of(&scene, &scene.bounds().unwrap(), &camera, &options).paths
        };
        let (exact, far) = (cut(false), cut(true));
        assert!(far.points.len() * 3 < exact.points.len(), "{} of {}", far.points.len(), exact.points.len());
        let length = |paths: &Paths| paths.along.last().unwrap() - paths.along[0];
        assert!((length(&far) / length(&exact) - 1.0).abs() < 0.01, "{} {}", length(&far), length(&exact));
        let area = |paths: &Paths| -> f32 {
            paths.points.windows(2).map(|ends| ends[0].w * ends[0].truncate().distance(ends[1].truncate())).sum()
        };
        assert!((area(&far) / area(&exact) - 1.0).abs() < 0.02, "{} {}", area(&far), area(&exact));
    }

    #[test]
    fn strands_are_not_joined_and_bad_points_break_them() {
        let broken = scene(&[&[Vec3::ZERO, Vec3::X], &[Vec3::Y, Vec3::NAN, Vec3::Z, Vec3::Z]]);
        let cut = segments(&broken, 10);
        assert_eq!(starts(&cut), [0, 2, 4]);
        assert!(cut.paths.points.iter().all(|point| point.is_finite()));
    }

    #[test]
    fn the_frame_does_not_turn_about_the_axis() {
        // A quarter circle in the plane z = 0: the normal of the plane is carried along unchanged.
        let arc: Vec<Vec3> = (0_u8..=8).map(|i| Vec3::from_angle_xy(f32::from(i) * 0.2)).collect();
        let cut = segments(&scene(&[&arc]), 4000);
        for start in starts(&cut) {
            let axis = cut.axis_point(start, cut.paths.points[start as usize].truncate());
            assert!((axis.across - Vec3::Z).length() < 1e-3);
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
