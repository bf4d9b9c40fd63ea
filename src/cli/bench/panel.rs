//! A panel of any number of triangles: a rectangle on a folded cone, as a flared skirt hangs.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3};
use warpknit::garment::{Facts, Garment, Panel};
use warpknit::ids::{FaceId, index32};

/// Size of the flat rectangle, mm.
const SIZE: DVec2 = DVec2::new(1200.0, 700.0);
/// Radius at the waist, and how much wider the cone gets for each mm downward.
const WAIST: f64 = 120.0;
const FLARE: f64 = 0.15;
/// How many folds it hangs in, and how deep they are at the hem over its radius.
const FOLDS: f64 = 9.0;
const DEPTH: f64 = 0.2;
/// How far a vertex is moved from its place in the grid, in cells: triangles of all shapes, but none turned over.
const JITTER: f64 = 0.25;

/// A garment of one such panel of about so many triangles. They are made in no order, as by a remesher, and put in order as they are when a garment is read. The
/// same for the same number.
pub(super) fn folded_cone(triangles: usize) -> Garment {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    // Cells about as wide as high: the rectangle is 12 by 7.
    let across = index32((triangles / 2 * 12 / 7).isqrt()).max(1);
    let along = index32(triangles / 2).div_ceil(across).max(1);
    let uv = grid(across, along, &mut random);
    let draped: Vec<_> = uv.iter().map(|&at| on_cone(at)).collect();
    let triangles = shuffled(across, along, &mut random);
    let normals = normals(&draped, &triangles);
    let faces = (0..index32(triangles.len())).map(FaceId).collect();
    let facts = Facts { triangles: triangles.len(), unit: "mm", uv_scale_mm: 1.0, ..Facts::default() };
    let mut panel = Panel {
        uv,
        draped,
        normals,
        triangles,
        faces,
        flipped: Vec::new(),
        flat_from_panel: DAffine3::IDENTITY,
        mirrored: false,
    };
    panel.order_along_curve();
    Garment { panels: vec![panel], facts }
}

/// Vertices row by row, those on the border in their places.
fn grid(across: u32, along: u32, random: &mut Random) -> Vec<DVec2> {
    let cells = DVec2::new(f64::from(across), f64::from(along));
    let mut jitter = |at: u32, last: u32| if at == 0 || at == last { 0.0 } else { JITTER * random.signed() };
    let mut uv = Vec::new();
    for y in 0..=along {
        for x in 0..=across {
            let moved = DVec2::new(jitter(x, across), jitter(y, along));
            uv.push((DVec2::new(f64::from(x), f64::from(y)) + moved) / cells * SIZE);
        }
    }
    uv
}

/// Two triangles a cell, counter-clockwise, all in no order.
fn shuffled(across: u32, along: u32, random: &mut Random) -> Vec<[u32; 3]> {
    let row = across + 1;
    let corners = (0..along).flat_map(|y| (0..across).map(move |x| y * row + x));
    let mut triangles: Vec<_> =
        corners.flat_map(|low| [[low, low + 1, low + row + 1], [low, low + row + 1, low + row]]).collect();
    for last in (1..index32(triangles.len())).rev() {
        triangles.swap(last as usize, random.below(last + 1) as usize);
    }
    triangles
}

/// The rectangle once around the cone, its lower edge the hem.
fn on_cone(at: DVec2) -> DVec3 {
    let down = SIZE.y - at.y;
    let angle = TAU * at.x / SIZE.x;
    let radius = (WAIST + FLARE * down) * (1.0 + DEPTH * down / SIZE.y * (FOLDS * angle).sin());
    DVec3::new(radius * angle.sin(), at.y, radius * angle.cos())
}

/// Vertex normals, by the areas of the triangles around.
fn normals(draped: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; draped.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|vertex| draped[vertex as usize]);
        let twice_area = (b - a).cross(c - a);
        corners.iter().for_each(|&vertex| normals[vertex as usize] += twice_area);
    }
    normals.into_iter().map(|normal| normal.normalize_or(DVec3::Z)).collect()
}

/// Numbers without a pattern that matters here: Steele's splitmix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        u32::try_from((mixed ^ mixed >> 31) >> 32).expect("half of 64 bits")
    }

    /// -1 to 1.
    fn signed(&mut self) -> f64 {
        2.0 * f64::from(self.next()) / f64::from(u32::MAX) - 1.0
    }

    /// 0 to `end`, without it.
    fn below(&mut self, end: u32) -> u32 {
        u32::try_from((u64::from(self.next()) * u64::from(end)) >> 32).expect("below end")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_covers_its_rectangle_with_triangles_the_right_way_round() {
        for wanted in [2, 2000] {
            let garment = folded_cone(wanted);
            let panel = &garment.panels[0];
            assert!(panel.triangles.len().abs_diff(wanted) * 20 <= wanted, "{} for {wanted}", panel.triangles.len());
            assert!((panel.area() - SIZE.x * SIZE.y).abs() < 1e-6);
            for corners in &panel.triangles {
                let [a, b, c] = corners.map(|vertex| panel.uv[vertex as usize]);
                assert!((b - a).perp_dot(c - a) > 0.0);
            }
        }
        let cone = &folded_cone(2000).panels[0];
        assert!(cone.triangles.windows(2).any(|pair| pair[0] > pair[1]));
        let outward = cone.draped.iter().zip(&cone.normals).filter(|(at, normal)| at.with_y(0.0).dot(**normal) > 0.0).count();
        assert!(outward * 10 > cone.draped.len() * 9, "{outward} of {}", cone.draped.len());
    }
}
