//! Short straight pieces of fibre, spread evenly over a copy of a segment.
//!
//! In: a mask of where fibres are seen, and their directions. Out: [`Stick`]s. Farthest-point
//! filling: each stick is put where the distance to the mask's border and to all sticks before is
//! largest, until none is farther than some distance. Cost: pixels by sticks, at worst; near a
//! stick only.
//!
//! Not promised: exact distances to the border. Steps along rows, columns and diagonals make them
//! up to 8 % too long, which moves sticks and no direction.

use glam::DVec2;

use crate::plane::{Plane, double, narrow, whole};

/// A piece of a fibre, in pixels of its plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stick {
    pub(super) middle: DVec2,
    /// Of unit length.
    pub(super) way: DVec2,
}

/// Fills what isn't 0 in the mask with sticks of a length until no place is farther than `apart`
/// from the border and from all of them.
pub(super) fn filled(
    mask: &Plane,
    way: impl Fn(usize, usize) -> DVec2,
    length: f64,
    apart: f64,
) -> Vec<Stick> {
    let mut distances = distances(mask);
    let mut sticks = Vec::new();
    loop {
        let farthest = (0..distances.values.len())
            .max_by(|&a, &b| distances.values[a].total_cmp(&distances.values[b]).then(b.cmp(&a)));
        let Some(at) = farthest.filter(|&at| f64::from(distances.values[at]) > apart) else {
            return sticks;
        };
        let most = f64::from(distances.values[at]);
        let (x, y) = (at % mask.width, at / mask.width);
        let stick = Stick { middle: DVec2::new(double(x), double(y)), way: way(x, y) };
        lower(&mut distances, &stick, length, most);
        // Whatever its direction is, this place is taken.
        distances.values[at] = 0.0;
        sticks.push(stick);
    }
}

/// How far each place is from where the mask is 0, and from outside.
fn distances(mask: &Plane) -> Plane {
    let (width, height) = (mask.width, mask.height);
    let mut distances = mask.map(|value| if value > 0.0 { f32::INFINITY } else { 0.0 });
    let diagonal = std::f32::consts::SQRT_2;
    let mut sweep = |x: usize, y: usize, back: bool| {
        let step = |at: usize| if back { Some(at + 1) } else { at.checked_sub(1) };
        let other = |at: usize| if back { at.checked_sub(1) } else { Some(at + 1) };
        let inside = |x: Option<usize>, y: Option<usize>| match (x, y) {
            (Some(x), Some(y)) if x < width && y < height => distances.at(x, y),
            _ => 0.0,
        };
        let nearest = [
            inside(step(x), Some(y)) + 1.0,
            inside(Some(x), step(y)) + 1.0,
            inside(step(x), step(y)) + diagonal,
            inside(other(x), step(y)) + diagonal,
        ];
        let least = nearest.into_iter().fold(distances.at(x, y), f32::min);
        distances.values[y * width + x] = least;
    };
    (0..height).for_each(|y| (0..width).for_each(|x| sweep(x, y, false)));
    (0..height).rev().for_each(|y| (0..width).rev().for_each(|x| sweep(x, y, true)));
    distances
}

/// Lowers distances to those from a stick. None is over `most`.
fn lower(distances: &mut Plane, stick: &Stick, length: f64, most: f64) {
    let reach = most + 0.5 * length;
    let [first, last] = [stick.middle - reach, stick.middle + reach]
        .map(|at| at.max(DVec2::ZERO).to_array().map(|at| whole(narrow(at))));
    for y in first[1]..(last[1] + 1).min(distances.height) {
        for x in first[0]..(last[0] + 1).min(distances.width) {
            let off = DVec2::new(double(x), double(y)) - stick.middle;
            let along = off.dot(stick.way).clamp(-0.5 * length, 0.5 * length);
            let value = &mut distances.values[y * distances.width + x];
            *value = value.min(narrow((off - stick.way * along).length()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_to_the_border_and_to_holes() {
        let distances =
            distances(&Plane::from_fn(21, 11, |x, y| if (x, y) == (15, 5) { 0.0 } else { 1.0 }));
        assert_eq!(
            [(0, 0), (5, 5), (20, 5), (15, 5), (14, 5), (13, 5)].map(|(x, y)| distances.at(x, y)),
            [1.0, 6.0, 1.0, 0.0, 1.0, 2.0]
        );
    }

    #[test]
    fn sticks_leave_no_place_far_and_are_not_near_each_other() {
        let mask = Plane::from_fn(80, 50, |_, _| 1.0);
        let way = DVec2::from_angle(0.3);
        let sticks = filled(&mask, |_, _| way, 12.0, 3.0);
        assert!(
            sticks[0].middle.distance(DVec2::new(39.5, 24.5)) < 16.0,
            "the first is in the middle of the strip: {:?}",
            sticks[0]
        );
        let apart = |place: DVec2, stick: &Stick| {
            let off = place - stick.middle;
            (off - way * off.dot(way).clamp(-6.0, 6.0)).length()
        };
        for (number, stick) in sticks.iter().enumerate() {
            assert!(
                sticks[..number].iter().all(|before| apart(stick.middle, before) > 3.0),
                "{stick:?}"
            );
        }
        let places =
            (4..46).flat_map(|y| (4..76).map(move |x| DVec2::new(f64::from(x), f64::from(y))));
        places.for_each(|place| {
            assert!(sticks.iter().any(|stick| apart(place, stick) <= 3.0 + 1e-5), "{place}");
        });
        assert!(filled(&mask.map(|_| 0.0), |_, _| way, 12.0, 3.0).is_empty());
    }
}
