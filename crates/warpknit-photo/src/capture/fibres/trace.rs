//! Sticks joined to fibres.
//!
//! In: [`Stick`]s. Out: chains of them, a fibre each. A stick goes on with the one, within four
//! lengths ahead, to which the way bends least: by the angle from the stick to the line between
//! both, and by that from the line to the other stick. All pairs compete, those that bend least
//! first, and each stick has one before it and one after it at most.
//!
//! Not promised: that a chain stays on one fibre. It may hop to a neighbour that runs the same way,
//! so that its sticks tell more of the direction than the lines between them do: those come from
//! how the sticks were spread.

use glam::DVec2;

use super::sticks::Stick;

/// How far ahead a stick is looked for, in lengths of one.
const AHEAD: f64 = 4.0;
/// The nearest, since two that lie side by side are two fibres.
const NEAREST: f64 = 0.6;
/// The most that a way bends from one stick to the next, radians.
const BENDS: f64 = 0.35;

/// Joins sticks of a length; those that stay alone are left out.
pub(super) fn traced(sticks: &[Stick], length: f64) -> Vec<Vec<Stick>> {
    // Fibres run on along the yarn, so that no chain comes back to its start.
    let onward = |way: DVec2| if way.x < 0.0 { -way } else { way };
    let mut pairs = Vec::new();
    for (from, stick) in sticks.iter().enumerate() {
        for (to, other) in sticks.iter().enumerate() {
            let off = other.middle - stick.middle;
            let is_ahead =
                off.x > 0.0 && off.length() > NEAREST * length && off.length() <= AHEAD * length;
            if is_ahead {
                let bend =
                    onward(stick.way).angle_to(off).abs() + off.angle_to(onward(other.way)).abs();
                pairs.push((bend, from, to));
            }
        }
    }
    pairs.retain(|(bend, _, _)| *bend <= BENDS);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn stick(x: f64, y: f64, degrees: f64) -> Stick {
        Stick { middle: DVec2::new(x, y), way: DVec2::from_angle(degrees.to_radians()) }
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
