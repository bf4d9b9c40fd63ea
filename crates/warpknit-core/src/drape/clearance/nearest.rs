//! The search for yarns that are near each other.
//!
//! In: [`Arc`]s. Out: [`NearestSegments`], for each segment how near the nearest other yarn comes.
//!
//! Method: a spatial hash gives arcs whose bounding spheres meet. Then the straight lines between
//! their ends are compared, less the bulge of the arcs. What is left are arcs that touch or nearly
//! do. Their four segments are compared with the other four, four pairs at a time.
//!
//! Cost: 0.3 µs an arc. Not promised: yarns that are further apart than the cutoff, and cloth that
//! lies on cloth. Arcs far apart on the flat panel are not compared.

use std::array::from_fn;

use glam::DVec3;

use super::arcs::{Arc, SEGMENTS};
use crate::drape::segments::squared_distances;
use crate::knit::clearance::{MAX_CANDIDATES, SAME_STRAND_RADII};
use crate::spatial_hash::{SpatialHash, Sphere};

/// Two yarns are neighbours in the flat cloth if they are nearer there than this, in sums of radii.
/// Wales are five sums of radii apart at most. Much higher values take the other side of a fold for
/// a neighbour, lower ones miss wales that a crease pushes together.
pub(super) const NEIGHBOURS: f32 = 8.0;
/// Parts of one strand nearer than this along it, in radii, are not compared.
#[expect(clippy::cast_possible_truncation, reason = "a number of one digit")]
const SAME_STRAND: f32 = SAME_STRAND_RADII as f32;

/// How near the segments of some arcs come to others.
#[derive(Default)]
pub(super) struct NearestSegments {
    /// Square of the least distance over the sum of radii, for each segment of each arc. It is that
    /// of the cutoff where nothing is nearer.
    pub(super) squared: Vec<[f32; SEGMENTS]>,
    sorted_squared: Vec<[f32; SEGMENTS]>,
    /// Pairs of segments nearer than the cutoff. A pair of two measured segments counts twice, and
    /// once of a measured one and one beside the measured place, where it counts again.
    pub(super) pairs: u64,
    /// Those nearer than touching.
    pub(super) pairs_below_1: u64,
    spheres: Vec<Sphere>,
    /// The arcs in the order of [`SpatialHash::order`].
    sorted: Vec<Arc>,
    hash: SpatialHash,
}

impl NearestSegments {
    /// Compares all arcs, up to a distance of `cutoff` sums of radii.
    pub(super) fn find(&mut self, arcs: &[Arc], cutoff: f32) {
        self.sorted_squared.clear();
        self.sorted_squared.resize(arcs.len(), [cutoff * cutoff; SEGMENTS]);
        (self.pairs, self.pairs_below_1) = (0, 0);
        let near = arcs.first().map_or(DVec3::ZERO, |arc| arc.start);
        self.spheres.clear();
        self.spheres.extend(arcs.iter().map(|arc| arc.sphere(near, cutoff)));
        let largest = self.spheres.iter().map(|sphere| sphere.reach).fold(0.0, f32::max);
        self.hash.fill(self.spheres.iter().copied(), 2.0 * largest);
        // Copied in the order of space, so that neighbours are in the cache together.
        self.sorted.clear();
        self.sorted.extend(self.hash.order().map(|at| arcs[at as usize]));
        let Self { sorted_squared: squared, pairs, pairs_below_1, hash, sorted: arcs, .. } = self;
        let arcs = arcs.as_slice();
        hash.pairs(MAX_CANDIDATES, &mut |one, others| {
            let a = &arcs[one];
            let mut lanes = ArcLanes::default();
            let mut compare = |lanes: &mut ArcLanes| {
                for other in lanes.near(a, cutoff) {
                    let b = &arcs[other as usize];
                    let near = squared.get_disjoint_mut([one, other as usize]);
                    let [near, touching] = compare(a, b, cutoff, near.expect("two different arcs"));
                    let times = u64::from(a.measured) + u64::from(b.measured);
                    *pairs += times * near;
                    *pairs_below_1 += times * touching;
                }
            };
            for &other in others {
                if may_count(a, &arcs[other as usize])
                    && lanes.fill(a, other, &arcs[other as usize])
                {
                    compare(&mut lanes);
                }
            }
            compare(&mut lanes);
        });
        self.squared.resize(arcs.len(), [0.0; SEGMENTS]);
        for (at, &squared) in self.hash.order().zip(&self.sorted_squared) {
            self.squared[at as usize] = squared;
        }
    }
}

/// Whether two arcs are to be compared: neighbours in the flat cloth, not too near along the yarn.
#[inline]
fn may_count(a: &Arc, b: &Arc) -> bool {
    let neighbours = NEIGHBOURS * (a.radius + b.radius);
    let between =
        (a.along[0] - b.along[SEGMENTS - 1]).abs().max((a.along[SEGMENTS - 1] - b.along[0]).abs());
    (a.measured | b.measured)
        & (between > window(a, b))
        & (a.flat.distance_squared(b.flat) < neighbours * neighbours)
}

/// Segments as near as this along the yarn are not compared. Below 0 for different strands.
#[inline]
fn window(a: &Arc, b: &Arc) -> f32 {
    if a.strand == b.strand { SAME_STRAND * a.radius } else { -1.0 }
}

/// Up to four arcs that are compared with one at a time, by the straight lines between their ends.
#[derive(Default)]
struct ArcLanes {
    count: usize,
    arcs: [u32; SEGMENTS],
    /// From the start of the one arc to theirs, and from there to their last ends, mm.
    starts: [[f32; SEGMENTS]; 3],
    chords: [[f32; SEGMENTS]; 3],
    radii: [f32; SEGMENTS],
    bulges: [f32; SEGMENTS],
}

impl ArcLanes {
    /// Adds an arc. Whether all lanes are full.
    #[inline]
    fn fill(&mut self, a: &Arc, other: u32, b: &Arc) -> bool {
        let (lane, offset) = (self.count, (b.start - a.start).as_vec3());
        self.arcs[lane] = other;
        for axis in 0..3 {
            self.starts[axis][lane] = b.ends[axis][0] + offset[axis];
            self.chords[axis][lane] = b.ends[axis][SEGMENTS] - b.ends[axis][0];
        }
        (self.radii[lane], self.bulges[lane]) = (b.radius, b.bulge);
        self.count += 1;
        self.count == SEGMENTS
    }

    /// Empties the lanes. Gives those of their arcs that may be nearer than the cutoff.
    #[inline]
    fn near(&mut self, a: &Arc, cutoff: f32) -> impl Iterator<Item = u32> {
        let squared = squared_distances(a.end(0), a.chord(), self.starts, self.chords);
        let near: [bool; SEGMENTS] = from_fn(|k| {
            let reach = cutoff * (a.radius + self.radii[k]) + a.bulge + self.bulges[k];
            squared[k] < reach * reach
        });
        let (arcs, count) = (self.arcs, std::mem::take(&mut self.count));
        (0..count).filter(move |&lane| near[lane]).map(move |lane| arcs[lane])
    }
}

/// Compares all segments of one arc with all of another. Lowers the squared least ratios of both,
/// and counts the pairs nearer than the cutoff and those nearer than touching.
#[inline]
fn compare(a: &Arc, b: &Arc, cutoff: f32, [near_a, near_b]: [&mut [f32; SEGMENTS]; 2]) -> [u64; 2] {
    let offset = (b.start - a.start).as_vec3();
    let steps: [[f32; SEGMENTS]; 3] =
        from_fn(|axis| from_fn(|k| b.ends[axis][k + 1] - b.ends[axis][k]));
    let starts = from_fn(|axis| from_fn(|k| b.ends[axis][k] + offset[axis]));
    let window = window(a, b);
    let radii = a.radius + b.radius;
    let (per_touch, limit) = (1.0 / (radii * radii), cutoff * cutoff);
    let (mut near, mut touching) = ([0; SEGMENTS], [0; SEGMENTS]);
    for (segment, near_a) in near_a.iter_mut().enumerate() {
        let start = a.end(segment);
        let mut ratio = squared_distances(start, a.end(segment + 1) - start, starts, steps);
        for ratio in &mut ratio {
            *ratio *= per_touch;
        }
        // Most segments of two arcs that are near are not near themselves.
        if !ratio.iter().fold(false, |any, &ratio| any | (ratio < limit)) {
            continue;
        }
        for k in 0..SEGMENTS {
            let apart = (a.along[segment] - b.along[k]).abs() > window;
            ratio[k] = if apart { ratio[k] } else { f32::INFINITY };
            near[k] += u32::from(ratio[k] < limit);
            touching[k] += u32::from(ratio[k] < 1.0);
            near_b[k] = at_most(near_b[k], ratio[k]);
        }
        *near_a = ratio.into_iter().fold(*near_a, at_most);
    }
    [near, touching].map(|counts| u64::from(counts.iter().sum::<u32>()))
}

/// The smaller of two numbers, neither of which is undefined: one instruction, where `f32::min` takes
/// four.
#[inline]
fn at_most(most: f32, value: f32) -> f32 {
    if value < most { value } else { most }
}
