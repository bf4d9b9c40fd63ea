//! Cloth so far away that no pixel shows a stitch: a surface that looks as its yarns do on average.
//!
//! In: a draped garment and its fabric. Out: [`AveragedCloth`], the draped surface with the
//! direction of its wales, and a flat piece of the cloth, yarn by yarn, whose appearance the
//! surface takes on (`cpu/averaged`). A picture of it costs time by its pixels and not by its
//! stitches, and has no moiré, because nothing in it is finer than a pixel.
//!
//! [`share`] says how much of a picture is drawn this way. It is faded in where a whole repeat gets
//! smaller than two and a half pixels, and is all of the picture below two. A tent filter leaves
//! little of such a pattern but moiré.
//!
//! Not promised: yarns' unevenness along the cloth, and the cloth's stretch on the body, of which
//! the mean alone could be seen.

use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::cloth::{self, repeat_size};
use crate::light::SKY_REACH_RADII;
use crate::scene::{Bounds, Scene};
use crate::set::Mesh;
use crate::{Camera, RenderOptions};
use warpknit_core::drape::{Cloth, swatch_panel};
use warpknit_core::fabric::Fabric;
use warpknit_core::garment::{Garment, Panel};
use warpknit_core::ids::index32;
use warpknit_core::knit::Pattern;
use warpknit_core::map::Mapping;
use warpknit_core::number::narrow;

/// Pixels that the longer side of a repeat takes: from the second on yarns alone are drawn, and up
/// to the first their average alone.
const FADE: [f64; 2] = [2.0, 2.5];
/// Wales and courses of the area whose places stand for all of the cloth, at least. Uneven cloth
/// has no two stitches alike.
const AREA_STITCHES: f64 = 6.0;
/// Stitches of a repeat at most. Yarns of a larger one cost as much as those of the garment.
const MOST_STITCHES: usize = 10_000;
/// Field of view of the camera for which the piece is prepared, radians.
const FIELD: f64 = 0.02;
/// Lowest height of rays above the cloth, as a sine. Flatter ones would need a larger piece of it.
pub(crate) const FLATTEST: f32 = 0.17;

/// Cloth as a surface that looks as its yarns do on average.
#[derive(Debug)]
pub struct AveragedCloth {
    /// The draped surface. The technical face is in front.
    pub(crate) surface: Mesh,
    /// Direction of the wales at each vertex, of any length.
    pub(crate) wales: Vec<Vec3>,
    /// Whether a vertex is of cloth that a finished edge turns in.
    is_turned_in: Vec<bool>,
    /// Mean side of its triangles, mm.
    pub(crate) side: f32,
    /// Half the distance between both faces of the cloth, mm.
    pub(crate) half_depth: f32,
    /// A flat piece of the cloth, with its technical face toward +z.
    pub(crate) piece: Scene,
    /// Two corners of the part of it that stands for all of the cloth.
    pub(crate) area: [Vec2; 2],
    /// The camera and the options for which the piece is prepared. A pixel is as wide as half a
    /// yarn.
    pub(crate) camera: Camera,
    pub(crate) options: RenderOptions,
}

impl AveragedCloth {
    /// The cloth of a garment. `looks` is an empty scene with the fabric's looks. `None` for a
    /// garment without area, and for a fabric with a repeat of over 10 000 stitches.
    #[must_use]
    pub fn new(
        garment: &Garment,
        fabric: &Fabric,
        pattern: &Pattern,
        looks: &Scene,
    ) -> Option<Self> {
        if fabric.threading_repeat() * fabric.repeat() > MOST_STITCHES {
            return None;
        }
        let (mut positions, mut normals, mut wales) = (Vec::new(), Vec::new(), Vec::new());
        let (mut triangles, mut is_turned_in) = (Vec::new(), Vec::new());
        for panel in &garment.panels {
            let first = index32(positions.len());
            positions.extend(panel.draped.iter().map(|place| place.as_vec3()));
            normals.extend(panel.normals.iter().map(|normal| normal.as_vec3()));
            wales.extend(wales_of(panel));
            is_turned_in.resize(positions.len(), panel.turned_in.is_some());
            triangles.extend(panel.triangles.iter().map(|corners| corners.map(|at| first + at)));
        }
        let surface = Mesh::new(positions, normals, &triangles)?;
        let looks = looks_of_bars(fabric, looks);
        let thickest = looks.looks.iter().map(|look| look.radius).fold(0.0, f32::max);
        let (piece, area) = flat_piece(fabric, pattern, looks, f64::from(thickest));
        let [low, high] = pattern.depths();
        let half_depth = narrow(0.5 * (high - low)) + thickest;
        let options = RenderOptions::default();
        let camera = distant_camera(area, f64::from(thickest), options.height);
        let side = mean_side(&surface);
        Some(Self { surface, wales, is_turned_in, side, half_depth, piece, area, camera, options })
    }

    /// Whether a triangle of the surface is of cloth that a finished edge turns in.
    pub(crate) fn is_turned_in(&self, triangle: usize) -> bool {
        self.is_turned_in[self.surface.triangles()[triangle][0] as usize]
    }
}

/// Mean side of a surface's triangles, mm.
fn mean_side(surface: &Mesh) -> f32 {
    let (places, _) = surface.vertices();
    let side = |[a, b, _]: &[u32; 3]| places[*a as usize].distance(places[*b as usize]);
    let sum: f64 = surface.triangles().iter().map(|corners| f64::from(side(corners))).sum();
    narrow(sum / f64::from(index32(surface.triangles().len())))
}

/// Share of a picture, 0 to 1, that is drawn as averaged cloth, of a fabric within `extent`.
#[must_use]
pub fn share(fabric: &Fabric, extent: &Bounds, camera: &Camera, options: &RenderOptions) -> f32 {
    let distance = camera.eye().distance(extent.centre().as_dvec3());
    let pixels = repeat_size(fabric).max_element() / camera.pixel_size(distance, options.height);
    narrow(((FADE[1] - pixels) / (FADE[1] - FADE[0])).clamp(0.0, 1.0))
}

/// The direction of the wales at each vertex of a panel: the mean over its triangles of the way
/// that a step up the flat panel takes on the body.
fn wales_of(panel: &Panel) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; panel.draped.len()];
    for corners in &panel.triangles {
        let [a, b, c] = corners.map(|vertex| panel.uv[vertex as usize]);
        let [from, one, other] = corners.map(|vertex| panel.draped[vertex as usize]);
        let (flat_one, flat_other) = (b - a, c - a);
        let twice_area = flat_one.perp_dot(flat_other);
        if twice_area != 0.0 {
            // Twice the area times the derivative along v, so that large triangles count more.
            let along = (other - from) * flat_one.x - (one - from) * flat_other.x;
            corners.iter().for_each(|&vertex| sums[vertex as usize] += along);
        }
    }
    sums.into_iter().map(|sum| sum.as_vec3()).collect()
}

/// An empty scene with the looks of a fabric's bars alone, and not those of sewing threads.
fn looks_of_bars(fabric: &Fabric, looks: &Scene) -> Scene {
    let mut looks = Scene { extent: None, ..looks.clone() };
    looks.looks.truncate(fabric.yarn_systems());
    looks
}

/// A flat piece of a fabric, and two corners of a part of whole repeats that has cloth all around
/// it.
fn flat_piece(
    fabric: &Fabric,
    pattern: &Pattern,
    looks: Scene,
    thickest: f64,
) -> (Scene, [Vec2; 2]) {
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    let repeat = repeat_size(fabric);
    let area = (spacing * AREA_STITCHES / repeat).ceil() * repeat;
    // From a place of the area a ray goes to a yarn, and from there another one to the sky.
    let reach = 2.0 * f64::from(SKY_REACH_RADII) * thickest;
    let lapping = f64::from(fabric.structure.widest_lapping());
    let margin = DVec2::splat(reach) + spacing * DVec2::new(lapping + 2.0, 2.0);
    let stitches = ((area + margin * 2.0) / spacing).ceil();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some hundreds")]
    let [wales, courses] = [stitches.x as u32, stitches.y as u32];
    let panel = swatch_panel(fabric, wales, courses);
    let [low, high] = panel.panels[0].bounds();
    let laid = Cloth::swatch_with(&panel, fabric, pattern.clone(), [wales, courses]);
    // It is its own drape, so no strain has to be looked up.
    let piece = cloth::with_mapped(&laid, looks, Mapping::Smooth);
    let middle = low.midpoint(high);
    let corners = [middle - area / 2.0, middle + area / 2.0].map(|corner| corner.as_vec2());
    (piece, corners)
}

/// A camera so far above an area that a pixel is everywhere about `pixel` mm wide there.
fn distant_camera([low, high]: [Vec2; 2], pixel: f64, height: u32) -> Camera {
    let middle = low.midpoint(high).extend(0.0).as_dvec3();
    let camera = |distance: f64| Camera::look_at(middle + DVec3::Z * distance, middle, FIELD, 1.0);
    camera(pixel / camera(1.0).pixel_size(1.0, height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averaged_cloth_fades_in_below_two_and_a_half_pixels_a_repeat() {
        // Two courses of a locknit are the longer side of its repeat.
        let fabric = Fabric::named("locknit").unwrap();
        let repeat = 2.0 * fabric.course_spacing();
        assert!(repeat > fabric.wale_spacing());
        let extent = Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE };
        let options = RenderOptions { height: 1000, ..RenderOptions::default() };
        let of = |pixels: f64| {
            let at = |distance: f64| Camera::look_at(DVec3::Z * distance, DVec3::ZERO, 0.5, 1.0);
            let distance = repeat / pixels / at(1.0).pixel_size(1.0, options.height);
            share(&fabric, &extent, &at(distance), &options)
        };
        for (pixels, expected) in [(1.0, 1.0), (1.99, 1.0), (2.25, 0.5), (2.51, 0.0), (9.0, 0.0)] {
            assert!((of(pixels) - expected).abs() < 1e-3, "{pixels}: {}", of(pixels));
        }
    }

    #[test]
    fn wales_follow_the_cloth() {
        let garment = Garment::rectangle(30.0, 40.0);
        let wales = wales_of(&garment.panels[0]);
        assert!(wales.iter().all(|wale| wale.normalize().distance(Vec3::Y) < 1e-6));
    }
}
