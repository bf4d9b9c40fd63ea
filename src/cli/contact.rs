//! The contact sheet of a developed yarn photo: photo, mask, one repeat, its maps, the repeat
//! tiled, and a swatch of loops that use it as a texture.
//!
//! In: the photo and [`Developed`]. Out: a picture [`SHEET`] pixels wide. A repeat is often narrow:
//! it and its maps are tiled along the yarn until they fill their cell.

use anyhow::Result;
use glam::DVec2;
use image::imageops::{self, FilterType};
use image::{DynamicImage, GrayImage, ImageBuffer, Pixel, RgbImage, Rgba, RgbaImage};
use warpknit::chart::{Anchor, Drawing, DrawingLayer, DrawingShape, TextSize, png};
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::fabric::yarn::Color;
use warpknit::photo::yarn::develop::Developed;
use warpknit::render::cloth;
use warpknit::render::maps::Maps;
use warpknit::render::scene::Shape;
use warpknit::render::{Camera, RenderOptions, View, render};

use warpknit::pipeline::{self, Textures};

/// Width of the yarn where it is unknown, mm. Any value serves: the swatch scales its yarn to the
/// loops.
pub(super) const SWATCH_YARN_WIDTH: f64 = 1.0;
/// The fabric of the swatch: plain loops, few and from the front, so that the yarn is visible and
/// not only the fabric.
const FABRIC: &str = "jersey";
/// Wales and courses of the swatch.
const SWATCH: (u32, u32) = (4, 3);
/// Width of the sheet, pixels.
const SHEET: u32 = 1600;
/// Space around the pictures, pixels.
const GAP: u32 = 20;
/// Height of a label, pixels.
const LABEL: u32 = 28;
/// Heights of the three rows of pictures, pixels.
const ROWS: [u32; 3] = [360, 220, 480];
/// Pixels of the sheet for each px of a drawing in `chart::png`.
const PIXELS_PER_PX: f64 = 2.0;

/// A picture with its label and the width of its cell.
struct SheetCell {
    label: &'static str,
    picture: RgbaImage,
    width: u32,
}

/// A swatch of ribbons with these maps as texture. The yarn without its fuzz is as thick as the
/// fabric's own yarn.
pub(super) fn swatch(
    mut maps: Maps,
    yarn: &Developed,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<RgbaImage> {
    let fabric = Fabric::named(FABRIC)?;
    let (wales, courses) = SWATCH;
    let panel = swatch_panel(&fabric, wales, courses);
    let cloth = Cloth::swatch(&panel, &fabric, wales, courses);
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let width = (2.0 * fabric.radius() * f64::from(yarn.base.height()) / yarn.yarn_width) as f32;
    // The length is scaled with the width, so that the texture keeps its aspect ratio.
    maps.length *= width / maps.width;
    maps.width = width;
    let empty = pipeline::scene(Shape::Ribbon, &fabric, fabric.radius(), &Textures::for_all(maps));
    let scene = cloth::with_cloth(&cloth, empty);
    // A front view with few rays: the sheet is an overview, not a rendering.
    let options = RenderOptions {
        width: column_width(2),
        height: ROWS[2],
        spp: 2,
        sky_rays: 1,
        ..RenderOptions::default()
    };
    let camera =
        Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, options.aspect());
    Ok(render(&scene, &camera, &options, progress)?)
}

/// The sheet: three rows of pictures with their labels.
pub(super) fn sheet(photo: &RgbImage, yarn: &Developed, swatch: &RgbaImage) -> RgbaImage {
    let height = DynamicImage::from(yarn.surface.height.clone()).into_rgba8();

    // First row: the photo in its own width, and the mask in the rest.
    let half = column_width(2);
    let photo = small(photo, half, ROWS[0]);
    let (left, right) = (photo.width(), SHEET - 3 * GAP - photo.width());

    let rows = [
        vec![
            SheetCell { label: "photo", picture: photo, width: left },
            SheetCell { label: "mask", picture: small(&yarn.mask, right, ROWS[0]), width: right },
        ],
        [
            ("unit", on_checks(&yarn.base)),
            ("height", height),
            ("normal", yarn.surface.normal.clone()),
            ("roughness", rgba(&yarn.surface.roughness)),
            ("metallic", rgba(&yarn.surface.metallic)),
            ("occlusion", rgba(&yarn.surface.occlusion)),
        ]
        .map(|(label, picture)| {
            let width = column_width(6);
            SheetCell { label, picture: tiled(&picture, 1, width, ROWS[1]), width }
        })
        .into(),
        vec![
            SheetCell {
                label: "the unit again and again",
                picture: tiled(&on_checks(&yarn.base), 3, half, ROWS[2]),
                width: half,
            },
            SheetCell { label: "a swatch of it", picture: swatch.clone(), width: half },
        ],
    ];
    let mut sheet = png::paint(&labels(&rows));
    for (cell, left, top) in places(&rows) {
        imageops::overlay(&mut sheet, &cell.picture, i64::from(left), i64::from(top + LABEL));
    }
    sheet
}

/// A grey picture in colours.
fn rgba(picture: &GrayImage) -> RgbaImage {
    DynamicImage::from(picture.clone()).into_rgba8()
}

/// The cells, each with its left and top.
fn places(rows: &[Vec<SheetCell>; 3]) -> impl Iterator<Item = (&SheetCell, u32, u32)> {
    rows.iter().zip(tops()).flat_map(|(row, top)| {
        row.iter().scan(GAP, move |left, cell| {
            let begin = *left;
            *left += cell.width + GAP;
            Some((cell, begin, top))
        })
    })
}

/// The tops of the rows. A row's labels come first.
fn tops() -> [u32; 3] {
    let second = GAP + LABEL + ROWS[0] + GAP;
    [GAP, second, second + LABEL + ROWS[1] + GAP]
}

/// Width of a column if the sheet has this number of equal columns.
fn column_width(columns: u32) -> u32 {
    (SHEET - GAP * (columns + 1)) / columns
}

/// The sheet with only the labels.
fn labels(rows: &[Vec<SheetCell>; 3]) -> Drawing {
    let mut shapes = Vec::new();
    for (cell, left, top) in places(rows) {
        let baseline = DVec2::new(f64::from(left), f64::from(top + LABEL - 8)) / PIXELS_PER_PX;
        shapes.push(DrawingShape::Text {
            at: baseline,
            text: cell.label.to_owned(),
            size: TextSize::Small,
            anchor: Anchor::Start,
        });
    }
    let size =
        DVec2::new(f64::from(SHEET), f64::from(tops()[2] + LABEL + ROWS[2] + GAP)) / PIXELS_PER_PX;
    let layer = DrawingLayer { name: "labels".to_owned(), color: Color([40; 3]), shapes };
    Drawing { size, layers: vec![layer], notes: Vec::new() }
}

/// A picture scaled to fit a cell. Reducing needs no full-size copy; enlarging keeps texels square,
/// so that they can be inspected.
fn small<P>(picture: &ImageBuffer<P, Vec<u8>>, width: u32, height: u32) -> RgbaImage
where
    P: Pixel<Subpixel = u8> + 'static,
    DynamicImage: From<ImageBuffer<P, Vec<u8>>>,
{
    let (from, to) = (picture.dimensions(), fitting(picture.dimensions(), width, height));
    let fitted = if to.0 > from.0 {
        imageops::resize(picture, to.0, to.1, FilterType::Nearest)
    } else {
        imageops::thumbnail(picture, to.0, to.1)
    };
    DynamicImage::from(fitted).into_rgba8()
}

/// A repeat tiled until it fills a cell's width, at least `least` times.
fn tiled(unit: &RgbaImage, least: u32, width: u32, height: u32) -> RgbaImage {
    let unit = small(unit, width / least, height);
    RgbaImage::from_fn(width, unit.height(), |x, y| *unit.get_pixel(x % unit.width(), y))
}

/// The largest size with the same aspect ratio that fits into a cell.
fn fitting(size: (u32, u32), width: u32, height: u32) -> (u32, u32) {
    let scale = (f64::from(width) / f64::from(size.0)).min(f64::from(height) / f64::from(size.1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the cell")]
    let [width, height] = [size.0, size.1].map(|side| ((f64::from(side) * scale) as u32).max(1));
    (width, height)
}

/// A picture in front of a checkerboard, which shows its transparency.
fn on_checks(picture: &RgbaImage) -> RgbaImage {
    let side = (picture.height() / 12).max(1);
    RgbaImage::from_fn(picture.width(), picture.height(), |x, y| {
        let behind = if (x / side + y / side).is_multiple_of(2) { 210_u32 } else { 150 };
        let Rgba([r, g, b, a]) = *picture.get_pixel(x, y);
        let [r, g, b] = [r, g, b].map(|value| over(value, behind, a));
        Rgba([r, g, b, u8::MAX])
    })
}

/// A colour value over an opaque one (the operator "over" of Porter and Duff, Compositing digital
/// images, 1984), rounded.
fn over(value: u8, behind: u32, alpha: u8) -> u8 {
    let sum = u32::from(value) * u32::from(alpha) + behind * (255 - u32::from(alpha));
    u8::try_from((sum + 127) / 255).unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_fit_their_cells_and_keep_their_shape() {
        assert_eq!(fitting((100, 50), 300, 300), (300, 150));
        assert_eq!(fitting((8000, 6000), 770, 360), (480, 360));
        assert_eq!(fitting((10_000, 1), 100, 100), (100, 1));
        let unit = RgbaImage::from_fn(10, 4, |x, _| Rgba([u8::try_from(x).unwrap(), 0, 0, 255]));
        let filled = tiled(&unit, 1, 90, 12);
        assert_eq!((filled.dimensions(), filled.get_pixel(3 * 23 + 1, 1).0[0]), ((90, 12), 3));
        assert_eq!(tiled(&unit, 3, 10, 12).dimensions(), (10, 1));
        assert_eq!(on_checks(&unit).get_pixel(3, 1).0, [3, 0, 0, 255]);
    }
}
