//! What a picture will show where, from the draped triangles alone, before any yarn is knitted.
//!
//! In: a garment and a camera. Out: a [`Silhouette`], a coarse grid over the picture with the nearest
//! cloth in the middle of each cell. Method: a depth buffer of the rays through the middles of cells.
//! Cost: some milliseconds for a garment of 100 000 triangles. Not promised: holes between yarns;
//! cloth is taken as closed.

use glam::{DVec2, DVec3, UVec2};

use crate::garment::Garment;
use crate::render::Camera;

/// Cells along the picture's longer side. Cells are then smaller than the frame of a loupe, and a
/// search over all of them takes no time.
const CELLS: u32 = 200;

/// The nearest cloth in each cell of a grid over a picture.
pub(super) struct Silhouette {
    /// Cells across and down.
    pub(super) size: UVec2,
    /// Side of a cell, pixels.
    pub(super) cell: f64,
    /// Row after row from the top.
    shown: Vec<Option<ShownPoint>>,
}

/// The nearest cloth at a place of the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShownPoint {
    pub(super) panel: usize,
    /// Distance from the eye, mm.
    pub(super) distance: f64,
    /// Unit normal of the side that it shows.
    pub(super) normal: DVec3,
}

/// A draped triangle as it lies in the picture.
struct Projected {
    panel: usize,
    place: [DVec3; 3],
    /// The corners in pixels, y down.
    corners: [DVec2; 3],
}

impl Silhouette {
    /// What the camera sees of a garment in a picture of so many pixels.
    pub(super) fn new(garment: &Garment, camera: &Camera, picture: DVec2) -> Self {
        let cell = (picture.max_element() / f64::from(CELLS)).max(1.0);
        let size = (picture / cell).ceil().max(DVec2::ONE).as_uvec2();
        let mut shown: Vec<Option<ShownPoint>> = vec![None; (size.x * size.y) as usize];
        for triangle in projected(garment, camera, picture) {
            let [low, high] = triangle.bounds();
            let first = (low / cell - 0.5).ceil().max(DVec2::ZERO).as_uvec2();
            // `as_uvec2` saturates at 0, and so does a triangle left of the picture.
            let end = (high / cell + 0.5).floor().max(DVec2::ZERO).as_uvec2().min(size);
            for y in first.y..end.y {
                for x in first.x..end.x {
                    let at = (UVec2::new(x, y).as_dvec2() + 0.5) * cell;
                    nearer(
                        &mut shown[(y * size.x + x) as usize],
                        triangle.at(at, camera.eye(), direction(camera, picture, at)),
                    );
                }
            }
        }
        Self { size, cell, shown }
    }

    /// The nearest cloth in a cell.
    pub(super) fn at(&self, cell: UVec2) -> Option<ShownPoint> {
        self.shown[(cell.y * self.size.x + cell.x) as usize]
    }

    /// The middle of a cell, pixels.
    pub(super) fn middle(&self, cell: UVec2) -> DVec2 {
        (cell.as_dvec2() + 0.5) * self.cell
    }

    /// All cells, row after row.
    pub(super) fn cells(&self) -> impl Iterator<Item = UVec2> + use<> {
        let size = self.size;
        (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec2::new(x, y)))
    }
}

/// The nearest cloth at a place of a picture, pixels from its top left corner.
pub(super) fn shown_at(
    garment: &Garment,
    camera: &Camera,
    picture: DVec2,
    at: DVec2,
) -> Option<ShownPoint> {
    let mut nearest = None;
    for triangle in projected(garment, camera, picture) {
        nearer(&mut nearest, triangle.at(at, camera.eye(), direction(camera, picture, at)));
    }
    nearest
}

/// Direction of the ray through a place of the picture, pixels from its top left corner.
pub(super) fn direction(camera: &Camera, picture: DVec2, at: DVec2) -> DVec3 {
    let DVec2 { x, y } = in_picture(picture, at);
    camera.direction(x, y, picture.x / picture.y)
}

/// A place in pixels as the camera counts: -1 to 1, from the left and from below.
pub(super) fn in_picture(picture: DVec2, at: DVec2) -> DVec2 {
    (at / picture * 2.0 - 1.0) * DVec2::new(1.0, -1.0)
}

/// Whether cloth lies between a place and the sun, farther than `reach` from the place, mm. Method:
/// Möller and Trumbore 1997, 'Fast, minimum storage ray/triangle intersection'.
pub(super) fn is_shadowed(garment: &Garment, place: DVec3, toward_sun: DVec3, reach: f64) -> bool {
    let blocks = |[a, b, c]: [DVec3; 3]| {
        let (ab, ac) = (b - a, c - a);
        let across = toward_sun.cross(ac);
        let scale = ab.dot(across).recip();
        let from = place - a;
        let u = from.dot(across) * scale;
        let along = from.cross(ab);
        let v = toward_sun.dot(along) * scale;
        // A triangle along the ray has an infinite scale, and is not hit.
        u >= 0.0 && v >= 0.0 && u + v <= 1.0 && ac.dot(along) * scale > reach
    };
    garment.panels.iter().any(|panel| {
        let places = |triangle: &[u32; 3]| triangle.map(|vertex| panel.draped[vertex as usize]);
        panel.triangles.iter().any(|triangle| blocks(places(triangle)))
    })
}

/// Keeps the nearer of two.
fn nearer(nearest: &mut Option<ShownPoint>, other: Option<ShownPoint>) {
    if let Some(other) = other
        && nearest.is_none_or(|nearest| other.distance < nearest.distance)
    {
        *nearest = Some(other);
    }
}

/// The draped triangles in front of the eye.
fn projected<'a>(
    garment: &'a Garment,
    camera: &'a Camera,
    picture: DVec2,
) -> impl Iterator<Item = Projected> + 'a {
    let aspect = picture.x / picture.y;
    let to_pixels = move |place| {
        let at = camera.project(place, aspect)?;
        Some((at * DVec2::new(0.5, -0.5) + 0.5) * picture)
    };
    garment.panels.iter().enumerate().flat_map(move |(panel, of)| {
        of.triangles.iter().filter_map(move |triangle| {
            let place = triangle.map(|vertex| of.draped[vertex as usize]);
            let [a, b, c] = place.map(to_pixels);
            Some(Projected { panel, place, corners: [a?, b?, c?] })
        })
    })
}

impl Projected {
    fn bounds(&self) -> [DVec2; 2] {
        let [a, b, c] = self.corners;
        [a.min(b).min(c), a.max(b).max(c)]
    }

    /// What it shows at a place of the picture. `None` beside it.
    fn at(&self, at: DVec2, eye: DVec3, direction: DVec3) -> Option<ShownPoint> {
        let [a, b, c] = self.corners.map(|corner| corner - at);
        let weights = DVec3::new(b.perp_dot(c), c.perp_dot(a), a.perp_dot(b));
        let area = weights.element_sum();
        let is_inside = (weights * area.signum()).min_element() >= 0.0;
        if !is_inside || area == 0.0 {
            return None;
        }
        let [p, q, r] = self.place;
        let normal = (q - p).cross(r - p).normalize_or_zero();
        let distance = (p - eye).dot(normal) / direction.dot(normal);
        if !distance.is_finite() {
            return None;
        }
        let is_turned = normal.dot(eye - p) < 0.0;
        Some(ShownPoint {
            panel: self.panel,
            distance,
            normal: if is_turned { -normal } else { normal },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::View;
    use glam::Vec3;

    #[test]
    fn a_rectangle_faces_its_camera_and_ends_where_it_ends() {
        let garment = Garment::rectangle(200.0, 100.0);
        let corners = [Vec3::ZERO, Vec3::new(200.0, 100.0, 0.0)];
        let picture = DVec2::new(400.0, 300.0);
        let aspect = picture.x / picture.y;
        let camera = Camera::view(View::Front, &corners, Camera::DEFAULT_FOV, 1.0, aspect);
        let silhouette = Silhouette::new(&garment, &camera, picture);
        let (mut inside, mut distances) = (0.0, Vec::new());
        for cell in silhouette.cells() {
            let Some(shown) = silhouette.at(cell) else { continue };
            inside += 1.0;
            assert!(shown.normal.distance(DVec3::Z) < 1e-9, "{cell}");
            distances.push(shown.distance);
            let same = shown_at(&garment, &camera, picture, silhouette.middle(cell)).unwrap();
            assert!((same.distance - shown.distance).abs() < 1e-9);
        }
        // It fills 0.94 of the width, and is half as high as wide.
        let share = inside / f64::from(silhouette.size.x * silhouette.size.y);
        assert!((share - 0.94 * 0.94 * aspect / 2.0).abs() < 0.02, "{share}");
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((nearest / camera.eye().z - 1.0).abs() < 0.01);
        assert!(shown_at(&garment, &camera, picture, DVec2::new(2.0, 150.0)).is_none());
        let behind = DVec3::new(100.0, 50.0, -20.0);
        assert!(is_shadowed(&garment, behind, DVec3::Z, 10.0));
        assert!(!is_shadowed(&garment, behind, DVec3::Z, 30.0));
        assert!(!is_shadowed(&garment, behind, DVec3::X, 10.0));
        assert!(!is_shadowed(&garment, behind + DVec3::Z * 40.0, DVec3::Z, 10.0));
    }
}
