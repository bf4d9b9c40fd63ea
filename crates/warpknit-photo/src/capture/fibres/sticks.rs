//! Short straight pieces of fibre, spread evenly over a copy of a segment.
//!
//! In: a mask of the places with clear fibres, and their directions. Out: [`Stick`]s.
//!
//! Method: farthest-point sampling (Eldar, Lindenbaum, Porat and Zeevi 1997, *The farthest point
//! strategy for progressive image sampling*). Each stick goes where the distance to the mask's
//! border and to all sticks so far is largest, until no place is farther than some distance.
//!
//! Cost: a search over all pixels for each stick, and an update near it. Not promised: exact
//! distances to the border. The chamfer distance is up to 8 % too long, which moves sticks and
//! changes no direction.

use glam::DVec2;

use crate::plane::{Plane, double, narrow, whole};

/// A piece of a fibre, in pixels of its plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stick {
    pub(super) middle: DVec2,
    /// Of unit length.
    pub(super) direction: DVec2,
}

/// Fills the places where the mask isn't 0 with sticks of a length, until none is farther than
/// `apart` from the border and from all sticks.
pub(super) fn filled(
    mask: &Plane,
    direction: impl Fn(usize, usize) -> DVec2,
    length: f64,
    apart: f64,
) -> Vec<Stick> {
    let mut distances = chamfer_distances(mask);
    let mut sticks = Vec::new();
    loop {
        // Of equal distances the first one, so that the result is always the same.
        let farthest = (0..distances.values.len())
            .max_by(|&a, &b| distances.values[a].total_cmp(&distances.values[b]).then(b.cmp(&a)));
        let Some(at) = farthest.filter(|&at| f64::from(distances.values[at]) > apart) else {
            return sticks;
        };
        let most = f64::from(distances.values[at]);
        let (x, y) = (at % mask.width, at / mask.width);
        let stick = Stick { middle: DVec2::new(double(x), double(y)), direction: direction(x, y) };
        lower_distances(&mut distances, &stick, length, most);
        // A direction that is not a number lowers nothing, and the loop would not end.
        distances.values[at] = 0.0;
        sticks.push(stick);
    }
}

/// Distance of each place to where the mask is 0 and to the outside: the two-pass chamfer transform
/// (Borgefors 1986, *Distance transformations in digital images*).
fn chamfer_distances(mask: &Plane) -> Plane {
    let (width, height) = (mask.width, mask.height);
    let mut distances = mask.map(|value| if value > 0.0 { f32::INFINITY } else { 0.0 });
    // Forward, each place looks at its four neighbours before it; backward, at those after it.
    for y in 0..height {
        for x in 0..width {
            relax_from_neighbours(&mut distances, x, y, -1);
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            relax_from_neighbours(&mut distances, x, y, 1);
        }
    }
    distances
}

/// Lowers a distance to that by way of the four neighbours on one side: `step` is -1 for the
/// neighbours to the left and above, and 1 for the others.
fn relax_from_neighbours(distances: &mut Plane, x: usize, y: usize, step: isize) {
    let diagonal = std::f32::consts::SQRT_2;
    let nearest = [
        distance_at(distances, x.checked_add_signed(step), Some(y)) + 1.0,
        distance_at(distances, Some(x), y.checked_add_signed(step)) + 1.0,
        distance_at(distances, x.checked_add_signed(step), y.checked_add_signed(step)) + diagonal,
        distance_at(distances, x.checked_add_signed(-step), y.checked_add_signed(step)) + diagonal,
    ];
    let least = nearest.into_iter().fold(distances.at(x, y), f32::min);
    distances.values[y * distances.width + x] = least;
}

/// The distance at a place; 0 outside.
fn distance_at(distances: &Plane, x: Option<usize>, y: Option<usize>) -> f32 {
    match (x, y) {
        (Some(x), Some(y)) if x < distances.width && y < distances.height => distances.at(x, y),
        _ => 0.0,
    }
}

/// Lowers distances to those from a stick. None is over `most`, so that only places near the stick
/// are visited.
fn lower_distances(distances: &mut Plane, stick: &Stick, length: f64, most: f64) {
    let reach = most + 0.5 * length;
    let [first, last] = [stick.middle - reach, stick.middle + reach]
        .map(|at| at.max(DVec2::ZERO).to_array().map(|at| whole(narrow(at))));
    for y in first[1]..(last[1] + 1).min(distances.height) {
        for x in first[0]..(last[0] + 1).min(distances.width) {
            let offset = DVec2::new(double(x), double(y)) - stick.middle;
            let along = offset.dot(stick.direction).clamp(-0.5 * length, 0.5 * length);
            let value = &mut distances.values[y * distances.width + x];
            *value = value.min(narrow((offset - stick.direction * along).length()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_to_the_border_and_to_holes() {
        let distances =
            chamfer_distances(&Plane::from_fn(
                21,
                11,
                |x, y| if (x, y) == (15, 5) { 0.0 } else { 1.0 },
            ));
        assert_eq!(
            [(0, 0), (5, 5), (20, 5), (15, 5), (14, 5), (13, 5)].map(|(x, y)| distances.at(x, y)),
            [1.0, 6.0, 1.0, 0.0, 1.0, 2.0]
        );
    }

    #[test]
    fn sticks_leave_no_place_far_and_are_not_near_each_other() {
        let mask = Plane::from_fn(80, 50, |_, _| 1.0);
        let direction = DVec2::from_angle(0.3);
        let sticks = filled(&mask, |_, _| direction, 12.0, 3.0);
        assert!(
            sticks[0].middle.distance(DVec2::new(39.5, 24.5)) < 16.0,
            "the first is in the middle of the strip: {:?}",
            sticks[0]
        );
        let apart = |place: DVec2, stick: &Stick| {
            let off = place - stick.middle;
            (off - direction * off.dot(direction).clamp(-6.0, 6.0)).length()
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
        assert!(filled(&mask.map(|_| 0.0), |_, _| direction, 12.0, 3.0).is_empty());
    }
}
