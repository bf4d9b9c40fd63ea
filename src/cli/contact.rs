//! The contact sheet of a developed photo: photo, mask, unit, maps, the unit following itself, and
//! some loops knitted with it.
//!
//! Units are often narrow: they and their maps are drawn again and again along the yarn until their
//! place is filled.

use anyhow::Result;
use glam::DVec2;
use image::imageops::{self, FilterType};
use image::{DynamicImage, GrayImage, ImageBuffer, Pixel, RgbImage, Rgba, RgbaImage};
use warpknit::chart::{Anchor, Drawing, Layer, Shape as Mark, TextSize, png};
use warpknit::drape::{self, Block, Cloth, picture};
use warpknit::fabric::Fabric;
use warpknit::fabric::yarn::Color;
use warpknit::photo::develop::Developed;
use warpknit::render::maps::Maps;
use warpknit::render::{Camera, RenderOptions, View, render};
use warpknit::scene::Shape;

use super::pictures::{self, Textures};

/// Width of the yarn's picture where nothing says it, mm: any will do, the swatch's yarn is as wide
/// as its loops let it.
pub(super) const SWATCH_YARN_WIDTH: f64 = 1.0;
/// What the swatch shows: plain loops, few and from their front, so that the yarn is seen and not
/// only the fabric.
const FABRIC: &str = "jersey";
/// Wales and courses of the swatch.
const SWATCH: (u32, u32) = (4, 3);
/// Width of the sheet and room around its pictures, pixels.
const SHEET: u32 = 1600;
const GAP: u32 = 20;
/// Height of a label.
const LABEL: u32 = 28;
/// Heights of the three rows of pictures.
const ROWS: [u32; 3] = [360, 220, 480];
/// Pixels that the lapping diagram's painter makes of one px.
const PAINTED: f64 = 2.0;

/// A picture with its name and the width that is its own.
struct Cell {
    label: &'static str,
    picture: RgbaImage,
    width: u32,
}

/// A swatch of ribbons that wear these maps, the yarn without its fuzz as thick as the fabric's.
pub(super) fn swatch(
    mut maps: Maps,
    yarn: &Developed,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<RgbaImage> {
    let fabric = Fabric::named(FABRIC)?;
    let (wales, courses) = SWATCH;
    let panel = drape::swatch_panel(&fabric, wales, courses);
    let cloth = Cloth::swatch(&panel, &fabric, wales, courses);
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let width = (2.0 * fabric.radius() * f64::from(yarn.base.height()) / yarn.yarn_width) as f32;
    maps.length *= width / maps.width;
    maps.width = width;
    let mut scene =
        pictures::scene(Shape::Ribbon, &fabric, fabric.radius(), &Textures::for_all(maps));
    let mut deliver = |blocks: &[Block]| -> Result<()> {
        blocks.iter().for_each(|block| picture::add_to(&mut scene, block));
        Ok(())
    };
    drape::run(&cloth, &drape::Options::default(), &mut |_, _| {}, &mut deliver)?;
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

/// The sheet.
pub(super) fn sheet(photo: &RgbImage, yarn: &Developed, swatch: &RgbaImage) -> RgbaImage {
    let grey = |picture: &GrayImage| DynamicImage::from(picture.clone()).into_rgba8();
    let height = DynamicImage::from(yarn.surface.height.clone()).into_rgba8();
    let cell = |label, picture, width| Cell { label, picture, width };
    let half = column_width(2);
    let photo = small(photo, half, ROWS[0]);
    let (left, right) = (photo.width(), SHEET - 3 * GAP - photo.width());
    let map = |(label, picture): (_, RgbaImage)| {
        cell(label, tiled(&picture, 1, column_width(6), ROWS[1]), column_width(6))
    };
    let rows = [
        vec![cell("photo", photo, left), cell("mask", small(&yarn.mask, right, ROWS[0]), right)],
        [
            ("unit", on_checks(&yarn.base)),
            ("height", height),
            ("normal", yarn.surface.normal.clone()),
            ("roughness", grey(&yarn.surface.roughness)),
            ("metallic", grey(&yarn.surface.metallic)),
            ("occlusion", grey(&yarn.surface.occlusion)),
        ]
        .map(map)
        .into(),
        vec![
            cell("the unit again and again", tiled(&on_checks(&yarn.base), 3, half, ROWS[2]), half),
            cell("a swatch of it", swatch.clone(), half),
        ],
    ];
    let mut sheet = png::paint(&labels(&rows));
    for (cell, left, top) in places(&rows) {
        imageops::overlay(&mut sheet, &cell.picture, i64::from(left), i64::from(top + LABEL));
    }
    sheet
}

/// The cells with where they begin.
fn places(rows: &[Vec<Cell>; 3]) -> impl Iterator<Item = (&Cell, u32, u32)> {
    rows.iter().zip(tops()).flat_map(|(row, top)| {
        row.iter().scan(GAP, move |left, cell| {
            let begin = *left;
            *left += cell.width + GAP;
            Some((cell, begin, top))
        })
    })
}

/// Where the rows begin, labels first.
fn tops() -> [u32; 3] {
    let next = |top: u32, row: u32| top + LABEL + row + GAP;
    let second = next(GAP, ROWS[0]);
    [GAP, second, next(second, ROWS[1])]
}

fn column_width(columns: u32) -> u32 {
    (SHEET - GAP * (columns + 1)) / columns
}

/// The empty sheet with the names of its pictures.
fn labels(rows: &[Vec<Cell>; 3]) -> Drawing {
    let mut shapes = Vec::new();
    for (cell, left, top) in places(rows) {
        let baseline = DVec2::new(f64::from(left), f64::from(top + LABEL - 8)) / PAINTED;
        shapes.push(Mark::Text {
            at: baseline,
            text: cell.label.to_owned(),
            size: TextSize::Small,
            anchor: Anchor::Start,
        });
    }
    let size = DVec2::new(f64::from(SHEET), f64::from(tops()[2] + LABEL + ROWS[2] + GAP)) / PAINTED;
    let layer = Layer { name: "labels".to_owned(), color: Color([40; 3]), shapes };
    Drawing { size, layers: vec![layer], notes: Vec::new() }
}

/// A picture as large as a cell holds it, made smaller without a large copy; made larger, its
/// texels stay squares.
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

/// A unit as often as it takes to fill a cell's width, and `least` times.
fn tiled(unit: &RgbaImage, least: u32, width: u32, height: u32) -> RgbaImage {
    let unit = small(unit, width / least, height);
    RgbaImage::from_fn(width, unit.height(), |x, y| *unit.get_pixel(x % unit.width(), y))
}

fn fitting(size: (u32, u32), width: u32, height: u32) -> (u32, u32) {
    let scale = (f64::from(width) / f64::from(size.0)).min(f64::from(height) / f64::from(size.1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the cell")]
    let scaled = |side: u32| ((f64::from(side) * scale) as u32).max(1);
    (scaled(size.0), scaled(size.1))
}

/// A picture in front of light and dark squares, as transparency is shown.
fn on_checks(picture: &RgbaImage) -> RgbaImage {
    let side = (picture.height() / 12).max(1);
    RgbaImage::from_fn(picture.width(), picture.height(), |x, y| {
        let behind = if (x / side + y / side).is_multiple_of(2) { 210_u32 } else { 150 };
        let Rgba([r, g, b, a]) = *picture.get_pixel(x, y);
        let mixed = |value: u8| {
            let sum = u32::from(value) * u32::from(a) + behind * (255 - u32::from(a));
            u8::try_from((sum + 127) / 255).unwrap_or(u8::MAX)
        };
        Rgba([mixed(r), mixed(g), mixed(b), u8::MAX])
    })
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
