//! Memory of pictures and sizes of files, estimated before they are made.
//!
//! In: a planned [`Cloth`] and its fabric. Out: bytes. All figures are bytes for each data point,
//! ring of a tube, vertex, triangle or pixel, measured in 2026-11 and 2026-12 with seven fabrics on
//! two garments. Checked within a third against files and runs in `tests/it/estimates.rs`. Not
//! promised: files of fibres, and the sun's shadow map of a garment from near (up to 0.1 GB).

use super::settings::Settings;
use crate::drape::fibres::bundles;
use crate::drape::{Cloth, DrapeOptions};
use crate::export::Format;
use crate::fabric::Fabric;
use crate::garment::Garment;
use crate::ids::index32;
use crate::render::scene::{Bounds, Scene, Shape};
use crate::render::{Camera, RenderOptions, RendererChoice, hairs};
use crate::system::address_space_gb;
use crate::yarn::fibres::FIBRE_RADIUS;
use crate::yarn::tube::Section;

/// Memory of a run that draws nothing.
const PROGRAM: f64 = 35e6;
/// Memory of a pixel with its samples.
const PIXEL: f64 = 80.0;
/// The same where yarns are drawn as coverage masks, which are held for a few rows at a time.
const MASK_PIXEL: f64 = 10.0;
/// Memory of a data point's share of the lists of pieces that are drawn as masks, and of the room
/// that a growing scene keeps.
const MASK_POINT: f64 = 3.5;
/// Memory of a data point in a scene.
const POINT: f64 = 13.5;
/// The same on a graphics adapter of software, with the copies made while uploading.
const GPU_POINT: f64 = 60.0;
/// Memory of a triangle of averaged cloth, and of its light.
const SURFACE_TRIANGLE: f64 = 400.0;
/// Address space that a graphics driver of software maps with its compiler, which counts where
/// address space is limited.
const DRIVER: f64 = 2e9;
/// Memory of a stitch while it is swept.
const SWEPT: f64 = 7000.0;
/// Memory of a piece of yarn that rays are traced against, with its share of the tree.
const PIECE: f64 = 55.0;
/// Memory of the light of a tube's piece: its stretch's number, and a stretch for each piece.
const TUBE_PIECE: f64 = 24.0;
/// Memory of the edges of a ribbon's piece.
const RIBBON_PIECE: f64 = 24.0;
/// Pieces between two data points where none are merged, as a mean over bends and straight runs.
const PIECES: f64 = 1.65;

/// Number of data points of a cloth.
pub(super) fn points(cloth: &Cloth<'_>, fabric: &Fabric) -> f64 {
    let pattern = cloth.pattern();
    let of_bar = |bar| {
        let across = pattern.runs_across(bar);
        let steps = if across { fabric.threading_repeat() } else { fabric.repeat() };
        let points = f64::from(index32(pattern.points_per_repeat(bar)));
        float(cloth.stitches_of_bar(bar)) * points / f64::from(index32(steps))
    };
    (0..fabric.yarn_systems()).map(of_bar).sum()
}

/// Bytes of a file of a cloth, or `None` for pictures, reports and pages. `section` is that of its
/// tubes.
pub(super) fn file_bytes(
    format: Format,
    cloth: &Cloth<'_>,
    fabric: &Fabric,
    section: &Section,
    settings: &Settings,
) -> Option<f64> {
    let stitches = float(cloth.stitches());
    let (st, sr) = (f64::from(section.st), f64::from(section.sr));
    // A ring repeats its first vertex at the texture's seam.
    let (rings, vertices) = (stitches * st, stitches * st * (sr + 1.0));
    let triangles = 2.0 * stitches * st * sr;
    Some(match format {
        // Pages are compressed, to a tenth where all stitches are alike.
        Format::Png | Format::Json | Format::Html => return None,
        Format::Glb if settings.glb.is_compressed => return None,
        // With floats and textures twice as much.
        Format::Glb => 12.0 * stitches * st * sr + 6.0 * triangles,
        Format::Ply => 35.0 * vertices + 13.0 * triangles,
        Format::Obj => 90.0 * vertices + 54.0 * triangles,
        Format::ObjLines => 40.0 * rings,
        Format::Bcc => 12.1 * rings,
        Format::Curves => 34.0 * rings,
        Format::Inp => 52.0 * rings,
        Format::Usda => 116.0 * points(cloth, fabric),
        Format::Usdc => 45.0 * points(cloth, fabric),
        // How far arrays can be compressed depends on the cloth.
        Format::Npz if settings.npz.is_compressed => return None,
        Format::Npz if settings.npz.is_single => 66.0 * points(cloth, fabric),
        Format::Npz => 115.0 * points(cloth, fabric),
        Format::Csv => 200.0 * points(cloth, fabric),
    })
}

/// Bytes of memory that a run needs to draw a cloth. `scene` is empty, and `cameras` are those of
/// its pictures. `laying` are the options with which it is laid.
pub(super) fn picture_bytes(
    cloth: &Cloth<'_>,
    fabric: &Fabric,
    scene: &Scene,
    cameras: &[Camera],
    laying: &DrapeOptions,
    options: &RenderOptions,
) -> f64 {
    let points = points(cloth, fabric);
    // Yarns are swept before anything is drawn.
    let swept = SWEPT * float(cloth.swept_together(laying));
    PROGRAM
        + POINT * points
        + swept.max(drawing_bytes(cloth, fabric, scene, cameras, points, options))
}

/// Bytes of memory that the surface of averaged cloth takes besides.
pub(super) fn averaged_bytes(garment: &Garment) -> f64 {
    let triangles: usize = garment.panels.iter().map(|panel| panel.triangles.len()).sum();
    SURFACE_TRIANGLE * f64::from(index32(triangles))
}

/// The part of it for drawing a scene of so many data points.
fn drawing_bytes(
    cloth: &Cloth<'_>,
    fabric: &Fabric,
    scene: &Scene,
    cameras: &[Camera],
    points: f64,
    options: &RenderOptions,
) -> f64 {
    let rows = f64::from(index32(options.rows().len()));
    let pixels = f64::from(options.width) * rows;
    if options.renderer == RendererChoice::Gpu {
        let driver = if address_space_gb().is_some() { DRIVER } else { 0.0 };
        return driver + PIXEL * pixels + GPU_POINT * points;
    }
    if has_masks(scene, scene.extent, cameras, options) {
        return MASK_PIXEL * pixels + MASK_POINT * points;
    }
    // A loop goes up and down its course and over to its wale.
    let stitch = 2.0 * (fabric.wale_spacing() + 2.0 * fabric.course_spacing());
    let spans = points / float(cloth.stitches()).max(1.0);
    let step = stitch / spans.max(1.0);
    let pixel = smallest_pixel(scene.extent, cameras, options);
    let pieces = if options.lod && step < pixel {
        // Shorter ones are merged.
        points * step / pixel
    } else {
        points * PIECES
    };
    // Hairs show on yarns from eight pixels wide. No more of these fit into a picture, four deep.
    let shown = (points * step).min(0.5 * pixels * pixel);
    let bundles = bundles(fabric, fabric.radius(), FIBRE_RADIUS);
    let piece = match scene.shape {
        Shape::Tube => PIECE + TUBE_PIECE,
        Shape::Ribbon => PIECE + RIBBON_PIECE,
    };
    PIXEL * pixels + piece * pieces + hairs::bytes(&bundles, shown, pixel)
}

/// Whether the processor draws all these pictures of a scene within `extent` without noise, as
/// coverage masks: of tubes, in pixels larger than [`Scene::mask_pixel`].
pub(super) fn has_masks(
    scene: &Scene,
    extent: Option<Bounds>,
    cameras: &[Camera],
    options: &RenderOptions,
) -> bool {
    let is_far = smallest_pixel(extent, cameras, options) > f64::from(scene.mask_pixel());
    options.lod && scene.shape == Shape::Tube && is_far
}

/// Size of a pixel where a box comes nearest to an eye, mm.
fn smallest_pixel(extent: Option<Bounds>, cameras: &[Camera], options: &RenderOptions) -> f64 {
    let Some(Bounds { min, max }) = extent else { return 0.0 };
    let middle = min.midpoint(max).as_dvec3();
    let radius = f64::from(min.distance(max)) / 2.0;
    let pixel = |camera: &Camera| {
        let nearest = camera.eye().distance(middle) - radius;
        camera.pixel_size(nearest.max(0.0), options.height)
    };
    cameras.iter().map(pixel).fold(f64::INFINITY, f64::min)
}

/// A size that a person reads: `94 MB`, `1.3 GB`, `40 GB`.
pub(super) fn size_text(bytes: f64) -> String {
    match bytes {
        bytes if bytes < 1e6 => "under 1 MB".to_owned(),
        bytes if bytes < 9.95e6 => format!("{:.1} MB", bytes / 1e6),
        bytes if bytes < 995e6 => format!("{:.0} MB", bytes / 1e6),
        bytes if bytes < 9.95e9 => format!("{:.1} GB", bytes / 1e9),
        bytes => format!("{:.0} GB", bytes / 1e9),
    }
}

/// A count for arithmetic.
pub(super) fn float(count: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let count = count as f64;
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_at_a_glance() {
        for (bytes, text) in [
            (3e3, "under 1 MB"),
            (1.54e6, "1.5 MB"),
            (94.4e6, "94 MB"),
            (999e6, "1.0 GB"),
            (1.34e9, "1.3 GB"),
            (4.05e10, "40 GB"),
        ] {
            assert_eq!(size_text(bytes), text);
        }
    }
}
