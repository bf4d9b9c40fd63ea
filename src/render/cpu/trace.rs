//! What a ray meets: capsules or strips of ribbon in a compressed wide BVH (obvhs).
//!
//! In: [`Segments`]. Out: the nearest capsule along a ray, or any one within reach. Yarns are hundredths of a millimetre thick and
//! eyes metres away, so a ray starts where it enters the scene's box and is moved beside each capsule before the quadratic is
//! solved; boxes are padded by what `f32` may lose over the scene's extent. Rays that start inside a capsule don't see it. A ribbon stops the share of the
//! rays that its picture's alpha says, by a number that a ray and a strip always give alike.

use super::narrow;
use super::sample::unit;
use super::segments::Segments;
use super::strip::Crossing;
use crate::ids::index32;
use crate::render::Camera;
use crate::render::ply::hash;
use crate::scene::{Scene, Shape};
use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

/// Box padding as a share of the largest coordinate: a few roundings of `f32`.
const PADDING: f32 = 1e-6;
/// Links a leaf of the hierarchy may hold. 3, the most that a compressed node can say, traced 3 % slower.
const MAX_LEAF: u32 = 1;

/// All segments and the hierarchy over them.
pub(super) struct Tracer<'a> {
    pub(super) segments: Segments,
    scene: &'a Scene,
    bvh: CwBvh,
}

/// A ray in world directions, its origin relative to the scene's middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) reach: f32,
    /// Size of a pixel where the ray may meet something, mm.
    pub(super) footprint: f32,
    /// By which it is decided what half-covered places let through.
    pub(super) chance: u32,
}

/// The nearest segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// First point of the segment.
    pub(super) start: u32,
    /// Distance from the path's origin.
    pub(super) distance: f32,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(mut segments: Segments, scene: &'a Scene) -> Self {
        let mut bvh = hierarchy(&segments);
        // Links in the order of the leaves: one look-up less for each that is met.
        segments.links = bvh.primitive_indices.iter().map(|&index| segments.links[index as usize]).collect();
        bvh.primitive_indices = Vec::new();
        Self { segments, scene, bvh }
    }

    /// A ray from `camera`'s eye, cut to where it may meet something; `None` where it passes the scene's box by.
    pub(super) fn enter(&self, camera: &Camera, height: u32, direction: DVec3, chance: u32) -> Option<Path> {
        let Aabb { min, max } = self.bvh.total_aabb;
        let eye = camera.eye() - self.segments.paths.centre;
        let inverse = direction.recip();
        let (a, b) = ((Vec3::from(min).as_dvec3() - eye) * inverse, (Vec3::from(max).as_dvec3() - eye) * inverse);
        // 0 * infinity, for a ray within a face's plane, counts as inside.
        let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if self.segments.links.is_empty() || near > far {
            return None;
        }
        let origin = (eye + direction * near).as_vec3();
        let footprint = narrow(camera.pixel_size(near.midpoint(far), height));
        Some(Path { origin, direction: direction.as_vec3(), reach: f32::INFINITY, footprint, chance })
    }

    /// The nearest segment along `path`.
    pub(super) fn nearest(&self, path: &Path) -> Option<Hit> {
        let mut nearest = Hit { start: 0, distance: path.reach };
        self.bvh.ray_traverse(path.ray(), &mut RayHit::none(), |ray, index| {
            for start in self.segments.of_link(self.segments.links[index]) {
                let distance = self.distance(start, ray, path, nearest.distance);
                // Of two at one distance, the first along the yarn, in whatever order the hierarchy brings them.
                if distance < nearest.distance || (distance == nearest.distance && start < nearest.start) {
                    nearest = Hit { start, distance };
                }
            }
            nearest.distance
        });
        (nearest.distance < path.reach).then_some(nearest)
    }

    /// The first point of some segment within reach, those of segment `own` and its neighbours on the yarn left out.
    ///
    /// A bend's own pieces overlap at the joints, where the curve they stand for has no edge to cast a shadow.
    pub(super) fn occluder(&self, path: &Path, own: u32) -> Option<u32> {
        let mut occluder = None;
        self.bvh.ray_traverse_miss(path.ray(), |ray, index| {
            let link = self.segments.of_link(self.segments.links[index]);
            occluder =
                link.filter(|start| start.abs_diff(own) > 1).find(|&start| self.distance(start, ray, path, ray.tmax) < ray.tmax);
            if occluder.is_some() { 0.0 } else { f32::INFINITY }
        });
        occluder
    }

    /// How far away a segment is met; infinite where it isn't, and for a ribbon where that would be beyond `limit`.
    fn distance(&self, start: u32, ray: &Ray, path: &Path, limit: f32) -> f32 {
        match self.segments.shape {
            Shape::Tube => {
                let (a, b) = (self.segments.paths.points[start as usize], self.segments.paths.points[start as usize + 1]);
                capsule(ray.origin, ray.direction, Vec3A::from_vec4(a), Vec3A::from_vec4(b), a.w)
            }
            Shape::Ribbon => {
                let crossing = self.segments.strip(start).crossing(ray.origin, ray.direction);
                // The picture is looked at last: that costs more than all else.
                let stops = |crossing: &Crossing| crossing.distance <= limit && self.stops(start, crossing, path);
                crossing.filter(stops).map_or(f32::INFINITY, |crossing| crossing.distance)
            }
        }
    }

    /// Whether a ribbon's picture has yarn where it is crossed.
    fn stops(&self, start: u32, crossing: &Crossing, path: &Path) -> bool {
        let look = &self.scene.looks[usize::from(self.segments.look(start))];
        let Some(maps) = self.scene.maps_of(look) else { return true };
        let v = self.segments.along(start, crossing.v) / maps.length;
        let (across, along) = (path.footprint / (2.0 * look.radius), path.footprint / maps.length);
        let alpha = maps.alpha(crossing.u, v, across, along, Shape::Ribbon);
        alpha > unit(hash(path.chance ^ hash(start)))
    }
}

impl Path {
    fn ray(&self) -> Ray {
        Ray::new(self.origin.into(), self.direction.into(), 0.0, self.reach)
    }
}

/// The hierarchy over the links' boxes, by obvhs' own recipe, but with each stage's memory given back before the next.
fn hierarchy(segments: &Segments) -> CwBvh {
    let extent = segments.paths.points.iter().fold(0.0_f32, |most, point| most.max(point.truncate().abs().max_element()));
    let boxes: Vec<Aabb> = segments.links.par_iter().map(|&link| boxed(segments, link, extent * PADDING)).collect();
    // Measured on 26 000 stitches, 1600x1200: the longer build traces 12 % faster in all. A million stitches want less time for each.
    let params = if segments.is_large() { BvhBuildParams::very_fast_build() } else { BvhBuildParams::medium_build() };
    let indices = (0..index32(boxes.len())).collect();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    drop(boxes);
    ReinsertionOptimizer::default().run(&mut binary, params.reinsertion_batch_ratio, None);
    let mut wide = bvh2_to_cwbvh(&binary, MAX_LEAF, true, false);
    wide.nodes.shrink_to_fit();
    wide
}

fn boxed(segments: &Segments, link: u32, padding: f32) -> Aabb {
    let mut around = Aabb::empty();
    for start in segments.of_link(link) {
        let (a, b) = (segments.paths.points[start as usize], segments.paths.points[start as usize + 1]);
        // The end of a strip has the radius of the next one.
        let grown = Vec3A::splat(a.w.max(b.w) * 1.001 + padding);
        let (a, b) = (Vec3A::from_vec4(a), Vec3A::from_vec4(b));
        around = around.union(&Aabb::new(a.min(b) - grown, a.max(b) + grown));
    }
    around
}

/// Distance along a ray of unit direction to where it enters the capsule from `a` to `b`; infinite where it doesn't.
fn capsule(origin: Vec3A, direction: Vec3A, a: Vec3A, b: Vec3A, radius: f32) -> f32 {
    // Start beside the capsule: what is left of the origin's distance would eat the radius' digits.
    let beside = (a.midpoint(b) - origin).dot(direction);
    let from_a = (origin - a) + direction * beside;

    let ab = b - a;
    // Most capsules of a box that is met are missed, and a line that passes the axis too far away tells it without a root.
    let normal = direction.cross(ab);
    let missed = from_a.dot(normal);
    if missed * missed > radius * radius * 1.000_1 * normal.length_squared() {
        return f32::INFINITY;
    }
    let length = ab.length();
    let axis = if length > 0.0 { ab / length } else { Vec3A::ZERO };
    let (slope, height) = (direction.dot(axis), from_a.dot(axis));
    let (across, apart) = (direction - axis * slope, from_a - axis * height);
    // The infinite cylinder: |apart + t across| = radius.
    let (qa, qb, qc) = (across.length_squared(), across.dot(apart), apart.length_squared() - radius * radius);
    let discriminant = qb * qb - qa * qc;
    if discriminant < 0.0 {
        return f32::INFINITY;
    }
    let mut end = if slope > 0.0 { from_a } else { from_a - ab };
    if qa > 1e-7 {
        let t = (-qb - discriminant.sqrt()) / qa;
        let entry = height + t * slope;
        if entry >= 0.0 && entry <= length {
            return ahead(beside + t);
        }
        end = if entry < 0.0 { from_a } else { from_a - ab };
    }
    ball(end, direction, radius).map_or(f32::INFINITY, |t| ahead(beside + t))
}

/// Where a ray from `origin`, relative to the ball's middle, enters the ball.
fn ball(origin: Vec3A, direction: Vec3A, radius: f32) -> Option<f32> {
    let closest = -origin.dot(direction);
    let missed2 = (origin + direction * closest).length_squared();
    let half2 = radius * radius - missed2;
    (half2 >= 0.0).then(|| closest - half2.sqrt())
}

fn ahead(distance: f32) -> f32 {
    if distance >= 0.0 { distance } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by sphere tracing in f64: steps by the distance to the capsule.
    fn by_steps(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3, radius: f64) -> f64 {
        let gap = |p: DVec3| {
            let s = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-30)).clamp(0.0, 1.0);
            p.distance(a + (b - a) * s) - radius
        };
        let mut t = 0.0;
        for _ in 0..2000 {
            let step = gap(origin + direction * t);
            if step < 1e-9 {
                return t;
            }
            t += step;
        }
        f64::INFINITY
    }

    #[test]
    fn capsules_agree_with_steps_in_f64_from_everywhere() {
        let ends = [
            (DVec3::ZERO, DVec3::X),
            (DVec3::new(0.3, 0.2, -0.1), DVec3::new(0.3, 0.2, -0.1)),
            (DVec3::Z, DVec3::new(0.1, -0.4, 0.2)),
        ];
        for (a, b) in ends {
            for step in 0_u8..200 {
                let angle = f64::from(step) * 0.71;
                let origin = DVec3::new(angle.cos() * 3.0, (angle * 1.3).sin() * 2.0 + 1.5, angle.sin() * 3.0);
                let aim = a.lerp(b, f64::from(step % 7) / 5.0 - 0.1) + DVec3::new(0.0, f64::from(step % 5) * 0.04, 0.0);
                let direction = (aim - origin).normalize();
                let expected = by_steps(origin, direction, a, b, 0.1);
                let [o, d, p, q] = [origin, direction, a, b].map(|v| Vec3A::from(v.as_vec3()));
                let found = f64::from(capsule(o, d, p, q, 0.1));
                let grazing = expected.is_infinite() != found.is_infinite();
                assert!(!grazing && (found == expected || (found - expected).abs() < 1e-5), "{step}: {found} {expected}");
            }
        }
    }

    #[test]
    fn rays_along_the_axis_meet_the_end() {
        let t = capsule(Vec3A::NEG_X, Vec3A::X, Vec3A::ZERO, Vec3A::X, 0.1);
        assert!((t - 0.9).abs() < 1e-6);
        let back = capsule(Vec3A::X * 3.0, Vec3A::NEG_X, Vec3A::ZERO, Vec3A::X, 0.1);
        assert!((back - 1.9).abs() < 1e-6);
    }

    #[test]
    fn a_thin_yarn_is_hit_exactly_from_metres_away() {
        for offset in [0.0_f32, 0.01, 0.025, 0.0299] {
            let t = capsule(Vec3A::new(0.2, offset, 4000.0), Vec3A::NEG_Z, Vec3A::ZERO, Vec3A::X, 0.03);
            let expected = 4000.0 - (0.03_f64.powi(2) - f64::from(offset).powi(2)).sqrt();
            assert!((f64::from(t) - expected).abs() < 3e-4, "half a unit in the last place of 4000 is 1.2e-4: {t}");
        }
        assert!(capsule(Vec3A::new(0.2, 0.0301, 4000.0), Vec3A::NEG_Z, Vec3A::ZERO, Vec3A::X, 0.03).is_infinite());
    }
}
