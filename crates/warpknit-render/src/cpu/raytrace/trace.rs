//! Rays against the yarns of a scene.
//!
//! In: [`Segments`]. Out: the nearest segment along a ray, or any segment that occludes it, by way
//! of the tree in `bvh`. Lanes test capsules and strips. What a strip's texture lets through is
//! decided strip by strip.

use std::cell::Cell;

use glam::Vec4;
use rayon::prelude::*;

use super::capsule::{Beside, SegmentLeaf};
use super::ovals::Ovals;
use super::ray::SceneRay;
use super::segments::Segments;
use super::strip::RibbonEdges;
use crate::bvh::build::Box3;
use crate::bvh::lanes::{Eight, Kernel, LANES, LaneRay, Lanes};
use crate::bvh::tree::{Hit, Shapes, Tree, Waiting};
use crate::bvh::triangles::Across;
use crate::maps::{Filter, Maps};
use crate::scene::Shape;
use warpknit_core::ids::index32;

/// A number that is no segment's, nor that of a neighbour.
const NO_SEGMENT: u32 = u32::MAX / 2;

/// The hierarchy over all segments. It takes 20 bytes a segment in full leaves, and for ribbons 24
/// bytes a point.
#[derive(Debug)]
pub(super) struct SegmentBvh<'a> {
    pub(super) segments: Segments<'a>,
    tree: Tree<SegmentLeaf>,
}

impl<'a> SegmentBvh<'a> {
    pub(super) fn new(segments: Segments<'a>) -> Self {
        let cuts = cuts(&segments.paths.points);
        let boxes = cuts.par_iter().map(|cut| leaf_box(&segments, cut)).collect();
        let tree = Tree::of_leaves(boxes, |number| leaf(&segments, &cuts[number as usize]));
        Self { tree, segments }
    }

    /// The nearest segment along `ray`.
    pub(super) fn nearest(&self, ray: &SceneRay, waiting: &mut Waiting) -> Option<Hit> {
        self.segments.nearest_in(&self.tree, ray, NO_SEGMENT, waiting)
    }

    /// The nearest of the segments of which [`Self::occluder`] finds any.
    pub(super) fn nearest_occluder(
        &self,
        ray: &SceneRay,
        own: u32,
        waiting: &mut Waiting,
    ) -> Option<Hit> {
        self.segments.nearest_in(&self.tree, ray, own, waiting)
    }

    /// The first point of any segment that blocks the ray within its reach. Segment `own`, where
    /// the ray starts, and its two neighbours on the yarn do not count.
    ///
    /// Segments of one bend overlap at their joints. The smooth curve that they approximate has no
    /// edge there that could cast a shadow.
    pub(super) fn occluder(&self, ray: &SceneRay, own: u32, waiting: &mut Waiting) -> Option<u32> {
        self.segments.occluder_in(&self.tree, ray, own, waiting)
    }

    /// Where a ray crosses a strip: u and v. `None` where it misses.
    pub(super) fn place_on_strip(&self, start: u32, ray: &SceneRay) -> Option<[f32; 2]> {
        self.tree.instructions().run(OneStrip { edges: &self.segments.edges, start, ray })
    }
}

impl Segments<'_> {
    /// The nearest of those segments that a tree holds, without segment `own` and its neighbours.
    fn nearest_in(
        &self,
        tree: &Tree<SegmentLeaf>,
        ray: &SceneRay,
        own: u32,
        waiting: &mut Waiting,
    ) -> Option<Hit> {
        let line = ray.line();
        match (self.scene.shape, &self.ovals) {
            (Shape::Tube, None) => tree.nearest(&line, &Capsules { own }, waiting),
            (Shape::Tube, Some(ovals)) => tree.nearest(&line, &Flattened { own, ovals }, waiting),
            (Shape::Ribbon, _) => tree.nearest(&line, &self.strips(ray, own), waiting),
        }
    }

    /// Any of them that blocks the ray, as of [`SegmentBvh::occluder`].
    fn occluder_in(
        &self,
        tree: &Tree<SegmentLeaf>,
        ray: &SceneRay,
        own: u32,
        waiting: &mut Waiting,
    ) -> Option<u32> {
        let mut occluder = None;
        let first = |start: u32| {
            occluder = Some(start);
            false
        };
        let line = ray.line();
        match (self.scene.shape, &self.ovals) {
            (Shape::Tube, None) => tree.visit(&line, &Capsules { own }, waiting, first),
            (Shape::Tube, Some(ovals)) => {
                tree.visit(&line, &Flattened { own, ovals }, waiting, first);
            }
            (Shape::Ribbon, _) => tree.visit(&line, &self.strips(ray, own), waiting, first),
        }
        occluder
    }

    fn strips<'r>(&'r self, ray: &'r SceneRay, own: u32) -> Strips<'r> {
        Strips {
            segments: self,
            ray,
            own,
            across: Across::new(ray.direction),
            last_filter: Cell::new(None),
        }
    }
}

/// Tubes: capsules, tested in lanes.
struct Capsules {
    /// The segment that does not count, with its two neighbours.
    own: u32,
}

impl Shapes for Capsules {
    type Leaf = SegmentLeaf;

    #[inline(always)]
    fn distances<S: Eight>(
        &self,
        leaf: &SegmentLeaf,
        ray: &LaneRay<S>,
        limit: f32,
    ) -> (u32, [f32; LANES]) {
        met(leaf.near(ray, None), leaf.others(self.own), ray, limit)
    }
}

/// Flattened tubes: capsules in the spaces where their sections are circles.
struct Flattened<'a> {
    /// As of capsules.
    own: u32,
    ovals: &'a Ovals,
}

impl Shapes for Flattened<'_> {
    type Leaf = SegmentLeaf;

    #[inline(always)]
    fn distances<S: Eight>(
        &self,
        leaf: &SegmentLeaf,
        ray: &LaneRay<S>,
        limit: f32,
    ) -> (u32, [f32; LANES]) {
        let ovals = self.ovals.lanes(leaf.first, ray.simd);
        met(leaf.near(ray, Some(ovals)), leaf.others(self.own), ray, limit)
    }
}

/// Those of the capsules near the ray that it meets at most `limit` away, as far as they are among
/// `others`.
#[inline(always)]
fn met<S: Eight>(
    (near, beside): (u32, Beside<S>),
    others: u32,
    ray: &LaneRay<S>,
    limit: f32,
) -> (u32, [f32; LANES]) {
    let near = near & others;
    if near == 0 {
        return (0, [0.0; LANES]);
    }
    let distances = beside.distances(ray);
    let met = ray.simd.bits(distances.at_most(Lanes::all(ray.simd, limit)));
    (near & met, distances.array())
}

/// Ribbons: strips, tested in lanes, and then for what their texture lets through.
struct Strips<'a> {
    segments: &'a Segments<'a>,
    ray: &'a SceneRay,
    /// As of capsules.
    own: u32,
    across: Across,
    /// The ray's lookups in the texture of the look that it met last.
    last_filter: Cell<Option<(u16, Filter)>>,
}

impl Shapes for Strips<'_> {
    type Leaf = SegmentLeaf;

    #[inline(always)]
    fn distances<S: Eight>(
        &self,
        leaf: &SegmentLeaf,
        ray: &LaneRay<S>,
        limit: f32,
    ) -> (u32, [f32; LANES]) {
        let (near, _) = leaf.near(ray, None);
        let near = near & leaf.others(self.own);
        if near == 0 {
            return (0, [0.0; LANES]);
        }
        let crossings = self.segments.edges.crossings(leaf.first, ray, self.across);
        let met = near & ray.simd.bits(crossings.distance.at_most(Lanes::all(ray.simd, limit)));
        let distances = crossings.distance.array();
        match self.segments.maps(leaf.first) {
            Some(maps) if met != 0 => {
                let places = [crossings.u.array(), crossings.v.array()];
                (self.opaque(leaf.first, maps, met, &distances, &places), distances)
            }
            _ => (met, distances),
        }
    }
}

impl Strips<'_> {
    /// The ray's lookups in a look's texture. A leaf's strips are of one yarn, and the next leaf is
    /// often of the same look.
    fn filter(&self, look: u16, maps: &Maps) -> Filter {
        match self.last_filter.get() {
            Some((last, filter)) if last == look => filter,
            _ => {
                let filter = self.segments.filter(look, maps, self.ray);
                self.last_filter.set(Some((look, filter)));
                filter
            }
        }
    }

    /// Those of the strips `crossed` from `first` on that stop the ray, but for such behind others.
    #[inline(never)]
    fn opaque(
        &self,
        first: u32,
        maps: &Maps,
        mut crossed: u32,
        distances: &[f32; LANES],
        [u, v]: &[[f32; LANES]; 2],
    ) -> u32 {
        let filter = self.filter(self.segments.look(first), maps);
        let (mut opaque, mut limit) = (0, f32::INFINITY);
        while crossed != 0 {
            let lane = crossed.trailing_zeros() as usize % LANES;
            crossed &= crossed - 1;
            let (start, place) = (first + index32(lane), [u[lane], v[lane]]);
            // The texture comes last, because it costs more than all other tests together.
            if distances[lane] <= limit
                && self.segments.is_opaque_at(start, (maps, &filter), place, self.ray)
            {
                limit = distances[lane];
                opaque |= 1 << lane;
            }
        }
        opaque
    }
}

/// A ray at one strip.
struct OneStrip<'a> {
    edges: &'a RibbonEdges,
    start: u32,
    ray: &'a SceneRay,
}

impl Kernel for OneStrip<'_> {
    type Output = Option<[f32; 2]>;

    #[inline(always)]
    fn run<S: Eight>(self, simd: S) -> Option<[f32; 2]> {
        let Self { edges, start, ray } = self;
        let lanes = LaneRay::new(simd, ray.origin, ray.direction);
        let crossings = edges.crossings(start, &lanes, Across::new(ray.direction));
        let [distance, u, v] =
            [crossings.distance, crossings.u, crossings.v].map(|lanes| lanes.array()[0]);
        distance.is_finite().then_some([u, v])
    }
}

/// Consecutive segments of one yarn: the first one's first point, and their number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cut {
    first: u32,
    segments: u32,
}

/// Cuts yarns into leaves: pieces of at most eight segments, as equal as can be. Shorter pieces
/// have tighter boxes, but lanes would stay empty and nodes would be more.
fn cuts(points: &[Vec4]) -> Vec<Cut> {
    let mut cuts = Vec::with_capacity(points.len() / LANES + 1);
    let mut first = 0;
    for (end, _) in (0_u32..).zip(points).filter(|(_, point)| point.w <= 0.0) {
        while first < end {
            let left = end - first;
            let segments = left.div_ceil(left.div_ceil(index32(LANES)));
            cuts.push(Cut { first, segments });
            first += segments;
        }
        first = end + 1;
    }
    cuts
}

/// The leaf of a cut. A strip lies within the capsule around its axis, whose radius is the larger
/// one of its ends.
fn leaf(segments: &Segments, cut: &Cut) -> SegmentLeaf {
    let points = &segments.paths.points;
    let end = cut.first as usize + cut.segments as usize;
    SegmentLeaf::new(&points[cut.first as usize..=end], cut.first, |start| {
        match segments.scene.shape {
            Shape::Tube => points[start as usize].w,
            Shape::Ribbon => segments.outer_radius(start),
        }
    })
}

/// The bounding box of a cut.
fn leaf_box(segments: &Segments, cut: &Cut) -> Box3 {
    (cut.first..cut.first + cut.segments)
        .fold(Box3::EMPTY, |around, start| around.union(segments.bounding_box(start)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::tree::Waiting;
    use crate::scene::{Scene, YarnLook};
    use crate::{Camera, RenderOptions, View};
    use glam::Vec3;
    use proptest::prelude::*;

    fn scene(shape: Shape, strands: &[Vec<Vec3>]) -> Scene {
        let mut scene = Scene { shape, ..Scene::default() };
        scene.looks.push(YarnLook::plain(Vec3::ONE, 0.5, 0.1));
        strands.iter().for_each(|points| scene.push_strand(points.iter().copied(), 0));
        scene
    }

    /// The yarns of `scene` as straight pieces.
    fn bvh(scene: &Scene) -> SegmentBvh<'_> {
        let bounds = scene.bounds().unwrap();
        let camera = Camera::view(View::Front, &scene.positions, 0.5, 1.0, 1.0);
        let options = RenderOptions { height: 64, lod: false, ..RenderOptions::default() };
        SegmentBvh::new(Segments::new(scene, &bounds, &camera, &options))
    }

    /// A tree whose only leaf is this one, which finds what is in it without looking at boxes.
    fn alone(bvh: &SegmentBvh<'_>, cut: &Cut) -> Tree<SegmentLeaf> {
        let everywhere = Box3::of_point(glam::Vec3A::ZERO).grown(glam::Vec3A::splat(1e9));
        Tree::of_leaves(vec![everywhere], |_| leaf(&bvh.segments, cut))
    }

    /// The nearest hit, from all leaves in turn.
    fn by_all(segments: &Segments<'_>, trees: &[Tree<SegmentLeaf>], ray: &SceneRay) -> Option<Hit> {
        trees
            .iter()
            .filter_map(|tree| segments.nearest_in(tree, ray, NO_SEGMENT, &mut Waiting::new()))
            .min_by(|a, b| a.distance.total_cmp(&b.distance).then(a.shape.cmp(&b.shape)))
    }

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![Just(0.0_f32), Just(0.5), -2.0..2.0_f32]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

        /// Points that coincide, rays along axes and from inside yarns included.
        #[test]
        fn the_tree_finds_what_all_leaves_in_turn_do(
            strands in prop::collection::vec(prop::collection::vec(point(), 1..30), 1..12),
            rays in prop::collection::vec((point(), point(), prop_oneof![Just(f32::INFINITY), 0.1..4.0_f32]), 40),
            shape in prop_oneof![Just(Shape::Tube), Just(Shape::Ribbon)],
        ) {
            let scene = scene(shape, &strands);
            let bvh = bvh(&scene);
            let trees: Vec<Tree<SegmentLeaf>> =
                cuts(&bvh.segments.paths.points).iter().map(|cut| alone(&bvh, cut)).collect();
            let mut waiting = Waiting::new();
            for (origin, aim, reach) in rays {
                let direction = (aim - origin).normalize_or(Vec3::Z);
                let ray = SceneRay { origin, direction, reach, footprint: 0.01, random_bits: 0 };
                let hit = bvh.nearest(&ray, &mut waiting);
                prop_assert_eq!(hit, by_all(&bvh.segments, &trees, &ray));
                let unowned = bvh.occluder(&ray, u32::MAX / 2, &mut waiting);
                prop_assert_eq!(hit.is_some(), unowned.is_some());
                for own in [0, 3] {
                    let occluder = bvh.occluder(&ray, own, &mut waiting);
                    let blocks = |tree: &Tree<SegmentLeaf>| {
                        bvh.segments.occluder_in(tree, &ray, own, &mut Waiting::new()).is_some()
                    };
                    prop_assert_eq!(occluder.is_some(), trees.iter().any(blocks));
                    prop_assert!(occluder.is_none_or(|start| start.abs_diff(own) > 1));
                }
            }
        }

        #[test]
        fn cuts_hold_each_segment_once(lengths in prop::collection::vec(0_usize..40, 0..20)) {
            let points: Vec<Vec4> = lengths
                .iter()
                .flat_map(|&length| (0..=length).map(move |i| Vec4::splat(if i < length { 1.0 } else { 0.0 })))
                .collect();
            let starts = |cut: &Cut| cut.first..cut.first + cut.segments;
            let held: Vec<u32> = cuts(&points).iter().flat_map(starts).collect();
            let segments: Vec<u32> =
                (0..).zip(&points).filter(|(_, point)| point.w > 0.0).map(|(start, _)| start).collect();
            prop_assert_eq!(held, segments);
            prop_assert!(cuts(&points).iter().all(|cut| cut.segments <= 8));
        }
    }
}
