//! A bounding volume hierarchy of shapes that are tested eight at a time.
//!
//! In: leaves of up to eight shapes, with their boxes. Out: the nearest shape along a ray, or one
//! after another. A node has eight boxes in single precision, which one pass tests. Children are
//! visited from near to far, and left out where they begin beyond what was hit already (Wald et al.
//! 2008, 'Getting rid of packets'; Áfra 2013, 'Faster incoherent ray traversal using 8-wide AVX
//! instructions'). What a leaf's shapes are is up to [`Shapes`].
//!
//! Memory: 224 bytes a node of up to eight leaves or nodes, besides the leaves: 320 bytes for up to
//! eight triangles. The result does not depend on the number of threads, nor on the processor's
//! instructions.

use glam::Vec3;
use rayon::prelude::*;

use super::build::{Box3, LEAF, MAX_WAITING, Node, build, number_leaves};
use super::lanes::{Eight, Instructions, Kernel, LANES, LaneRay, Lanes, Lanes3};

/// Components of directions smaller than this are replaced by it, so that no slab is 0 / 0. Its
/// inverse times any distance is finite.
const LEAST_COMPONENT: f32 = 1e-20;

/// The hierarchy over all shapes.
#[derive(Debug)]
pub(crate) struct Tree<L> {
    nodes: Vec<Node>,
    leaves: Vec<L>,
    instructions: Instructions,
}

/// A ray in the axes of the shapes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub(crate) origin: Vec3,
    /// Of unit length.
    pub(crate) direction: Vec3,
    /// Distance beyond which nothing is looked for.
    pub(crate) reach: f32,
}

/// The nearest shape along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Its number.
    pub(crate) shape: u32,
    /// Distance from the ray's origin.
    pub(crate) distance: f32,
}

/// Up to eight shapes that lanes test together.
pub(crate) trait Leaf: Copy + Send + Sync {
    /// The number of the shape in a lane.
    fn shape(&self, lane: usize) -> u32;
}

/// What a leaf's shapes are.
pub(crate) trait Shapes {
    type Leaf: Leaf;

    /// Those of a leaf's shapes that the ray meets at most `limit` away, which is finite; as bits,
    /// and how far away.
    fn distances<S: Eight>(
        &self,
        leaf: &Self::Leaf,
        ray: &LaneRay<S>,
        limit: f32,
    ) -> (u32, [f32; LANES]);
}

/// Places in the tree that wait to be visited: the distance's bits above the child's number.
/// Distances are not negative, so that they are ordered like their bits.
///
/// The rays of a pixel to yarns share one, so that it is not cleared for each.
pub(crate) struct Waiting([u64; MAX_WAITING]);

impl Waiting {
    pub(crate) fn new() -> Self {
        Self([0; MAX_WAITING])
    }
}

impl<L: Leaf> Tree<L> {
    /// Builds the tree over leaves with these boxes. `leaf` makes one of them. Leaves are made at
    /// their places in the tree and after the boxes are freed, so that none is in memory twice.
    pub(crate) fn of_leaves(boxes: Vec<Box3>, leaf: impl Fn(u32) -> L + Sync) -> Self {
        let (nodes, order) = build(&boxes, 1);
        drop(boxes);
        let leaves = order.par_iter().map(|&number| leaf(number)).collect();
        Self { nodes, leaves, instructions: Instructions::best() }
    }

    /// Builds the tree over shapes with these boxes. `leaf` makes a leaf of up to eight of them.
    pub(crate) fn of_shapes(boxes: &[Box3], leaf: impl Fn(&[u32]) -> L + Sync) -> Self {
        let (mut nodes, order) = build(boxes, LANES);
        let starts = number_leaves(&mut nodes, order.len());
        let of = |ends: &[u32]| leaf(&order[ends[0] as usize..ends[1] as usize]);
        let leaves = starts.par_windows(2).map(of).collect();
        Self { nodes, leaves, instructions: Instructions::best() }
    }

    /// The processor's instructions.
    pub(crate) fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// The nearest shape along the ray.
    pub(crate) fn nearest(
        &self,
        ray: &Ray,
        shapes: &impl Shapes<Leaf = L>,
        waiting: &mut Waiting,
    ) -> Option<Hit> {
        self.instructions.run(Nearest { tree: self, ray, shapes, waiting })
    }

    /// Visits the shapes that the ray meets, in the order of the tree, as long as `visit` returns
    /// true.
    pub(crate) fn visit(
        &self,
        ray: &Ray,
        shapes: &impl Shapes<Leaf = L>,
        waiting: &mut Waiting,
        visit: impl FnMut(u32) -> bool,
    ) {
        self.instructions.run(Visit { tree: self, ray, shapes, waiting, visit });
    }
}

/// A ray prepared for boxes.
struct Slabs<S> {
    simd: S,
    origin: Lanes3<S>,
    /// Inverse of the direction.
    inverse: Lanes3<S>,
    /// For each axis which of a box's two faces is met first.
    first: [usize; 3],
}

impl<S: Eight> Slabs<S> {
    #[inline(always)]
    fn new(ray: &Ray, lanes: &LaneRay<S>) -> Self {
        let inverse = ray.direction.to_array().map(|component| {
            1.0 / if component.abs() < LEAST_COMPONENT {
                LEAST_COMPONENT.copysign(component)
            } else {
                component
            }
        });
        Self {
            simd: lanes.simd,
            origin: lanes.origin,
            inverse: Lanes3::all(lanes.simd, inverse),
            first: inverse.map(|component| usize::from(component < 0.0)),
        }
    }

    /// The boxes of a node that the ray enters at most `reach` away, as bits, and how far away it
    /// enters them (Kay and Kajiya 1986, 'Ray tracing complex scenes').
    #[inline(always)]
    fn enter(&self, node: &Node, reach: f32) -> (u32, [f32; LANES]) {
        let Self { simd, origin, inverse, first } = *self;
        let [x, y, z] = &node.faces;
        let at = |faces: &[[f32; LANES]; 2], face: usize, origin: Lanes<S>, inverse: Lanes<S>| {
            (Lanes::new(simd, faces[face & 1]) - origin) * inverse
        };
        let near = at(x, first[0], origin.x, inverse.x)
            .max(at(y, first[1], origin.y, inverse.y))
            .max(at(z, first[2], origin.z, inverse.z))
            .max(Lanes::all(simd, 0.0));
        let far = at(x, first[0] ^ 1, origin.x, inverse.x)
            .min(at(y, first[1] ^ 1, origin.y, inverse.y))
            .min(at(z, first[2] ^ 1, origin.z, inverse.z))
            .min(Lanes::all(simd, reach));
        (simd.bits(near.at_most(far)), near.array())
    }
}

/// A limit that the infinite distance of a miss does not keep.
#[inline(always)]
fn finite(limit: f32) -> f32 {
    limit.min(f32::MAX)
}

/// A child to be sorted by distance.
#[inline(always)]
fn place(distance: f32, child: u32) -> u64 {
    (u64::from(distance.to_bits()) << 32) | u64::from(child)
}

/// Distance and child of a place.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "halves are meant")]
fn from_place(place: u64) -> (f32, u32) {
    (f32::from_bits((place >> 32) as u32), place as u32)
}

struct Nearest<'a, T: Shapes> {
    tree: &'a Tree<T::Leaf>,
    ray: &'a Ray,
    shapes: &'a T,
    waiting: &'a mut Waiting,
}

impl<T: Shapes> Kernel for Nearest<'_, T> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Eight>(self, simd: S) -> Option<Hit> {
        let Self { tree, ray, shapes, waiting: Waiting(waiting) } = self;
        let lanes = LaneRay::new(simd, ray.origin, ray.direction);
        let slabs = Slabs::new(ray, &lanes);
        let mut hit = Hit { shape: u32::MAX, distance: ray.reach };
        let (mut count, mut here) = (0, 0_u64);
        loop {
            let (_, child) = from_place(here);
            if child & LEAF == 0 {
                let node = &tree.nodes[child as usize];
                let (mut entered, distances) = slabs.enter(node, hit.distance);
                if entered != 0 {
                    let mut next = || {
                        let lane = entered.trailing_zeros() as usize % LANES;
                        entered &= entered - 1;
                        (place(distances[lane], node.children[lane]), entered != 0)
                    };
                    let (first, mut more) = next();
                    here = first;
                    let bottom = count;
                    while more {
                        let (mut other, others) = next();
                        more = others;
                        if other < here {
                            std::mem::swap(&mut other, &mut here);
                        }
                        // Those that wait stay sorted, the nearest on top.
                        let mut at = count;
                        while at > bottom && waiting[at - 1] < other {
                            waiting[at] = waiting[at - 1];
                            at -= 1;
                        }
                        waiting[at] = other;
                        count += 1;
                    }
                    continue;
                }
            } else {
                let leaf = &tree.leaves[(child & !LEAF) as usize];
                let (mut met, distances) = shapes.distances(leaf, &lanes, finite(hit.distance));
                while met != 0 {
                    let lane = met.trailing_zeros() as usize % LANES;
                    met &= met - 1;
                    let (shape, distance) = (leaf.shape(lane), distances[lane]);
                    // Ties go to the first shape. Otherwise the order of traversal would decide at
                    // the joints of a yarn, and with it the picture.
                    if distance < hit.distance || (distance == hit.distance && shape < hit.shape) {
                        hit = Hit { shape, distance };
                    }
                }
            }
            loop {
                if count == 0 {
                    return (hit.distance < ray.reach).then_some(hit);
                }
                count -= 1;
                here = waiting[count];
                if from_place(here).0 <= hit.distance {
                    break;
                }
            }
        }
    }
}

struct Visit<'a, T: Shapes, V> {
    tree: &'a Tree<T::Leaf>,
    ray: &'a Ray,
    shapes: &'a T,
    waiting: &'a mut Waiting,
    visit: V,
}

impl<T: Shapes, V: FnMut(u32) -> bool> Kernel for Visit<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Eight>(self, simd: S) {
        let Self { tree, ray, shapes, waiting: Waiting(waiting), mut visit } = self;
        let lanes = LaneRay::new(simd, ray.origin, ray.direction);
        let slabs = Slabs::new(ray, &lanes);
        let (mut count, mut here) = (0, 0_u32);
        loop {
            if here & LEAF == 0 {
                let node = &tree.nodes[here as usize];
                let (mut entered, _) = slabs.enter(node, ray.reach);
                while entered != 0 {
                    let lane = entered.trailing_zeros() as usize % LANES;
                    entered &= entered - 1;
                    waiting[count] = u64::from(node.children[lane]);
                    count += 1;
                }
            } else {
                let leaf = &tree.leaves[(here & !LEAF) as usize];
                let (mut met, _) = shapes.distances(leaf, &lanes, finite(ray.reach));
                while met != 0 {
                    let lane = met.trailing_zeros() as usize % LANES;
                    met &= met - 1;
                    if !visit(leaf.shape(lane)) {
                        return;
                    }
                }
            }
            if count == 0 {
                return;
            }
            count -= 1;
            (_, here) = from_place(waiting[count]);
        }
    }
}
