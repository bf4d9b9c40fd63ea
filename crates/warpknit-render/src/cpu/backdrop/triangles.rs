//! The triangles of a surface, sorted by where they lie in a picture.
//!
//! In: a [`Mesh`] and a camera. Out: [`PictureTriangles`], which finds the nearest triangle on a
//! ray from the eye through a given pixel. All rays of a picture start in one point. So a triangle
//! is hit where the ray lies on the inner side of three planes through the eye (Olano and Greer
//! 1997, 'Triangle scan conversion using 2D homogeneous coordinates'). Both triangles at an edge
//! share its plane, so no ray passes between them.
//!
//! Cost: linear in the triangles; then some 50 ns a ray, a fifth of what a tree takes.

use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::cpu::to_f32;
use crate::set::{Mesh, MeshHit};
use crate::{Camera, RenderOptions};

/// Largest side of a square, pixels. In larger ones rays test many triangles that lie elsewhere.
const LARGEST: f32 = 16.0;

/// Triangles in squares of a picture.
pub(super) struct PictureTriangles {
    /// Side of a square, pixels.
    side: u32,
    /// Squares in a row.
    columns: u32,
    /// Where the triangles of each square begin in `triangles`, and where the last ones end.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    planes: Vec<Planes>,
    /// How much farther than it is each triangle counts, seen from its back, mm.
    behind: Vec<f32>,
}

/// A triangle seen from the eye. Its planes are nearly the same where the eye is far away, so they
/// take 64 bits a number.
#[derive(Clone, Copy)]
struct Planes {
    /// Normals of the planes through the eye and the side opposite each corner.
    sides: [DVec3; 3],
    /// Normal of the triangle, and its plane's distance from the eye times the normal's length.
    normal: DVec3,
    offset: f64,
}

impl PictureTriangles {
    /// The triangles of a surface as a camera sees them. `behind` says how much farther a triangle
    /// counts than it is, seen from its back, mm.
    pub(super) fn new(
        surface: &Mesh,
        camera: &Camera,
        options: &RenderOptions,
        behind: impl Fn(usize) -> f32,
    ) -> Self {
        let (places, _) = surface.vertices();
        let eye = camera.eye();
        let pixels: Vec<Option<Vec2>> =
            places.par_iter().map(|place| pixel_of(*place, camera, options)).collect();
        let planes: Vec<Planes> = surface
            .corners()
            .map(|corners| Planes::new(corners.map(|at| at.as_dvec3() - eye)))
            .collect();
        let boxes: Vec<Option<[Vec2; 2]>> = (surface.triangles().par_iter())
            .map(|corners| box_of(corners.map(|vertex| pixels[vertex as usize]), options))
            .collect();
        let sizes = boxes.iter().flatten().map(|[low, high]| (*high - *low).max_element());
        let mean = sizes.sum::<f32>() / boxes.iter().flatten().count().max(1) as f32;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 16")]
        let side = mean.clamp(1.0, LARGEST) as u32;
        let [columns, rows] =
            [options.width, options.height].map(|pixels| pixels.max(1).div_ceil(side));
        let squares = |of: Option<[Vec2; 2]>| {
            of.into_iter().flat_map(move |corners| {
                let [low, high] = corners.map(|corner| corner.as_uvec2() / side);
                (low.y..=high.y)
                    .flat_map(move |row| (low.x..=high.x).map(move |at| row * columns + at))
            })
        };
        let mut starts = vec![0_u32; (columns * rows) as usize + 1];
        boxes.iter().copied().flat_map(squares).for_each(|square| starts[square as usize + 1] += 1);
        for square in 1..starts.len() {
            starts[square] += starts[square - 1];
        }
        let mut next = starts.clone();
        let mut triangles = vec![0; starts[starts.len() - 1] as usize];
        for (triangle, of) in (0..).zip(boxes) {
            for square in squares(of) {
                let next = &mut next[square as usize];
                triangles[*next as usize] = triangle;
                *next += 1;
            }
        }
        let behind = (0..planes.len()).map(behind).collect();
        Self { side, columns, starts, triangles, planes, behind }
    }

    /// The nearest triangle within these distances on a ray from the eye through a place of a
    /// pixel.
    pub(super) fn nearest(
        &self,
        [x, y]: [u32; 2],
        toward: Vec3,
        [least, most]: [f32; 2],
    ) -> Option<MeshHit> {
        let square = (y / self.side * self.columns + x / self.side) as usize;
        let [first, end] = [self.starts[square], self.starts[square + 1]].map(|at| at as usize);
        let toward = toward.as_dvec3();
        let mut nearest: Option<MeshHit> = None;
        for &triangle in &self.triangles[first..end] {
            let planes = &self.planes[triangle as usize];
            let Some((distance, weights)) = planes.hit(toward) else {
                continue;
            };
            let behind = self.behind[triangle as usize];
            let distance = distance + if planes.is_front(toward) { 0.0 } else { behind };
            let most = nearest.map_or(most, |hit| hit.distance);
            if distance >= least && distance < most {
                nearest = Some(MeshHit { distance, triangle: triangle as usize, weights });
            }
        }
        nearest
    }
}

impl Planes {
    /// A triangle with corners relative to the eye.
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let normal = (b - a).cross(c - a);
        Self { sides: [b.cross(c), c.cross(a), a.cross(b)], normal, offset: normal.dot(a) }
    }

    /// Whether a ray meets its front, around which its corners run counter-clockwise.
    fn is_front(&self, toward: DVec3) -> bool {
        self.normal.dot(toward) < 0.0
    }

    /// Distance along a ray from the eye, and the weights of the corners there.
    fn hit(&self, toward: DVec3) -> Option<(f32, [f32; 3])> {
        let sides = self.sides.map(|side| side.dot(toward));
        let is_within =
            sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0);
        let sum: f64 = sides.iter().sum();
        (is_within && sum != 0.0).then(|| {
            let distance = self.offset / self.normal.dot(toward);
            (to_f32(distance), sides.map(|side| to_f32(side / sum)))
        })
    }
}

/// The pixel in which a place appears, with its fraction. `None` behind the eye.
fn pixel_of(place: Vec3, camera: &Camera, options: &RenderOptions) -> Option<Vec2> {
    let at = camera.project(place.as_dvec3(), options.aspect())?;
    let size = DVec2::new(f64::from(options.width), f64::from(options.height));
    Some(((at * DVec2::new(0.5, -0.5) + 0.5) * size).as_vec2())
}

/// Two corners of the pixels that a triangle may lie in: all of them if one of its corners is
/// behind the eye, and `None` outside the picture. Roundings put it less than a pixel further.
fn box_of(corners: [Option<Vec2>; 3], options: &RenderOptions) -> Option<[Vec2; 2]> {
    let size = UVec2::new(options.width, options.height);
    let last = size.saturating_sub(UVec2::ONE).as_vec2();
    let [Some(a), Some(b), Some(c)] = corners else { return Some([Vec2::ZERO, last]) };
    let (low, high) = (a.min(b).min(c) - 1.0, a.max(b).max(c) + 1.0);
    let is_inside = high.cmpge(Vec2::ZERO).all() && low.cmple(size.as_vec2()).all();
    is_inside.then(|| [low, high].map(|corner| corner.clamp(Vec2::ZERO, last)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::soup;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rays_from_the_eye_meet_what_the_tree_finds(
            places in prop::collection::vec(prop::array::uniform3(-10.0..10.0_f32), 3..90),
            eye in prop::array::uniform3(-25.0..25.0_f64),
            pixel in prop::array::uniform2(0..40_u32),
        ) {
            let Some(mesh) = soup(&places) else { return Ok(()) };
            let eye = DVec3::from(eye);
            let camera = Camera::look_at(eye, DVec3::ZERO, 0.9, 1.0);
            let options = RenderOptions { width: 40, height: 40, ..RenderOptions::default() };
            let triangles = PictureTriangles::new(&mesh, &camera, &options, |_| 0.0);
            let [across, up] = options.picture_point(pixel, [0.3, 0.6]);
            let toward = camera.direction(across, up, 1.0).as_vec3();
            let expected = mesh.nearest(eye.as_vec3(), toward);
            let found = triangles.nearest(pixel, toward, [0.0, f32::INFINITY]);
            // On an edge roundings decide.
            let is_clear = |hit: &MeshHit| hit.weights.iter().all(|weight| *weight > 1e-2);
            if expected.iter().chain(&found).all(is_clear) {
                let distance = |hit: Option<MeshHit>| hit.map_or(f32::INFINITY, |hit| hit.distance);
                let (expected, found) = (distance(expected), distance(found));
                let is_near = found == expected || (found / expected - 1.0).abs() < 1e-3;
                prop_assert!(is_near, "{found} {expected}");
            }
        }
    }

    #[test]
    fn no_ray_passes_between_neighbours() {
        // A bent strip of triangles that fills the picture.
        let place = |i: u16, j: u16| {
            [f32::from(i) * 0.7 - 20.0, f32::from(j) * 0.9 - 20.0, f32::from(i * j % 5)]
        };
        let mut places = Vec::new();
        for (i, j) in (0..56).flat_map(|i| (0..44).map(move |j| (i, j))) {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| place(i + x, j + y));
            places.extend([a, b, c, a, c, d]);
        }
        let mesh = soup(&places).unwrap();
        let camera = Camera::look_at(DVec3::new(3.0, 2.0, 60.0), DVec3::ZERO, 0.4, 1.0);
        let options = RenderOptions { width: 90, height: 90, ..RenderOptions::default() };
        let triangles = PictureTriangles::new(&mesh, &camera, &options, |_| 0.0);
        for pixel in (0..90).flat_map(|y| (0..90).map(move |x| [x, y])) {
            let [across, up] = options.picture_point(pixel, [0.5, 0.5]);
            let toward = camera.direction(across, up, 1.0).as_vec3();
            let hit = triangles.nearest(pixel, toward, [0.0, f32::INFINITY]);
            assert!(hit.is_some(), "{pixel:?}");
        }
    }
}
