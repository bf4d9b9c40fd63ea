//! From segments to yarns: the stretches between those that are visible.
//!
//! In: the segments of a rectangular cell. Out: [`JoinedStrand`]s, each the path of a yarn through
//! the cell, which goes on into the next cell above or beside.
//!
//! Method: greedy matching of segment ends by a cost of distance and turn. Parts of one segment,
//! which goes on below another, are joined first. Then ends are joined that lie near each other and
//! straight ahead. Between them a yarn lies as deep under the cloth's middle as it lies above it
//! where it is visible. A yarn without another end goes on, underneath, to its own copy in the next
//! cell.
//!
//! Cost: the square of the number of ends, times the cells in reach. Not promised: what a photo
//! doesn't show. Which leg of a loop goes on as which head is a guess.

use glam::{DVec2, DVec3};

use super::shape::CylinderShape;
use crate::plane::double;

/// Largest gap between ends that are joined, in widths of the yarn. It spans a few yarns on top;
/// from about twice as much on, ends of other cells would compete.
const MAX_GAP: f64 = 4.5;
/// Largest turn aside at either end, radians: less than from warp to weft by far.
const MAX_TURN: f64 = 0.7;
/// Cost of turning by a radian, as a share of the gap. At 0, the nearest end wins even if it
/// belongs to the neighbouring yarn.
const TURN_COST: f64 = 3.0;
/// Largest logarithm of the ratio of widths: about 1.65 times as wide.
const MAX_LOG_RATIO: f64 = 0.5;
/// Gaps below this many widths are contacts. They need no points below other yarns, and their
/// direction is noise.
const TOUCHING: f64 = 0.25;
/// Share of the light's deviation from the mean height that moves a yarn up or down. The light of a
/// stain is no height.
const RELIEF_SHARE: f64 = 0.5;
/// Largest such deviation, in radii.
const MAX_RELIEF: f64 = 0.5;
/// How far a segment's ends sink at most, as a share of the way down to the cloth's middle. At 1
/// and more, ends would lie inside of the yarns below them.
const MAX_SINK: f64 = 0.8;
/// Depth of a yarn that goes on to its own copy, in depths of other yarns: it may cross many of
/// them.
const UNDERNEATH: f64 = 1.6;

/// A segment as it lies in the cell, mm, y up.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedSegment {
    /// Its index among the layout's visible segments.
    pub(super) segment: usize,
    /// The index of the whole segment. Visible parts of one segment share it, and come one after
    /// another.
    pub(super) source: usize,
    /// Five points of its axis, from end to end.
    pub(super) axis: [DVec2; 5],
    /// How far it has descended at each of them, 0 to 1.
    pub(super) descent: [f64; 5],
    pub(super) shape: CylinderShape,
}

/// A yarn through the cell.
#[derive(Clone, Debug)]
pub(super) struct JoinedStrand {
    /// Whether it goes on into the cell beside, and not into the one above.
    pub(super) across: bool,
    /// Its axis, mm. From the last point it goes on to the first point of the next cell.
    pub(super) path: Vec<DVec3>,
    /// The layout's visible segments along it.
    pub(super) segments: Vec<usize>,
    /// mm.
    pub(super) width: f64,
}

/// Indices of the axis points that are a segment's ends.
const END: [usize; 2] = [0, 4];
/// Indices of the points next to them.
const BEFORE: [usize; 2] = [1, 3];

/// An end of a placed segment: its index, and which end (0 or 1).
type End = (usize, usize);
/// The end to which a yarn goes on, and the offset in cells.
type Next = Option<(End, DVec2)>;

/// Two ends that are one yarn. The second one is in the copy of the cell at an offset in cells.
#[derive(Clone, Copy, Debug)]
struct EndLink {
    ends: [End; 2],
    cells: DVec2,
    cost: f64,
}

/// Joins placed segments to yarns. They are given copy by copy of the cell, in the order of the
/// layout's visible segments.
pub(super) fn strands(placed: &[PlacedSegment], cell: DVec2) -> Vec<JoinedStrand> {
    let mean = placed.iter().map(|own| own.shape.centre.z + own.shape.semi_axis).sum::<f64>()
        / double(placed.len().max(1));
    let links = links(placed, cell);
    let chains = chains(placed, cell, &links);
    chains.into_iter().map(|chain| chain.into_strand(placed, cell, mean)).collect()
}

/// The cheapest links, with each end in at most one of them.
fn links(placed: &[PlacedSegment], cell: DVec2) -> Vec<EndLink> {
    let mut all = Vec::new();
    let ends: Vec<End> = (0..placed.len()).flat_map(|own| [(own, 0), (own, 1)]).collect();
    for (number, &from) in ends.iter().enumerate() {
        for &to in &ends[number..] {
            let max_gap = MAX_GAP * 0.5 * (placed[from.0].shape.width + placed[to.0].shape.width);
            let offset = place(placed, to) - place(placed, from);
            // The cells whose copy of the second end may be near enough.
            let (low, high) =
                (((-max_gap - offset) / cell).ceil(), ((max_gap - offset) / cell).floor());
            for cells in cells_between(low, high) {
                // An end is not joined to itself, nor to the other end of its own segment in the
                // same cell.
                if from == to || (from.0 == to.0 && cells == DVec2::ZERO) {
                    continue;
                }
                let gap = offset + cells * cell;
                let is_known = cells == DVec2::ZERO && continues_below(placed, from, to);
                let cost = if is_known { Some(0.0) } else { link_cost(placed, from, to, gap) };
                if let Some(cost) = cost.filter(|_| gap.length() < max_gap) {
                    all.push(EndLink { ends: [from, to], cells, cost });
                }
            }
        }
    }
    all.sort_by(|p, q| p.cost.total_cmp(&q.cost));
    let mut taken = vec![[false; 2]; placed.len()];
    all.retain(|EndLink { ends: [p, q], .. }| {
        let is_free = !taken[p.0][p.1] && !taken[q.0][q.1];
        if is_free {
            taken[p.0][p.1] = true;
            taken[q.0][q.1] = true;
        }
        is_free
    });
    all
}

/// All offsets in cells between two, row by row.
fn cells_between(low: DVec2, high: DVec2) -> impl Iterator<Item = DVec2> {
    let rows = super::steps(low.y)..=super::steps(high.y);
    rows.flat_map(move |j| {
        let columns = super::steps(low.x)..=super::steps(high.x);
        columns.map(move |i| DVec2::new(f64::from(i), f64::from(j)))
    })
}

fn place(placed: &[PlacedSegment], (own, end): End) -> DVec2 {
    placed[own].axis[END[end]]
}

/// The direction in which a segment leaves at an end.
fn outward(placed: &[PlacedSegment], (own, end): End) -> DVec2 {
    let axis = &placed[own].axis;
    (axis[END[end]] - axis[BEFORE[end]]).normalize_or_zero()
}

/// Whether the second end begins the next visible part of the same segment.
fn continues_below(placed: &[PlacedSegment], from: End, to: End) -> bool {
    let [p, q] = [from, to].map(|(own, _)| &placed[own]);
    p.source == q.source
        && p.segment + 1 == q.segment
        && [from.1, to.1] == [1, 0]
        && to.0 == from.0 + 1
}

/// The cost of joining two ends; `None` if they can't be one yarn's.
fn link_cost(placed: &[PlacedSegment], from: End, to: End, gap: DVec2) -> Option<f64> {
    let (out, back) = (outward(placed, from), -outward(placed, to));
    let widths = [from, to].map(|(own, _)| placed[own].shape.width);
    let width = 0.5 * (widths[0] + widths[1]);
    // The gap of ends that nearly touch has no direction of its own.
    let direction = if gap.length() < TOUCHING * width { out + back } else { gap };
    let turns = [out, back].map(|end| direction.angle_to(end).abs());
    let log_ratio = (widths[0] / widths[1]).ln().abs();
    (turns[0].max(turns[1]) < MAX_TURN && log_ratio < MAX_LOG_RATIO).then(|| {
        // A fifth of a width is added, so that turns cost something without a gap too.
        (gap.length() + 0.2 * width) * (1.0 + TURN_COST * (turns[0] + turns[1]) + log_ratio)
    })
}

/// Segments one after another along a yarn: each with the end where the yarn enters it and its
/// offset in cells.
struct SegmentChain {
    entries: Vec<(End, DVec2)>,
    /// Offset in cells from a segment to its next copy along the yarn.
    period: DVec2,
    /// Whether no link closes the chain, so that it goes on underneath to its next copy.
    is_closed_underneath: bool,
}

/// Follows links from segment to segment until they close or end.
fn chains(all: &[PlacedSegment], cell: DVec2, links: &[EndLink]) -> Vec<SegmentChain> {
    let count = all.len();
    let mut next: Vec<[Next; 2]> = vec![[None; 2]; count];
    for EndLink { ends: [p, q], cells, .. } in links {
        next[p.0][p.1] = Some((*q, *cells));
        next[q.0][q.1] = Some((*p, -*cells));
    }
    let mut visited = vec![false; count];
    let mut chains = Vec::new();
    for first in 0..count {
        if visited[first] {
            continue;
        }
        // Back to where the chain begins. A ring begins anywhere.
        let begin = if is_ring(&next, first, count) {
            (first, 0)
        } else {
            follow_links(&next, (first, 1), count)
                .last()
                .map_or((first, 0), |&((own, end), _)| (own, 1 - end))
        };
        let mut entries = vec![(begin, DVec2::ZERO)];
        entries.extend(follow_links(&next, begin, count));
        entries.iter().for_each(|((own, _), _)| visited[*own] = true);
        let (last, cells) = entries[entries.len() - 1];
        // A yarn of a fabric goes on into the next cell, across or up. A ring that comes back in
        // the same cell, or in a farther one, isn't such a yarn.
        let closing = next[last.0][1 - last.1]
            .filter(|(to, _)| *to == begin)
            .map(|(_, step)| cells + step)
            .filter(|period| period.abs().element_sum() == 1.0);
        match closing {
            Some(period) => {
                chains.push(SegmentChain { entries, period, is_closed_underneath: false });
            }
            None => chains.extend(split_by_cell(entries, all, cell)),
        }
    }
    chains
}

/// A chain that isn't closed by a link, in parts of at most a cell each. A longer part would have
/// to come back underneath for several cells, in every cell.
fn split_by_cell(
    chain: Vec<(End, DVec2)>,
    all: &[PlacedSegment],
    cell: DVec2,
) -> Vec<SegmentChain> {
    let mut parts: Vec<SegmentChain> = Vec::new();
    let mut start = DVec2::ZERO;
    for (entered, cells) in chain {
        let from = place(all, entered) + cells * cell;
        let to = place(all, (entered.0, 1 - entered.1)) + cells * cell;
        let fits = ((to - start) / cell).abs().max_element() <= 1.0;
        match parts.last_mut().filter(|_| fits) {
            Some(part) => part.entries.push((entered, cells)),
            None => {
                start = from;
                parts.push(SegmentChain {
                    entries: vec![(entered, cells)],
                    period: DVec2::ZERO,
                    is_closed_underneath: true,
                });
            }
        }
    }
    parts
}

/// The segments after one that is entered at an end, up to the last one or until the first one
/// comes again.
fn follow_links(next: &[[Next; 2]], entered: End, count: usize) -> Vec<(End, DVec2)> {
    let (mut at, mut cells) = (entered, DVec2::ZERO);
    let mut entries = Vec::new();
    while let Some((to, step)) = next[at.0][1 - at.1] {
        if to.0 == entered.0 || entries.len() >= count {
            break;
        }
        cells += step;
        at = to;
        entries.push((to, cells));
    }
    entries
}

/// Whether the links from a segment lead back to it.
fn is_ring(next: &[[Next; 2]], first: usize, count: usize) -> bool {
    let entered = (first, 0);
    let last = follow_links(next, entered, count).last().map_or(entered, |(end, _)| *end);
    next[last.0][1 - last.1].is_some_and(|(to, _)| to == entered)
}

impl SegmentChain {
    /// The path of the chain's yarn.
    fn into_strand(mut self, placed: &[PlacedSegment], cell: DVec2, mean: f64) -> JoinedStrand {
        if self.is_closed_underneath {
            self.period = self.main_direction(placed, cell);
        }
        // All yarns run to the right or up, as the fabric file has them.
        if self.period.element_sum() < 0.0 {
            self.reverse();
        }
        let mut path = Vec::new();
        for (at, &((index, end), cells)) in self.entries.iter().enumerate() {
            let own = &placed[index];
            let mut arc = own.arc(cells * cell, mean);
            if end == 1 {
                arc.reverse();
            }
            path.extend(arc);
            let from = arc[END[1]].truncate();
            let is_last = at + 1 == self.entries.len();
            let (next, beyond) =
                if is_last { (self.entries[0].0, self.period) } else { self.entries[at + 1] };
            let to = place(placed, next) + beyond * cell;
            let depth = if is_last && self.is_closed_underneath { UNDERNEATH } else { 1.0 };
            path.extend(own.points_below(from, to, depth));
        }
        // Each yarn begins in the cell itself.
        let corner = ((path[0].truncate() / cell).floor() * cell).extend(0.0);
        path.iter_mut().for_each(|point| *point -= corner);
        let width = self.entries.iter().map(|((own, _), _)| placed[*own].shape.width).sum::<f64>()
            / double(self.entries.len());
        let segments = self.entries.iter().map(|((own, _), _)| placed[*own].segment).collect();
        JoinedStrand { across: self.period.x != 0.0, path, segments, width }
    }

    /// The step of one cell, along x or y, in the direction in which the chain mostly runs.
    fn main_direction(&self, placed: &[PlacedSegment], cell: DVec2) -> DVec2 {
        let [(first, _), (last, cells)] = [self.entries[0], self.entries[self.entries.len() - 1]];
        let run = place(placed, (last.0, 1 - last.1)) + cells * cell - place(placed, first);
        if run.x.abs() > run.y.abs() {
            DVec2::X * run.x.signum()
        } else {
            DVec2::Y * if run.y < 0.0 { -1.0 } else { 1.0 }
        }
    }

    /// The same yarn from its other end.
    fn reverse(&mut self) {
        self.period = -self.period;
        self.entries.reverse();
        let home = self.entries[0].1;
        for ((_, end), cells) in &mut self.entries {
            *end = 1 - *end;
            *cells -= home;
        }
    }
}

impl PlacedSegment {
    /// Its axis in space at an offset: above the cloth's middle by its radius, and by a share of
    /// the height that the light says.
    fn arc(&self, offset: DVec2, mean: f64) -> [DVec3; 5] {
        let radius = self.shape.width / 2.0;
        let relief = (RELIEF_SHARE * (self.shape.centre.z + self.shape.semi_axis - mean))
            .clamp(-MAX_RELIEF * radius, MAX_RELIEF * radius);
        let sinks = self.shape.sinks().clamp(0.0, MAX_SINK * radius);
        let top = radius + relief;
        std::array::from_fn(|at| (self.axis[at] + offset).extend(top - self.descent[at] * sinks))
    }

    /// Points below the cloth's middle between its end and the next segment's.
    fn points_below(
        &self,
        from: DVec2,
        to: DVec2,
        depth: f64,
    ) -> impl Iterator<Item = DVec3> + use<> {
        let width = self.shape.width;
        let gap = from.distance(to);
        // About one point a width. The curve through the points is smooth, so that more than four
        // would add nothing.
        let count = super::steps((gap / width).round()).clamp(i32::from(gap > TOUCHING * width), 4);
        // In a gap under a width there is no room to go all the way down.
        let low = -depth * width / 2.0 * (gap / width).min(1.0);
        (0..count)
            .map(move |step| from.lerp(to, (f64::from(step) + 0.5) / f64::from(count)).extend(low))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(segment: usize, from: [f64; 2], to: [f64; 2]) -> PlacedSegment {
        let ends = [from, to].map(DVec2::from);
        let length = ends[0].distance(ends[1]);
        let centre = ends[0].midpoint(ends[1]).extend(0.3);
        let shape = CylinderShape {
            width: 0.4,
            length,
            semi_axis: 0.2,
            steepest: 0.3,
            curvature: 1.0,
            rotation: 0.0,
            centre,
        };
        let axis = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| ends[0].lerp(ends[1], share));
        PlacedSegment {
            segment,
            source: segment,
            axis,
            descent: [1.0, 0.25, 0.0, 0.25, 1.0],
            shape,
        }
    }

    #[test]
    fn a_plain_weave_is_four_yarns_that_go_over_and_under() {
        // Floats of half a millimetre on crossings half a millimetre apart; one of each pair is
        // given backwards.
        let pieces = [
            piece(0, [0.25, 0.0], [0.25, 0.5]),
            piece(0, [0.75, 1.0], [0.75, 0.5]),
            piece(1, [0.5, 0.25], [1.0, 0.25]),
            piece(1, [0.5, 0.75], [0.0, 0.75]),
        ];
        let strands = strands(&pieces, DVec2::ONE);
        assert_eq!(strands.len(), 4, "{strands:?}");
        for (strand, across) in strands.iter().zip([false, false, true, true]) {
            assert_eq!((strand.across, strand.segments.len()), (across, 1));
            let beside = |point: &DVec3| if across { point.y } else { point.x };
            let first = beside(&strand.path[0]);
            assert!(
                strand.path.iter().all(|point| (beside(point) - first).abs() < 1e-12),
                "{strand:?}"
            );
            let along: Vec<f64> =
                strand.path.iter().map(|point| if across { point.x } else { point.y }).collect();
            assert!(along.is_sorted(), "{strand:?}");
            assert!(
                (strand.path[2].z - 0.2).abs() < 1e-12 && (strand.path[5].z + 0.2).abs() < 1e-12,
                "{strand:?}"
            );
        }
    }

    #[test]
    fn a_leg_without_another_goes_on_to_its_own_copy() {
        let strands = strands(&[piece(0, [0.2, 0.1], [0.5, 0.9])], DVec2::new(4.0, 3.0));
        assert_eq!(strands.len(), 1);
        let JoinedStrand { across, path, .. } = &strands[0];
        assert!(!across && path.len() >= 7 && path[6].y > 0.9 && path[6].z < -0.2, "{path:?}");
    }

    #[test]
    fn a_piece_lies_as_it_does_whichever_end_the_yarn_enters() {
        // Bent, level towards its second end, and below the other way: the yarn runs to the right.
        let bent = [[0.9, 0.5], [0.7, 0.56], [0.5, 0.6], [0.3, 0.58], [0.1, 0.5]].map(DVec2::from);
        let own = PlacedSegment {
            axis: bent,
            descent: [1.0, 0.5, 0.0, 0.0, 0.2],
            ..piece(0, [0.9, 0.5], [0.1, 0.5])
        };
        let strands = strands(&[own], DVec2::ONE);
        let [JoinedStrand { across: true, path, .. }] = &strands[..] else { panic!("{strands:?}") };
        let sinks = own.shape.sinks();
        for (at, point) in path[..5].iter().enumerate() {
            assert!(point.truncate().distance(bent[4 - at]) < 1e-12, "{path:?}");
            assert!((point.z - (0.2 - sinks * own.descent[4 - at])).abs() < 1e-12, "{path:?}");
        }
    }

    #[test]
    fn parts_of_one_segment_are_one_yarn_though_another_end_is_nearer() {
        let parts = [piece(0, [0.1, 0.5], [0.3, 0.5]), piece(1, [0.7, 0.58], [0.95, 0.7])];
        let other = piece(2, [0.35, 0.5], [0.55, 0.5]);
        let with_source = |source: usize| {
            [
                PlacedSegment { source: 0, ..parts[0] },
                PlacedSegment { source, ..parts[1] },
                PlacedSegment { source: 2, ..other },
            ]
        };
        let with = |pieces: [PlacedSegment; 3]| {
            strands(&pieces, DVec2::new(1.4, 1.0))
                .iter()
                .map(|strand| strand.segments.clone())
                .collect::<Vec<_>>()
        };
        assert!(
            with(with_source(0)).iter().any(|segments| segments == &[0, 1]),
            "{:?}",
            with(with_source(0))
        );
        assert!(
            !with(with_source(1)).iter().any(|segments| segments == &[0, 1]),
            "{:?}",
            with(with_source(1))
        );
    }

    #[test]
    fn two_floats_in_a_row_are_one_yarn() {
        let strands = strands(
            &[piece(3, [0.1, 0.5], [0.4, 0.5]), piece(5, [0.6, 0.5], [0.9, 0.5])],
            DVec2::ONE,
        );
        assert_eq!(strands.len(), 1, "{strands:?}");
        assert!(strands[0].across && strands[0].segments == [3, 5]);
    }

    #[test]
    fn no_yarn_goes_on_for_cells_and_comes_back_underneath() {
        // Floats of neighbouring warps that lie so near each other's ends that links run
        // diagonally, cell after cell.
        let cell = DVec2::new(0.9, 1.2);
        let pieces = [
            piece(0, [0.2, 0.1], [0.35, 0.55]),
            piece(0, [0.65, 0.7], [0.8, 1.15]),
            piece(1, [0.1, 0.62], [0.5, 0.68]),
        ];
        for strand in strands(&pieces, cell) {
            let along = |point: &DVec3| if strand.across { point.x } else { point.y };
            let side = if strand.across { cell.x } else { cell.y };
            let ends = strand
                .path
                .iter()
                .map(along)
                .chain([along(&strand.path[0]) + side])
                .collect::<Vec<_>>();
            let backward: f64 = ends.windows(2).map(|ends| (ends[0] - ends[1]).max(0.0)).sum();
            assert!(backward < 0.2 * side, "{strand:?}");
        }
    }
}
