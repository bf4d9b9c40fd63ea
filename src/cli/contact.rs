//! The contact sheet of a developed photo: photo, mask, unit, maps, the unit three times in a row, and a swatch knitted with it.

use anyhow::Result;
use glam::DVec2;
use image::imageops::{self, FilterType};
use image::{DynamicImage, GrayImage, RgbImage, Rgba, RgbaImage};
use warpknit::chart::{Anchor, Drawing, Layer, Shape as Mark, TextSize, png};
use warpknit::drape::{self, Block, Cloth, picture};
use warpknit::fabric::Fabric;
use warpknit::fabric::yarn::Color;
use warpknit::photo::develop::Developed;
use warpknit::render::maps::Maps;
use warpknit::render::{Camera, Options, View, render};
use warpknit::scene::Shape;

use super::args::DEFAULT_FABRIC;
use super::pictures::{self, Textures};

/// Width of the yarn's picture where nothing says it, mm: any will do, the swatch's yarn is as wide as its loops let it.
pub(super) const SWATCH_YARN_WIDTH: f64 = 1.0;
/// Wales and courses of the swatch.
const SWATCH: (u32, u32) = (5, 5);
/// Width of the sheet and room around its pictures, pixels.
const SHEET: u32 = 1600;
const GAP: u32 = 20;
/// Height of a label.
const LABEL: u32 = 28;
/// Heights of the three rows of pictures.
const ROWS: [u32; 3] = [360, 220, 480];
/// Pixels that the lapping diagram's painter makes of one px.
const PAINTED: f64 = 2.0;

/// A picture with its name, and how many columns of its row it takes.
struct Cell {
    label: &'static str,
    picture: RgbaImage,
    columns: u32,
}

/// A swatch of ribbons that wear these maps, the yarn without its fuzz as thick as the fabric's.
pub(super) fn swatch(mut maps: Maps, yarn: &Developed, progress: &(dyn Fn(f32) + Sync)) -> Result<RgbaImage> {
    let fabric = Fabric::named(DEFAULT_FABRIC)?;
    let (wales, courses) = SWATCH;
    let panel = drape::swatch_panel(&fabric, wales, courses);
    let cloth = Cloth::swatch(&panel, &fabric, wales, courses);
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let width = (2.0 * fabric.radius() * f64::from(yarn.base.height()) / yarn.yarn_width) as f32;
    maps.length *= width / maps.width;
    maps.width = width;
    let mut scene = pictures::scene(Shape::Ribbon, picture::looks(&fabric, fabric.radius()), &Textures::for_all(maps), 1.0);
    let mut deliver = |blocks: &[Block]| -> Result<()> {
        blocks.iter().for_each(|block| picture::add_to(&mut scene, block));
        Ok(())
    };
    drape::run(&cloth, &drape::Options::default(), &mut |_, _| {}, &mut deliver)?;
    let options = Options { width: column_width(2), height: ROWS[2], spp: 2, ..Options::default() };
    let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, options.aspect());
    Ok(render(&scene, &camera, &options, progress)?)
}

/// The sheet.
pub(super) fn sheet(photo: &RgbImage, yarn: &Developed, swatch: &RgbaImage) -> RgbaImage {
    let grey = |picture: &GrayImage| DynamicImage::from(picture.clone()).into_rgba8();
    let height = DynamicImage::from(yarn.surface.height.clone()).into_rgba8();
    let cell = |label, picture, columns| Cell { label, picture, columns };
    let rows = [
        vec![
            cell("photo", small(photo, column_width(2), ROWS[0]), 2),
            cell("mask", fitted(&grey(&yarn.mask), column_width(2), ROWS[0]), 2),
        ],
        [
            ("unit", on_checks(&yarn.base)),
            ("height", height),
            ("normal", yarn.surface.normal.clone()),
            ("roughness", grey(&yarn.surface.roughness)),
            ("metallic", grey(&yarn.surface.metallic)),
            ("occlusion", grey(&yarn.surface.occlusion)),
        ]
        .map(|(label, picture)| cell(label, fitted(&picture, column_width(6), ROWS[1]), 6))
        .into(),
        vec![
            cell("the unit three times", fitted(&on_checks(&in_a_row(&yarn.base)), column_width(2), ROWS[2]), 2),
            cell("a swatch of it", swatch.clone(), 2),
        ],
    ];
    let mut sheet = png::paint(&labels(&rows));
    for (row, top) in rows.iter().zip(tops()) {
        for (cell, at) in row.iter().zip(0..) {
            let left = GAP + at * (column_width(cell.columns) + GAP);
            imageops::overlay(&mut sheet, &cell.picture, i64::from(left), i64::from(top + LABEL));
        }
    }
    sheet
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
    for (row, top) in rows.iter().zip(tops()) {
        for (cell, at) in row.iter().zip(0..) {
            let left = GAP + at * (column_width(cell.columns) + GAP);
            let baseline = DVec2::new(f64::from(left), f64::from(top + LABEL - 8)) / PAINTED;
            shapes.push(Mark::Text { at: baseline, text: cell.label.to_owned(), size: TextSize::Small, anchor: Anchor::Start });
        }
    }
    let size = DVec2::new(f64::from(SHEET), f64::from(tops()[2] + LABEL + ROWS[2] + GAP)) / PAINTED;
    let layer = Layer { name: "labels".to_owned(), color: Color([40; 3]), shapes };
    Drawing { size, layers: vec![layer], notes: Vec::new() }
}

/// A picture as large as a cell holds it, larger too; texels stay squares.
fn fitted(picture: &RgbaImage, width: u32, height: u32) -> RgbaImage {
    let (from, to) = (picture.dimensions(), fitting(picture.dimensions(), width, height));
    let filter = if to.0 > from.0 { FilterType::Nearest } else { FilterType::Triangle };
    imageops::resize(picture, to.0, to.1, filter)
}

/// A large photo, made smaller without a large copy.
fn small(photo: &RgbImage, width: u32, height: u32) -> RgbaImage {
    let (width, height) = fitting(photo.dimensions(), width, height);
    DynamicImage::from(imageops::thumbnail(photo, width, height)).into_rgba8()
}

fn fitting(size: (u32, u32), width: u32, height: u32) -> (u32, u32) {
    let scale = (f64::from(width) / f64::from(size.0)).min(f64::from(height) / f64::from(size.1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the cell")]
    let scaled = |side: u32| ((f64::from(side) * scale) as u32).max(1);
    (scaled(size.0), scaled(size.1))
}

fn in_a_row(unit: &RgbaImage) -> RgbaImage {
    RgbaImage::from_fn(3 * unit.width(), unit.height(), |x, y| *unit.get_pixel(x % unit.width(), y))
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
        assert_eq!(in_a_row(&unit).get_pixel(23, 1).0[0], 3);
        assert_eq!(on_checks(&unit).get_pixel(3, 1).0, [3, 0, 0, 255]);
    }
}
