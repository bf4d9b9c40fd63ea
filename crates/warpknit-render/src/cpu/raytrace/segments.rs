//! Chains of capsules or ribbon strips, the primitives that rays are tested against.
//!
//! In: a scene and a camera. Out: [`Segments`], that is [`YarnPaths`] whose pieces are capsules
//! (tubes) or strips (ribbons), and what is known of the place where a ray meets one. A textured
//! ribbon is partly transparent: it stops a ray with a probability equal to its alpha ('stochastic
//! transparency', Enderton et al. 2010). The random numbers depend on the ray and the strip alone,
//! so repeated tests agree.

use glam::{Vec3, Vec3A, Vec4};
use rayon::prelude::*;

use super::ovals::Ovals;
use super::ray::SceneRay;
use super::strip::RibbonEdges;
use crate::bvh::build::Box3;
use crate::bvh::tree::Hit;
use crate::cpu::lit::ShadingPoint;
use crate::cpu::sample::unit;
use crate::maps::{Filter, Maps};
use crate::oval::Oval;
use crate::paths::{PLAIN_SHADE, Subdivision, YarnPaths};
use crate::ply::hash;
use crate::scene::{Bounds, Scene, Shape};
use crate::{Camera, RenderOptions};
use warpknit_core::ids::index32;

/// Boxes are padded by this fraction of the largest coordinate: a few roundings of `f32`. Without
/// padding, rounding in the slab test of a box loses hits on its faces.
const BOX_PADDING: f32 = 1e-6;
/// Radii are this much larger in boxes, for the same reason.
const RADIUS_MARGIN: f32 = 1.001;
/// Parts for each thread that are subdivided before their paths are appended to the others. With
/// more, more paths are in memory twice. With fewer, threads wait for each other.
const PARTS_PER_THREAD: usize = 8;
/// Difference of the integers whose hashes are a series of random numbers: odd, so that none comes
/// twice, and with its bits mixed.
const RANDOM_STEP: u32 = 0x9E37_79B9;
/// Strands that one task subdivides.
const PART: usize = 8;

/// Capsules or strips between consecutive points. A segment is identified by the index of its first
/// point.
#[derive(Debug)]
pub(super) struct Segments<'a> {
    pub(super) scene: &'a Scene,
    pub(super) paths: YarnPaths,
    /// The edges of ribbons. None of tubes.
    pub(super) edges: RibbonEdges,
    /// The sections of flattened tubes. None where all are round.
    pub(super) ovals: Option<Ovals>,
    /// Padding of the boxes, mm.
    padding: f32,
    /// Bounding box of all segments.
    pub(super) bounds: Box3,
}

/// A point on a segment's axis, with the yarn's tangent frame there.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisPoint {
    pub(super) position: Vec3,
    /// Radius, or the section's shorter half-axis.
    pub(super) radius: f32,
    pub(super) oval: Oval,
    /// Unit tangent of the curve, continuous from segment to segment.
    pub(super) tangent: Vec3,
    /// Unit vector across the yarn from which the angle around it counts.
    pub(super) across: Vec3,
    /// Arc length, mm.
    pub(super) along: f32,
}

impl<'a> Segments<'a> {
    /// Subdivides all strands for a picture. `bounds` are the scene's.
    pub(super) fn new(
        scene: &'a Scene,
        bounds: &Bounds,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Self {
        let centre = bounds.centre().as_dvec3();
        let count = scene.strands.len();
        let mut paths = YarnPaths { centre, ..YarnPaths::default() };
        let strands = PART * PARTS_PER_THREAD * rayon::current_num_threads();
        for batch in (0..count).step_by(strands) {
            let end = count.min(batch + strands);
            let parts: Vec<YarnPaths> = ((batch..end).into_par_iter().step_by(PART))
                .map(|first| {
                    YarnPaths::new(
                        scene,
                        first..end.min(first + PART),
                        centre,
                        Subdivision::Picture(camera, options),
                    )
                })
                .collect();
            parts.iter().for_each(|part| paths.append(part));
        }
        Self::from_paths(scene, paths)
    }

    /// The segments of yarns that are subdivided already.
    pub(super) fn from_paths(scene: &'a Scene, paths: YarnPaths) -> Self {
        let around = paths
            .points
            .par_iter()
            .map(|&point| Box3::of_point(Vec3A::from_vec4(point)))
            .reduce(|| Box3::EMPTY, Box3::union);
        let ovals = Ovals::new(&paths);
        let widest = |start: usize| {
            let oval = ovals.as_ref().map_or(Oval::ROUND, |ovals| ovals.of(index32(start)));
            paths.points[start].w * oval.reaches().max_element()
        };
        let thickest = (0..paths.points.len()).into_par_iter().map(widest).reduce(|| 0.0, f32::max);
        let padding = around.min.abs().max(around.max.abs()).max_element() * BOX_PADDING;
        let grown = Vec3A::splat(thickest * RADIUS_MARGIN + padding);
        let edges = match scene.shape {
            Shape::Tube => RibbonEdges::default(),
            Shape::Ribbon => RibbonEdges::new(&paths),
        };
        Self { scene, paths, edges, ovals, padding, bounds: around.grown(grown) }
    }

    /// Bounding box of the segment that starts at point `start`.
    pub(super) fn bounding_box(&self, start: u32) -> Box3 {
        if self.scene.shape == Shape::Ribbon {
            let corners = self.edges.strip(start).map(Box3::of_point);
            let around = corners.into_iter().fold(Box3::EMPTY, Box3::union);
            return around.grown(Vec3A::splat(self.padding));
        }
        let (a, b) = self.ends(start);
        let reach = match &self.ovals {
            None => Vec3A::splat(self.outer_radius(start)),
            Some(ovals) => {
                let reaches = Vec3A::from(ovals.of(start).reaches());
                reaches * (a.w * RADIUS_MARGIN) + Vec3A::splat(self.padding)
            }
        };
        Box3::of_point(Vec3A::from_vec4(a)).union(Box3::of_point(Vec3A::from_vec4(b))).grown(reach)
    }

    /// The section of the segment that starts at point `start`.
    pub(super) fn oval(&self, start: u32) -> Oval {
        self.ovals.as_ref().map_or(Oval::ROUND, |ovals| ovals.of(start))
    }

    /// Radius of a capsule around the segment that starts at point `start`, with a margin. Ends may
    /// have different radii: a strip's end has the radius of the next strip.
    pub(super) fn outer_radius(&self, start: u32) -> f32 {
        let (a, b) = self.ends(start);
        a.w.max(b.w) * RADIUS_MARGIN + self.padding
    }

    /// The maps of the segment that starts at point `start`, if its yarn has a texture.
    pub(super) fn maps(&self, start: u32) -> Option<&Maps> {
        self.scene.maps_of(&self.scene.looks[usize::from(self.look(start))])
    }

    /// The lookups of a ray in a ribbon's texture.
    pub(super) fn filter(&self, look: u16, maps: &Maps, ray: &SceneRay) -> Filter {
        let width = 2.0 * self.scene.looks[usize::from(look)].radius;
        maps.filter([ray.footprint / width, ray.footprint / maps.length])
    }

    /// Whether a strip's texture stops the ray at a crossing, at random by its alpha.
    pub(super) fn is_opaque_at(
        &self,
        start: u32,
        (maps, filter): (&Maps, &Filter),
        [u, v]: [f32; 2],
        ray: &SceneRay,
    ) -> bool {
        let place = [u, self.along(start, v) / maps.length];
        // A hash of the ray and the strip. Two strips in front of each other get independent
        // numbers, or two half-transparent ones would let the same half of all rays through.
        let mut bits = ray.random_bits ^ hash(start);
        maps.covers(place, filter, Shape::Ribbon, || {
            bits = bits.wrapping_add(RANDOM_STEP);
            unit(hash(bits))
        })
    }

    /// Both end points of a segment, with radii in w.
    pub(super) fn ends(&self, start: u32) -> (Vec4, Vec4) {
        (self.paths.points[start as usize], self.paths.points[start as usize + 1])
    }

    /// The shading point of a hit on a tube.
    pub(super) fn point_on_tube(&self, ray: &SceneRay, hit: Hit) -> ShadingPoint {
        let entry = ray.at(hit.distance);
        let axis = self.axis_point(hit.shape, entry);
        // In the space where the section is a circle.
        let outward = axis.oval.shrunk(entry - axis.position);
        // Remove the tangential component of the capsule's normal. The result follows the smooth
        // curve and is continuous where two capsules join.
        let across = |v: Vec3| v - axis.tangent * v.dot(axis.tangent);
        let round = across(outward).normalize_or(-ray.direction);
        let normal = if axis.oval.is_round() {
            round
        } else {
            across(axis.oval.shrunk(round)).normalize_or(round)
        };
        ShadingPoint {
            // Project the hit onto the tube's exact radius. The distance along the ray has the
            // rounding of `f32`.
            position: axis.position + axis.oval.grown(outward.normalize_or(round)) * axis.radius,
            normal,
            tangent: axis.tangent,
            top: normal.cross(axis.tangent),
            around: round.dot(axis.tangent.cross(axis.across)).atan2(round.dot(axis.across)),
            along: axis.along,
        }
    }

    /// Look of the segment that starts at point `start`.
    pub(super) fn look(&self, start: u32) -> u16 {
        self.paths.looks[start as usize]
    }

    /// Factor on the base colour of the segment's yarn.
    pub(super) fn shade(&self, start: u32) -> f32 {
        f32::from(self.paths.shades[start as usize]) / f32::from(PLAIN_SHADE)
    }

    /// Arc length at fraction `s` of the segment that starts at point `start`.
    pub(super) fn along(&self, start: u32, s: f32) -> f32 {
        let (a, b) = (self.paths.along[start as usize], self.paths.along[start as usize + 1]);
        a + s * (b - a)
    }

    /// Tangent and direction across the yarn at fraction `s`, interpolated linearly as for Phong
    /// shading, so that normals are continuous from segment to segment.
    pub(super) fn directions(&self, start: u32, s: f32) -> (Vec3, Vec3) {
        let (i, j) = (start as usize, start as usize + 1);
        let (tangents, across) = (&self.paths.tangents, &self.paths.across);
        let tangent = tangents[i].unpack().lerp(tangents[j].unpack(), s).normalize_or(Vec3::X);
        (tangent, across[i].unpack().lerp(across[j].unpack(), s))
    }

    /// The point of a segment's axis that is nearest to `position`.
    pub(super) fn axis_point(&self, start: u32, position: Vec3) -> AxisPoint {
        let paths = &self.paths;
        let (i, j) = (start as usize, start as usize + 1);
        let a = paths.points[i].truncate();
        let ab = paths.points[j].truncate() - a;
        let length2 = ab.length_squared();
        let s =
            if length2 > 0.0 { ((position - a).dot(ab) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let (tangent, across) = self.directions(start, s);
        AxisPoint {
            position: a + ab * s,
            radius: paths.points[i].w,
            oval: self.oval(start),
            tangent,
            across,
            along: self.along(start, s),
        }
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

    fn segments(scene: &Scene, height: u32) -> Segments<'_> {
        let bounds = scene.bounds().unwrap();
        let camera = Camera::view(crate::View::Front, &scene.positions, 0.5, 1.0, 1.0);
        Segments::new(
            scene,
            &bounds,
            &camera,
            &RenderOptions { height, lod: false, ..RenderOptions::default() },
        )
    }

    fn starts(segments: &Segments) -> Vec<u32> {
        (0..index32(segments.paths.points.len()))
            .filter(|&point| segments.paths.points[point as usize].w > 0.0)
            .collect()
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
        let waves: Vec<Vec3> = (0_u8..=200)
            .map(|i| Vec3::new(f32::from(i), (f32::from(i) * 0.3).sin(), 0.0))
            .collect();
        let scene = scene(&[&waves]);
        let camera = Camera::view(crate::View::Front, &scene.positions, 0.5, 1.0, 1.0);
        let cut = |lod| {
            let options = RenderOptions { height: 40, lod, ..RenderOptions::default() };
            Segments::new(&scene, &scene.bounds().unwrap(), &camera, &options).paths
        };
        let (exact, far) = (cut(false), cut(true));
        assert!(
            far.points.len() * 3 < exact.points.len(),
            "{} of {}",
            far.points.len(),
            exact.points.len()
        );
        // Plies lie at the same places, however the yarn is cut.
        let length = |paths: &YarnPaths| paths.along.last().unwrap() - paths.along[0];
        let pieces = YarnPaths::new(&scene, 0..1, exact.centre, Subdivision::Stitch(300));
        for other in [&far, &pieces] {
            let off = length(other) - length(&exact);
            assert!(off.abs() < 1e-3, "{off} of {}", length(&exact));
        }
        let area = |paths: &YarnPaths| -> f32 {
            paths
                .points
                .windows(2)
                .map(|ends| ends[0].w * ends[0].truncate().distance(ends[1].truncate()))
                .sum()
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
        let scene = scene(&[&arc]);
        let cut = segments(&scene, 4000);
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
