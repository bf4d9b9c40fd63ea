//! Triangulation of an outline, as irregular as that of a pattern tool.
//!
//! In: the outline's points, counter-clockwise and evenly spaced, and that spacing. Out: the
//! outline's points, unmoved and first, then inner points, and counter-clockwise triangles over
//! them.
//!
//! Method: inner points start on a jittered hexagonal grid and are moved by Laplacian smoothing
//! between Delaunay triangulations (Bowyer 1981, "Computing Dirichlet tessellations"; Watson 1981,
//! "Computing the n-dimensional Delaunay tessellation"), swept in x so that finished triangles are
//! not tested again. Predicates are exact (Shewchuk 1997, "Adaptive precision floating-point
//! arithmetic and fast robust geometric predicates").
//!
//! Not promised: outlines with a corner under about 30 degrees, or with a neck narrower than twice
//! the spacing. `triangulate` panics if an edge of the outline is missing from the result.

use glam::DVec2;
use robust::{Coord, incircle, orient2d};

/// Largest shift of a start point from its place in the grid, in spacings.
const JITTER: f64 = 0.28;
/// Least distance of a start point from the outline, in spacings. Less than 0.6 gives flat
/// triangles along the outline, more than 0.8 long ones.
const CLEARANCE: f64 = 0.7;
/// Rounds of smoothing. More than a dozen rounds would comb the irregularity out again.
const ROUNDS: usize = 6;

/// A pseudo-random number in -1..1 that depends only on the two given (SplitMix64's finaliser).
pub(crate) fn noise(seed: u64, index: u64) -> f64 {
    let mut bits = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ index.wrapping_add(1).wrapping_mul(0xD1B5_4A32_D192_ED03);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    let high = u32::try_from((bits ^ (bits >> 31)) >> 32).expect("32 bits remain");
    f64::from(high) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// Fills the outline with triangles. Returns all points, the outline's first, and the triangles.
pub(crate) fn triangulate(
    outline: &[DVec2],
    spacing: f64,
    seed: u64,
) -> (Vec<DVec2>, Vec<[u32; 3]>) {
    let mut points = outline.to_vec();
    points.extend(inner_points(outline, spacing, seed));
    let mut triangles = inside_only(outline, &points, delaunay(&points), spacing);
    for _ in 0..ROUNDS {
        smooth(&mut points, &triangles, outline.len());
        triangles = inside_only(outline, &points, delaunay(&points), spacing);
    }
    assert_eq!(
        outline_edges(&triangles, outline.len()),
        outline.len(),
        "every edge of the outline is an edge of a triangle"
    );
    (points, triangles)
}

fn inner_points(outline: &[DVec2], spacing: f64, seed: u64) -> Vec<DVec2> {
    let low = outline.iter().copied().fold(DVec2::MAX, DVec2::min);
    let size = outline.iter().copied().fold(DVec2::MIN, DVec2::max) - low;
    let pitch = DVec2::new(spacing, spacing * 0.75_f64.sqrt());
    let cells = (size / pitch).ceil().as_u64vec2();
    let mut points = Vec::new();
    for row in 0..=cells.y {
        for column in 0..=cells.x {
            let index = 2 * (row * (cells.x + 1) + column);
            let shift = if row % 2 == 0 { 0.0 } else { 0.5 };
            let place = glam::U64Vec2::new(column, row).as_dvec2() + DVec2::new(shift, 0.0);
            let stray = DVec2::new(noise(seed, index), noise(seed, index + 1)) * JITTER * spacing;
            let point = low + place * pitch + stray;
            if contains(outline, point) && distance_to(outline, point) > CLEARANCE * spacing {
                points.push(point);
            }
        }
    }
    points
}

fn edges(outline: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> {
    outline.iter().copied().zip(outline.iter().copied().cycle().skip(1))
}

/// Whether the outline contains a point, by the even-odd rule.
fn contains(outline: &[DVec2], point: DVec2) -> bool {
    let crosses = |(a, b): &(DVec2, DVec2)| {
        (a.y > point.y) != (b.y > point.y)
            && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    edges(outline).filter(crosses).count() % 2 == 1
}

/// The distance from a point to the outline.
fn distance_to(outline: &[DVec2], point: DVec2) -> f64 {
    let to_edge = |(a, b): (DVec2, DVec2)| {
        let t = ((point - a).dot(b - a) / a.distance_squared(b)).clamp(0.0, 1.0);
        point.distance(a.lerp(b, t))
    };
    edges(outline).map(to_edge).fold(f64::INFINITY, f64::min)
}

/// One round of Laplacian smoothing: moves each inner point to the mean of its neighbours. The
/// outline's points, which come first, stay.
fn smooth(points: &mut [DVec2], triangles: &[[u32; 3]], fixed: usize) {
    let mut sums = vec![(DVec2::ZERO, 0.0); points.len()];
    for triangle in triangles {
        for corner in 0..3 {
            let sum = &mut sums[triangle[corner] as usize];
            sum.0 += points[triangle[(corner + 1) % 3] as usize]
                + points[triangle[(corner + 2) % 3] as usize];
            sum.1 += 2.0;
        }
    }
    for (point, (sum, count)) in points.iter_mut().zip(sums).skip(fixed) {
        *point = sum / count;
    }
}

/// Drops the triangles outside the outline, and the flat ones between outline points that lie in
/// one line.
fn inside_only(
    outline: &[DVec2],
    points: &[DVec2],
    mut triangles: Vec<[u32; 3]>,
    spacing: f64,
) -> Vec<[u32; 3]> {
    triangles.retain(|triangle| {
        let [a, b, c] = triangle.map(|corner| points[corner as usize]);
        let all_on_outline = triangle.iter().all(|&corner| (corner as usize) < outline.len());
        let flat = (b - a).perp_dot(c - a) < 1e-3 * spacing * spacing;
        !all_on_outline || (!flat && contains(outline, (a + b + c) / 3.0))
    });
    triangles
}

/// The number of the outline's edges among the triangles' sides.
fn outline_edges(triangles: &[[u32; 3]], count: usize) -> usize {
    let follows = |a: u32, b: u32| (a as usize) < count && (a as usize + 1) % count == b as usize;
    triangles
        .iter()
        .map(|&[a, b, c]| [(a, b), (b, c), (c, a)].iter().filter(|&&(a, b)| follows(a, b)).count())
        .sum()
}

/// A triangle that later points may still change, and the x beyond which no point can lie in its
/// circumcircle.
struct Open {
    corners: [u32; 3],
    reach: f64,
}

impl Open {
    fn new(corners: [u32; 3], points: &[DVec2]) -> Self {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let (ab, ac) = (b - a, c - a);
        let centre = (ac.perp() * ab.length_squared() - ab.perp() * ac.length_squared())
            / (-2.0 * ab.perp_dot(ac));
        // A little is added for rounding. A flat triangle's circumcentre is not finite, and the
        // triangle stays open.
        let reach = a.x + centre.x + centre.length() * (1.0 + 1e-9);
        Self { corners, reach: if reach.is_finite() { reach } else { f64::INFINITY } }
    }
}

/// The Delaunay triangulation (Bowyer and Watson). Among cocircular points one of the possible
/// triangulations is chosen.
fn delaunay(points: &[DVec2]) -> Vec<[u32; 3]> {
    let count =
        u32::try_from(points.len()).expect("a panel has fewer than four thousand million points");
    let mut all = points.to_vec();
    all.extend([DVec2::new(-3e4, -2e4), DVec2::new(3e4, -2e4), DVec2::new(0.0, 4e4)]);
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_by(|&i, &j| all[i as usize].x.total_cmp(&all[j as usize].x).then(i.cmp(&j)));
    // Points come in the order of x. A triangle whose circumcircle lies left of the sweep line
    // can't be hit any more and is closed.
    let mut open = vec![Open::new([count, count + 1, count + 2], &all)];
    let mut closed = Vec::new();
    for index in order {
        let point = all[index as usize];
        let mut cavity: Vec<[u32; 2]> = Vec::new();
        open.retain(|triangle| {
            if triangle.reach < point.x {
                closed.push(triangle.corners);
                return false;
            }
            let [a, b, c] = triangle.corners;
            let hit = in_circle(&all, triangle.corners, point);
            if hit {
                cavity.extend([[a, b], [b, c], [c, a]]);
            }
            !hit
        });
        for &[a, b] in &cavity {
            // An edge that two triangles of the cavity share lies inside the cavity and vanishes.
            // The point is joined to the edges of its border.
            if !cavity.contains(&[b, a]) {
                open.push(Open::new([a, b, index], &all));
            }
        }
    }
    closed.extend(open.into_iter().map(|triangle| triangle.corners));
    closed.retain(|corners| {
        corners.iter().all(|&corner| corner < count) && is_proper(points, *corners)
    });
    closed
}

/// A point as the predicates take it.
fn coord(point: DVec2) -> Coord<f64> {
    Coord { x: point.x, y: point.y }
}

/// Whether a point lies inside a triangle's circumcircle.
fn in_circle(points: &[DVec2], corners: [u32; 3], point: DVec2) -> bool {
    let [a, b, c] = corners.map(|corner| coord(points[corner as usize]));
    incircle(a, b, c, coord(point)) > 0.0
}

/// Whether a triangle is counter-clockwise and not flat.
fn is_proper(points: &[DVec2], corners: [u32; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| coord(points[corner as usize]));
    orient2d(a, b, c) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn l_shape() -> Vec<DVec2> {
        let corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 4.0), (4.0, 4.0), (4.0, 12.0), (0.0, 12.0)];
        let corners = corners.map(|(x, y)| DVec2::new(x, y));
        let side = |(a, b): (DVec2, DVec2)| {
            (0..crate::pattern::segments(a.distance(b), 0.5))
                .map(move |i| a.move_towards(b, 0.5 * f64::from(i)))
        };
        edges(&corners).flat_map(side).collect()
    }

    #[test]
    fn the_triangles_fill_the_outline_and_none_is_a_sliver() {
        let (points, triangles) = triangulate(&l_shape(), 0.5, 1);
        let mut area = 0.0;
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|corner| points[corner as usize]);
            let double = (b - a).perp_dot(c - a);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            assert!(double / (longest * longest) > 0.3, "a sliver at {a}");
            area += 0.5 * double;
        }
        assert!((area - 72.0).abs() < 1e-9, "{area}");
    }

    #[test]
    fn no_point_lies_in_a_circumcircle() {
        let points: Vec<DVec2> =
            (0..60).map(|i| DVec2::new(noise(7, 2 * i), noise(7, 2 * i + 1))).collect();
        for corners in delaunay(&points) {
            assert!(points.iter().all(|&point| !in_circle(&points, corners, point)));
        }
    }

    #[test]
    fn noise_stays_in_range_and_repeats() {
        assert!((0..1000).all(|index| noise(3, index).abs() <= 1.0));
        assert_eq!(noise(3, 5).to_bits(), noise(3, 5).to_bits());
    }
}
