//! Sticks joined to fibres.
//!
//! In: [`Stick`]s. Out: chains of them, one for each fibre.
//!
//! Method: greedy matching. A pair of sticks, one up to four lengths ahead of the other, costs the
//! turn from the first stick to the line between both plus the turn from the line to the second
//! stick. Pairs are taken in the order of their cost, while each stick has at most one before it
//! and one after it.
//!
//! Cost: the square of the number of sticks. Not promised: that a chain stays on one fibre. It may
//! hop to a neighbour that runs the same way. So the sticks tell more about the direction than the
//! lines between them, which depend on how the sticks were spread.

use glam::DVec2;

use super::sticks::Stick;

/// The largest distance between joined sticks, in lengths of one.
const MAX_DISTANCE: f64 = 4.0;
/// The least distance: two sticks side by side are two fibres.
const MIN_DISTANCE: f64 = 0.6;
/// The largest turn from one stick to the next, radians. A helix turns less within four sticks;
/// from about twice as much on, crossing fibres would be joined.
const MAX_TURN: f64 = 0.35;

/// Joins sticks of a length. Sticks that stay alone are left out.
pub(super) fn traced(sticks: &[Stick], length: f64) -> Vec<Vec<Stick>> {
    let mut pairs = Vec::new();
    for (from, stick) in sticks.iter().enumerate() {
        for (to, other) in sticks.iter().enumerate() {
            let offset = other.middle - stick.middle;
            // Only ahead along the yarn: then no chain comes back to its start.
            let is_ahead = offset.x > 0.0
                && offset.length() > MIN_DISTANCE * length
                && offset.length() <= MAX_DISTANCE * length;
            if is_ahead {
                let turn = onward(stick.direction).angle_to(offset).abs()
                    + offset.angle_to(onward(other.direction)).abs();
                pairs.push((turn, from, to));
            }
        }
    }
    pairs.retain(|(turn, _, _)| *turn <= MAX_TURN);
    pairs.sort_by(|p, q| p.0.total_cmp(&q.0).then((p.1, p.2).cmp(&(q.1, q.2))));
    let (mut next, mut has_before) = (vec![None; sticks.len()], vec![false; sticks.len()]);
    for (_, from, to) in pairs {
        if next[from].is_none() && !has_before[to] {
            next[from] = Some(to);
            has_before[to] = true;
        }
    }
    let starts = (0..sticks.len()).filter(|&stick| !has_before[stick] && next[stick].is_some());
    starts
        .map(|start| {
            std::iter::successors(Some(start), |&stick| next[stick])
                .map(|stick| sticks[stick])
                .collect()
        })
        .collect()
}

/// A direction as it runs along the yarn: sticks have no sense of their own.
fn onward(direction: DVec2) -> DVec2 {
    if direction.x < 0.0 { -direction } else { direction }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stick(x: f64, y: f64, degrees: f64) -> Stick {
        Stick { middle: DVec2::new(x, y), direction: DVec2::from_angle(degrees.to_radians()) }
    }

    fn middles(sticks: &[Stick]) -> Vec<Vec<DVec2>> {
        traced(sticks, 10.0)
            .iter()
            .map(|fibre| fibre.iter().map(|stick| stick.middle).collect())
            .collect()
    }

    #[test]
    fn what_lies_in_line_is_joined_and_what_crosses_is_not() {
        let sticks = [
            stick(20.0, 0.0, 180.0),
            stick(0.0, 0.0, 0.0),
            stick(10.0, 0.0, 90.0),
            stick(40.0, 1.0, 2.0),
            stick(10.0, 9.0, -90.0),
        ];
        assert_eq!(
            middles(&sticks),
            [vec![DVec2::ZERO, DVec2::new(20.0, 0.0), DVec2::new(40.0, 1.0)]]
        );
    }

    #[test]
    fn the_straighter_of_two_goes_on_and_far_ones_do_not() {
        let sticks = [
            stick(0.0, 0.0, 0.0),
            stick(15.0, 1.0, 0.0),
            stick(15.0, -3.0, 0.0),
            stick(80.0, 0.0, 0.0),
        ];
        assert_eq!(middles(&sticks), [vec![DVec2::ZERO, DVec2::new(15.0, 1.0)]]);
        assert!(middles(&sticks[..1]).is_empty());
    }
}
