//! Contacts of the strain solver: which segments of yarn may touch, and how near they are.
//!
//! In: the sampled curves of a strained repeat. Out: a neighbour list, rebuilt once yarns have moved
//! by its skin, and the distance of each pair. Cost: about a microsecond a segment for a list, some
//! nanoseconds a pair.

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::rest::{Rest, RestSegment, RestSpan};
use super::solver::StrainSolver;
use crate::ids::index32;
use crate::knit::cell_list::CellList;
use crate::yarn::curve;

/// Cutoff of the neighbour list over touching.
const LIST_CUTOFF: f64 = 1.4;
/// The list is rebuilt once a point has moved by this many radii of the thinnest yarn.
const LIST_MOVE: f64 = 0.3;

/// Two segments that may touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    a: u32,
    b: u32,
    /// From b to its image beside a, in cells.
    shift: DVec2,
    /// Sum of both radii, mm.
    pub(super) touching: f64,
}

impl Pair {
    /// The spans of both segments.
    pub(super) fn spans<'a>(&self, rest: &'a Rest) -> [&'a RestSpan; 2] {
        [self.a, self.b].map(|at| &rest.spans[rest.segments[at as usize].span as usize])
    }
}

/// How near two segments are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Distance over touching.
    pub(super) ratio: f64,
    /// From the second one to the first, of unit length.
    pub(super) direction: DVec3,
    /// Weights of the four control points of each in its nearest place.
    pub(super) weights: [[f64; 4]; 2],
}

impl StrainSolver<'_> {
    /// Whether yarns that are not in the list may have met.
    pub(super) fn list_is_stale(&self) -> bool {
        let limit = LIST_MOVE * self.rest.thinnest;
        self.list_points.len() != self.points.len()
            || self
                .points
                .iter()
                .zip(&self.list_points)
                .any(|(point, before)| point.distance_squared(*before) > limit * limit)
    }

    /// Builds the neighbour list.
    pub(super) fn build_list(&mut self) {
        self.list_points.clone_from(&self.points);
        self.find_pairs();
    }

    /// Finds all pairs of segments nearer than the cutoff.
    fn find_pairs(&mut self) {
        let back = self.strain.inverse();
        let ends = |segment: &RestSegment| self.ends(segment);
        let middles: Vec<_> =
            self.rest.segments.iter().map(|s| ends(s)[0].midpoint(ends(s)[1])).collect();
        let halves: Vec<_> =
            self.rest.segments.iter().map(|s| ends(s)[0].distance(ends(s)[1]) / 2.0).collect();
        let thickest = self.rest.yarns.iter().map(|yarn| yarn.chain.radius).fold(0.0, f64::max);
        // The list is sorted in the axes of the flat cloth, whose cell is a rectangle. A strained
        // distance is longer there by the norm of the inverse map at most; depths stay.
        let longer = norm(back).max(1.0);
        let balls = middles.iter().zip(&halves).map(|(middle, half): (&DVec3, &f64)| {
            ((back * middle.xy()).extend(middle.z), half * longer)
        });
        let balls: Vec<_> = balls.collect();
        let list = CellList::new(&balls, self.rest.cell, 2.0 * LIST_CUTOFF * thickest * longer);
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        for (a, one) in self.rest.segments.iter().enumerate() {
            list.near(a, |b, shift| {
                if b < a || (b == a && (shift.x, shift.y) <= (0.0, 0.0)) {
                    return;
                }
                let other = &self.rest.segments[b];
                let [yarn, other_yarn] =
                    [one, other].map(|s| self.rest.spans[s.span as usize].yarn as usize);
                let [chain, other_chain] =
                    [yarn, other_yarn].map(|yarn| &self.rest.yarns[yarn].chain);
                let touching = chain.radius + other_chain.radius;
                let reach = LIST_CUTOFF * touching + halves[a] + halves[b];
                let offset = self.offset(shift);
                if (middles[b] + offset).distance_squared(middles[a]) > reach * reach
                    || (yarn == other_yarn
                        && chain.is_same_strand(
                            self.along(other) - self.along(one),
                            shift,
                            self.lengths[yarn],
                        ))
                {
                    return;
                }
                let pair = Pair { a: index32(a), b: index32(b), shift, touching };
                if self.contact(&pair, LIST_CUTOFF).is_some() {
                    pairs.push(pair);
                }
            });
        }
        self.pairs = pairs;
    }

    /// For each point the points with which it shares residuals, in ascending order.
    pub(super) fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut joined = PointSets::new(self.points.len());
        self.rest.spans.iter().for_each(|span| joined.join(&span.control.points));
        let mut before = None;
        for pair in &self.pairs {
            let spans = pair.spans(self.rest);
            // Pairs of the same two spans often follow each other.
            let points = spans.map(|span| span.control.points);
            if before.replace(points) != Some(points) {
                joined.join(points.as_flattened());
            }
        }
        joined.lists()
    }

    /// How near a pair is; nothing if it is farther than `cutoff` over touching.
    #[inline]
    pub(super) fn contact(&self, pair: &Pair, cutoff: f64) -> Option<Contact> {
        let [a, b] = [pair.a, pair.b].map(|at| &self.rest.segments[at as usize]);
        let offset = self.offset(pair.shift);
        let (one, other) = (self.ends(a), self.ends(b).map(|end| end + offset));
        let (along, along_other) = curve::nearest_of_segments(one, other);
        let apart = one[0].lerp(one[1], along) - other[0].lerp(other[1], along_other);
        let distance = apart.length();
        let ratio = distance / pair.touching;
        (ratio < cutoff).then(|| Contact {
            ratio,
            // Centre lines that meet have no direction apart; depth is where cloth has room.
            direction: if distance > 1e-9 { apart / distance } else { DVec3::Z },
            weights: [self.shares(a, along), self.shares(b, along_other)],
        })
    }

    /// Weights of the control points at a share of the way along a segment.
    fn shares(&self, segment: &RestSegment, along: f64) -> [f64; 4] {
        let at = segment.sample as usize;
        let (from, to) = (&self.weights[at], &self.weights[at + 1]);
        std::array::from_fn(|k| from[k] + along * (to[k] - from[k]))
    }

    fn ends(&self, segment: &RestSegment) -> [DVec3; 2] {
        let at = segment.sample as usize;
        [self.samples[at], self.samples[at + 1]]
    }

    /// A shift in cells as a place of the strained cloth.
    fn offset(&self, shift: DVec2) -> DVec3 {
        (self.strain * (shift * self.rest.cell)).extend(0.0)
    }

    /// Yarn length from the start of the repeat to the middle of a segment.
    fn along(&self, segment: &RestSegment) -> f64 {
        let sample = segment.sample as usize;
        f64::midpoint(self.along[sample], self.along[sample + 1])
    }
}

/// For each point a set of points, as bits: 125 kB for a thousand points.
struct PointSets {
    /// Words of a set.
    width: usize,
    words: Vec<u64>,
}

impl PointSets {
    fn new(points: usize) -> Self {
        let width = points.div_ceil(64);
        Self { width, words: vec![0; points * width] }
    }

    /// Puts each of some points into the sets of the others.
    fn join(&mut self, points: &[u32]) {
        for &one in points {
            let own = &mut self.words[one as usize * self.width..][..self.width];
            for &other in points.iter().filter(|&&other| other != one) {
                own[other as usize / 64] |= 1 << (other % 64);
            }
        }
    }

    fn lists(&self) -> Vec<Vec<u32>> {
        let list = |set: &[u64]| {
            let words = (0u32..).step_by(64).zip(set);
            words.flat_map(|(first, &word)| bits(word).map(move |bit| first + bit)).collect()
        };
        self.words.chunks_exact(self.width.max(1)).map(list).collect()
    }
}

/// The places of a word's bits, in ascending order.
fn bits(word: u64) -> impl Iterator<Item = u32> {
    std::iter::successors((word != 0).then_some(word), |word| {
        let rest = word & (word - 1);
        (rest != 0).then_some(rest)
    })
    .map(u64::trailing_zeros)
}

/// The largest stretch of a map.
fn norm(map: glam::DMat2) -> f64 {
    let (a, b) = (map.x_axis, map.y_axis);
    let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
    (0.5 * (aa + bb) + (0.5 * (aa - bb)).hypot(ab)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_points_know_each_other_in_order() {
        let mut sets = PointSets::new(130);
        sets.join(&[129, 0, 64, 63]);
        sets.join(&[0, 64]);
        let lists = sets.lists();
        assert_eq!(lists[0], [63, 64, 129]);
        assert_eq!(lists[129], [0, 63, 64]);
        assert!(lists.len() == 130 && lists[1].is_empty());
        assert!(PointSets::new(0).lists().is_empty());
    }
}
