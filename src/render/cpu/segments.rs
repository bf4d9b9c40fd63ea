//! The chains of capsules that rays meet, in links of neighbours that share a box.
//!
//! In: a scene and a camera. Out: [`Segments`]: [`Paths`] whose pieces are capsules, and links, 2 bytes a piece more.

use glam::Vec3;
use rayon::prelude::*;

use crate::ids::index32;
use crate::render::paths::{Cut, Paths};
use crate::render::{Camera, Options};
use crate::scene::{Bounds, Scene};

/// Segments that share a box in the hierarchy: two halve the memory of building it, for boxes that are hardly looser.
const LINK: u32 = 2;
/// The same among so many segments that building takes longer than tracing.
const LARGE_LINK: u32 = 4;
const LARGE: usize = 3_000_000;

/// Capsules between consecutive points. A segment is named by its first point; a link is one or more segments in a row.
#[derive(Debug, Default)]
pub(super) struct Segments {
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
        let parts: Vec<Paths> = ((0..count).into_par_iter().step_by(64))
            .map(|first| Paths::of(scene, first..count.min(first + 64), centre, Cut::Picture(camera, options)))
            .collect();
        let mut paths = Paths { centre, ..Paths::default() };
        paths.reserve(parts.iter().map(|part| part.points.len()).sum());
        for part in parts {
            paths.append(&part);
        }
        let mut segments = Self { paths, links: Vec::new() };
        segments.links = links(&segments.paths, segments.most_in_link());
        segments
    }

    /// Whether there are so many that building the hierarchy counts for more than tracing it.
    pub(super) fn is_large(&self) -> bool {
        self.paths.points.len() > LARGE
    }

    fn most_in_link(&self) -> u32 {
        if self.is_large() { LARGE_LINK } else { LINK }
    }

    /// The segments of a link.
    pub(super) fn of_link(&self, link: u32) -> impl Iterator<Item = u32> {
        (link..link + self.most_in_link()).take_while(|&start| self.paths.points[start as usize].w > 0.0)
    }

    /// The look of the segment that starts at point `start`.
    pub(super) fn look(&self, start: u32) -> u16 {
        self.paths.looks[start as usize]
    }

    /// The axis point nearest to `position` of the segment that starts at point `start`.
    pub(super) fn axis_point(&self, start: u32, position: Vec3) -> AxisPoint {
        let paths = &self.paths;
        let (i, j) = (start as usize, start as usize + 1);
        let a = paths.points[i].truncate();
        let ab = paths.points[j].truncate() - a;
        let length2 = ab.length_squared();
        let s = if length2 > 0.0 { ((position - a).dot(ab) / length2).clamp(0.0, 1.0) } else { 0.0 };
        AxisPoint {
            position: a + ab * s,
            radius: paths.points[i].w,
            tangent: paths.tangents[i].unpack().lerp(paths.tangents[j].unpack(), s).normalize_or(Vec3::X),
            across: paths.across[i].unpack().lerp(paths.across[j].unpack(), s),
            along: paths.along[i] + s * (paths.along[j] - paths.along[i]),
        }
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
