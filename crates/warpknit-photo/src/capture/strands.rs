//! From segments to yarns that go on: what lies between the stretches that are seen.
//!
//! In: the segments of a rectangular cell. Out: [`Strand`]s, each the path of a yarn through the
//! cell, which goes on into the next one above or beside. Ends of segments are joined: those first
//! between which a segment is known to go on below others, then those that lie near each other and
//! straight ahead; between them a yarn lies as deep under the cloth's middle as it lies above it
//! where it is seen. A yarn of which no other end is found goes on, underneath, to its own copy in
//! the next cell.
//!
//! Not promised: what a photo doesn't show. Which leg of a loop goes on as which head is a guess.

use glam::{DVec2, DVec3};

use super::shape::Shape;
use crate::plane::double;

/// Gaps between ends that are joined, in widths of the yarn, and how far either end may turn aside,
/// radians.
const FARTHEST: f64 = 4.5;
const SHARPEST: f64 = 0.7;
/// What a radian of turning aside costs, as a share of the gap.
const TURNING: f64 = 3.0;
/// Gaps under this many widths are no way under anything.
const TOUCHING: f64 = 0.25;
/// How much of the depth that light says beside the mean is believed, and the most, radii.
const RELIEF: (f64, f64) = (0.5, 0.5);
/// How far a segment's ends sink at most, of the way down to the cloth's middle.
const SINKS: f64 = 0.8;
/// A yarn that goes on to its own copy lies so much deeper than the others: it may cross many.
const UNDERNEATH: f64 = 1.6;

/// A segment as it lies in the cell, mm, y up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Which of the layout's segments that are seen it is.
    pub(super) segment: usize,
    /// The number of the segment that is seen there: parts of it have the same, one after another,
    /// where others lie over it.
    pub(super) number: usize,
    /// Five places along its axis, from end to end.
    pub(super) axis: [DVec2; 5],
    /// How far it has gone down at each of them, 0 to 1.
    pub(super) fallen: [f64; 5],
    pub(super) shape: Shape,
}

/// A yarn through the cell.
#[derive(Clone, Debug)]
pub(super) struct Strand {
    /// Whether it goes on beside and not above.
    pub(super) across: bool,
    /// Its axis, mm; from the last point it goes on to the first one of the next cell.
    pub(super) path: Vec<DVec3>,
    /// The layout's segments that are seen along it.
    pub(super) segments: Vec<usize>,
    /// mm.
    pub(super) width: f64,
}

/// Which places of a piece's axis are its ends, and which ones are next to them.
const END: [usize; 2] = [0, 4];
const BEFORE: [usize; 2] = [1, 3];

/// An end of a piece: its number and which end.
type End = (usize, usize);
/// The end to which a yarn goes on, and how many cells away.
type Next = Option<(End, DVec2)>;

/// Two ends that are one yarn, the second in the copy of the cell that is so many cells away.
#[derive(Clone, Copy, Debug)]
struct Link {
    ends: [End; 2],
    cells: DVec2,
    cost: f64,
}

/// Joins pieces to yarns; they are given copy by copy, in the order in which segments are seen.
pub(super) fn strands(pieces: &[Piece], cell: DVec2) -> Vec<Strand> {
    let mean = pieces.iter().map(|piece| piece.shape.centre.z + piece.shape.semi_axis).sum::<f64>()
        / double(pieces.len().max(1));
    let links = links(pieces, cell);
    let chains = chains(pieces, cell, &links);
    chains.into_iter().map(|chain| chain.laid(pieces, cell, mean)).collect()
}

/// The cheapest links, each end in one of them at most.
fn links(pieces: &[Piece], cell: DVec2) -> Vec<Link> {
    let mut all = Vec::new();
    let ends: Vec<End> = (0..pieces.len()).flat_map(|piece| [(piece, 0), (piece, 1)]).collect();
    for (number, &from) in ends.iter().enumerate() {
        for &to in &ends[number..] {
            let reach = FARTHEST * 0.5 * (pieces[from.0].shape.width + pieces[to.0].shape.width);
            let off = place(pieces, to) - place(pieces, from);
            let (low, high) = (((-reach - off) / cell).ceil(), ((reach - off) / cell).floor());
            for (i, j) in counts(low, high) {
                let cells = DVec2::new(i, j);
                if from == to || (from.0 == to.0 && cells == DVec2::ZERO) {
                    continue;
                }
                let gap = off + cells * cell;
                let is_known = cells == DVec2::ZERO && go_on(pieces, from, to);
                let cost = if is_known { Some(0.0) } else { cost(pieces, from, to, gap) };
                if let Some(cost) = cost.filter(|_| gap.length() < reach) {
                    all.push(Link { ends: [from, to], cells, cost });
                }
            }
        }
    }
    all.sort_by(|p, q| p.cost.total_cmp(&q.cost));
    let mut taken = vec![[false; 2]; pieces.len()];
    all.retain(|Link { ends: [p, q], .. }| {
        let is_free = !taken[p.0][p.1] && !taken[q.0][q.1];
        if is_free {
            taken[p.0][p.1] = true;
            taken[q.0][q.1] = true;
        }
        is_free
    });
    all
}

fn counts(low: DVec2, high: DVec2) -> impl Iterator<Item = (f64, f64)> {
    let range = |low: f64, high: f64| (super::steps(low)..=super::steps(high)).map(f64::from);
    range(low.y, high.y).flat_map(move |j| range(low.x, high.x).map(move |i| (i, j)))
}

fn place(pieces: &[Piece], (piece, end): End) -> DVec2 {
    pieces[piece].axis[END[end]]
}

/// The direction in which a piece leaves at an end.
fn outward(pieces: &[Piece], (piece, end): End) -> DVec2 {
    let axis = &pieces[piece].axis;
    (axis[END[end]] - axis[BEFORE[end]]).normalize_or_zero()
}

/// Whether the second is the next part of the same segment: between them it lies below others.
fn go_on(pieces: &[Piece], from: End, to: End) -> bool {
    let [p, q] = [from, to].map(|(piece, _)| &pieces[piece]);
    p.number == q.number
        && p.segment + 1 == q.segment
        && [from.1, to.1] == [1, 0]
        && to.0 == from.0 + 1
}

/// What joining two ends costs, if they may be one yarn's.
fn cost(pieces: &[Piece], from: End, to: End, gap: DVec2) -> Option<f64> {
    let (out, back) = (outward(pieces, from), -outward(pieces, to));
    let width = 0.5 * (pieces[from.0].shape.width + pieces[to.0].shape.width);
    // What nearly touches has no direction of its own.
    let way = if gap.length() < TOUCHING * width { out + back } else { gap };
    let turns = [out, back].map(|direction| way.angle_to(direction).abs());
    let widths = (pieces[from.0].shape.width / pieces[to.0].shape.width).ln().abs();
    (turns[0].max(turns[1]) < SHARPEST && widths < 0.5)
        .then(|| (gap.length() + 0.2 * width) * (1.0 + TURNING * (turns[0] + turns[1]) + widths))
}

/// Pieces one after another: each with the end where the yarn enters it and the copy of the cell
/// that it is in.
struct Chain {
    pieces: Vec<(End, DVec2)>,
    /// Cells from a piece to its next copy on the yarn, and whether no link says so.
    period: DVec2,
    is_closed_underneath: bool,
}

/// Follows links from piece to piece until they close or end.
fn chains(all: &[Piece], cell: DVec2, links: &[Link]) -> Vec<Chain> {
    let count = all.len();
    let mut next: Vec<[Next; 2]> = vec![[None; 2]; count];
    for Link { ends: [p, q], cells, .. } in links {
        next[p.0][p.1] = Some((*q, *cells));
        next[q.0][q.1] = Some((*p, -*cells));
    }
    let mut seen = vec![false; count];
    let mut chains = Vec::new();
    for first in 0..count {
        if seen[first] {
            continue;
        }
        // Back to where it begins, if it does anywhere.
        let begin = followed(&next, (first, 1), count)
            .last()
            .map_or((first, 0), |&((piece, end), _)| (piece, 1 - end));
        let begin = if is_ring(&next, first, count) { (first, 0) } else { begin };
        let mut pieces = vec![(begin, DVec2::ZERO)];
        pieces.extend(followed(&next, begin, count));
        pieces.iter().for_each(|((piece, _), _)| seen[*piece] = true);
        let (last, cells) = pieces[pieces.len() - 1];
        let closing =
            next[last.0][1 - last.1].filter(|(to, _)| *to == begin).map(|(_, step)| cells + step);
        let is_step = |period: &DVec2| period.abs().element_sum() == 1.0;
        match closing.filter(is_step) {
            Some(period) => chains.push(Chain { pieces, period, is_closed_underneath: false }),
            None => chains.extend(parts(pieces, all, cell)),
        }
    }
    chains
}

/// A chain that comes back to itself in another cell than the next, or nowhere, in parts of a cell
/// each: a longer one would have to come back underneath, in every cell.
fn parts(chain: Vec<(End, DVec2)>, all: &[Piece], cell: DVec2) -> Vec<Chain> {
    let mut parts: Vec<Chain> = Vec::new();
    let mut start = DVec2::ZERO;
    for (entered, cells) in chain {
        let from = place(all, entered) + cells * cell;
        let to = place(all, (entered.0, 1 - entered.1)) + cells * cell;
        let fits = ((to - start) / cell).abs().max_element() <= 1.0;
        match parts.last_mut().filter(|_| fits) {
            Some(part) => part.pieces.push((entered, cells)),
            None => {
                start = from;
                parts.push(Chain {
                    pieces: vec![(entered, cells)],
                    period: DVec2::ZERO,
                    is_closed_underneath: true,
                });
            }
        }
    }
    parts
}

/// The pieces after one that is entered at an end, up to the last or until the first comes again.
fn followed(next: &[[Next; 2]], entered: End, count: usize) -> Vec<(End, DVec2)> {
    let (mut at, mut cells) = (entered, DVec2::ZERO);
    let mut pieces = Vec::new();
    while let Some((to, step)) = next[at.0][1 - at.1] {
        if to.0 == entered.0 || pieces.len() >= count {
            break;
        }
        cells += step;
        at = to;
        pieces.push((to, cells));
    }
    pieces
}

/// Whether following links from a piece leads back to it.
fn is_ring(next: &[[Next; 2]], first: usize, count: usize) -> bool {
    let entered = (first, 0);
    let last = followed(next, entered, count).last().map_or(entered, |(end, _)| *end);
    next[last.0][1 - last.1].is_some_and(|(to, _)| to == entered)
}

impl Chain {
    /// The path of its yarn.
    fn laid(mut self, pieces: &[Piece], cell: DVec2, mean: f64) -> Strand {
        if self.is_closed_underneath {
            let [(first, _), (last, cells)] = [self.pieces[0], self.pieces[self.pieces.len() - 1]];
            let run = place(pieces, (last.0, 1 - last.1)) + cells * cell - place(pieces, first);
            self.period = if run.x.abs() > run.y.abs() {
                DVec2::X * run.x.signum()
            } else {
                DVec2::Y * if run.y < 0.0 { -1.0 } else { 1.0 }
            };
        }
        if self.period.element_sum() < 0.0 {
            self.turn();
        }
        let mut path = Vec::new();
        for (at, &((piece, end), cells)) in self.pieces.iter().enumerate() {
            let own = &pieces[piece];
            let mut arc = own.arc(cells * cell, mean);
            if end == 1 {
                arc.reverse();
            }
            path.extend(arc);
            let to = arc[END[1]].truncate();
            let is_last = at + 1 == self.pieces.len();
            let (next, beyond) =
                if is_last { (self.pieces[0].0, self.period) } else { self.pieces[at + 1] };
            let goal = place(pieces, next) + beyond * cell;
            let depth = if is_last && self.is_closed_underneath { UNDERNEATH } else { 1.0 };
            path.extend(own.under(to, goal, depth));
        }
        // Each yarn begins in the cell itself.
        let home = ((path[0].truncate() / cell).floor() * cell).extend(0.0);
        path.iter_mut().for_each(|point| *point -= home);
        let width =
            self.pieces.iter().map(|((piece, _), _)| pieces[*piece].shape.width).sum::<f64>()
                / double(self.pieces.len());
        let segments = self.pieces.iter().map(|((piece, _), _)| pieces[*piece].segment).collect();
        Strand { across: self.period.x != 0.0, path, segments, width }
    }

    /// The same yarn from its other end.
    fn turn(&mut self) {
        self.period = -self.period;
        self.pieces.reverse();
        let home = self.pieces[0].1;
        for ((_, end), cells) in &mut self.pieces {
            *end = 1 - *end;
            *cells -= home;
        }
    }
}

impl Piece {
    /// Its axis, so far from where it is given, above the cloth's middle by its radius, and by what
    /// light says beside.
    fn arc(&self, off: DVec2, mean: f64) -> [DVec3; 5] {
        let radius = self.shape.width / 2.0;
        let relief = (RELIEF.0 * (self.shape.centre.z + self.shape.semi_axis - mean))
            .clamp(-RELIEF.1 * radius, RELIEF.1 * radius);
        let sinks = self.shape.sinks().clamp(0.0, SINKS * radius);
        let top = radius + relief;
        std::array::from_fn(|at| (self.axis[at] + off).extend(top - self.fallen[at] * sinks))
    }

    /// Points below the cloth's middle between its end and the next piece's.
    fn under(&self, from: DVec2, to: DVec2, depth: f64) -> impl Iterator<Item = DVec3> + use<> {
        let width = self.shape.width;
        let gap = from.distance(to);
        let count = super::steps((gap / width).round()).clamp(i32::from(gap > TOUCHING * width), 4);
        let low = -depth * width / 2.0 * (gap / width).min(1.0);
        (0..count)
            .map(move |step| from.lerp(to, (f64::from(step) + 0.5) / f64::from(count)).extend(low))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(segment: usize, from: [f64; 2], to: [f64; 2]) -> Piece {
        let ends = [from, to].map(DVec2::from);
        let length = ends[0].distance(ends[1]);
        let centre = ends[0].midpoint(ends[1]).extend(0.3);
        let shape = Shape {
            width: 0.4,
            length,
            semi_axis: 0.2,
            steepest: 0.3,
            curvature: 1.0,
            rotation: 0.0,
            centre,
        };
        let axis = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| ends[0].lerp(ends[1], share));
        Piece { segment, number: segment, axis, fallen: [1.0, 0.25, 0.0, 0.25, 1.0], shape }
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
        let Strand { across, path, .. } = &strands[0];
        assert!(!across && path.len() >= 7 && path[6].y > 0.9 && path[6].z < -0.2, "{path:?}");
    }

    #[test]
    fn a_piece_lies_as_it_does_whichever_end_the_yarn_enters() {
        // Bent, level towards its second end, and below the other way: the yarn runs to the right.
        let bent = [[0.9, 0.5], [0.7, 0.56], [0.5, 0.6], [0.3, 0.58], [0.1, 0.5]].map(DVec2::from);
        let own = Piece {
            axis: bent,
            fallen: [1.0, 0.5, 0.0, 0.0, 0.2],
            ..piece(0, [0.9, 0.5], [0.1, 0.5])
        };
        let strands = strands(&[own], DVec2::ONE);
        let [Strand { across: true, path, .. }] = &strands[..] else { panic!("{strands:?}") };
        let sinks = own.shape.sinks();
        for (at, point) in path[..5].iter().enumerate() {
            assert!(point.truncate().distance(bent[4 - at]) < 1e-12, "{path:?}");
            assert!((point.z - (0.2 - sinks * own.fallen[4 - at])).abs() < 1e-12, "{path:?}");
        }
    }

    #[test]
    fn parts_of_one_segment_are_one_yarn_though_another_end_is_nearer() {
        let parts = [piece(0, [0.1, 0.5], [0.3, 0.5]), piece(1, [0.7, 0.58], [0.95, 0.7])];
        let other = piece(2, [0.35, 0.5], [0.55, 0.5]);
        let numbered = |number: usize| {
            [
                Piece { number: 0, ..parts[0] },
                Piece { number, ..parts[1] },
                Piece { number: 2, ..other },
            ]
        };
        let with = |pieces: [Piece; 3]| {
            strands(&pieces, DVec2::new(1.4, 1.0))
                .iter()
                .map(|strand| strand.segments.clone())
                .collect::<Vec<_>>()
        };
        assert!(
            with(numbered(0)).iter().any(|segments| segments == &[0, 1]),
            "{:?}",
            with(numbered(0))
        );
        assert!(
            !with(numbered(1)).iter().any(|segments| segments == &[0, 1]),
            "{:?}",
            with(numbered(1))
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
