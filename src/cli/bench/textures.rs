//! Figure 15 of Liu, Kyosev and Jiang 2022: render time over the size of the yarn's texture.
//!
//! In: a flat fabric. Out: a table and a plot. The paper's figure is a plot without printed values;
//! its text says that the size makes no great difference.

use anyhow::Result;
use image::{Rgba, RgbaImage};
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::render::cloth::{looks, with_cloth};
use warpknit::render::maps::Maps;
use warpknit::render::mips::{MapKind, Mips};
use warpknit::render::scene::{Scene, Shape};

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::measure::Times;
use super::picture::PictureTimer;
use super::plot::{Plot, Series};
use super::table::{BESIDE, TIMES, Table, TableCell, beside, times};

/// Wales and courses of the paper's fabric.
const SIDE: u32 = 10;
/// The paper's St and Sr.
const SECTION: (u32, u32) = (30, 13);
/// Sides of the textures, pixels.
const TEXTURES: [u32; 5] = [128, 256, 512, 1024, 2048];
/// Length of yarn that a texture covers, in thicknesses of the yarn.
const REPEAT: f64 = 4.0;

/// Measures a picture without texture, and with each size of it.
pub(super) fn textures(arguments: &Bench, progress: &mut dyn FnMut(f64)) -> Result<Table> {
    let fabric = Fabric::named(DEFAULT_FABRIC)?;
    let timer = PictureTimer::new(arguments).with_tubes(SECTION.0, SECTION.1);
    let mut table = Table::new(
        "textures",
        "Figure 15: render time over the size of the yarn's texture",
        &["published: the paper's figure is a plot, and its text prints no times; it says that \
             the size makes no great difference."],
        [("texture", "texture"), ("over_none", "over none")],
    );
    let (st, sr) = SECTION;
    table.notes.insert(
        0,
        format!("Flat {DEFAULT_FABRIC} of {SIDE} x {SIDE}, St {st}, Sr {sr}, {}.", timer.note()),
    );
    table.add_columns(TIMES.into_iter().chain(BESIDE));
    let mut plot = Plot::new(
        "Figure 15: textures",
        "pixels each way",
        "time, ms",
        [Series::ours("textured"), Series::ours("without texture")],
    );
    let panel = swatch_panel(&fabric, SIDE, SIDE);
    let cloth = Cloth::swatch(&panel, &fabric, SIDE, SIDE);
    let mut plain = None;
    for (at, side) in std::iter::once(None).chain(TEXTURES.map(Some)).enumerate() {
        progress(at as f64 / (TEXTURES.len() + 1) as f64);
        let maps: Vec<_> = side.map(|side| maps(side, 2.0 * fabric.radius())).into_iter().collect();
        let texture = (!maps.is_empty()).then_some(0);
        let scene = with_cloth(
            &cloth,
            Scene::with_textures(Shape::Tube, looks(&fabric, fabric.radius()), maps, |_| texture),
        );
        let taken = Times::from_samples(&timer.timed(&scene)?);
        // The first picture has no texture, and all others are compared with it.
        let plain = *plain.get_or_insert(taken.wall.median);
        let name = side.map_or_else(|| "none".to_owned(), |side| format!("{side} x {side}"));
        let labels = [TableCell::Text(name), TableCell::Number(taken.wall.median / plain, 2)];
        table.push(labels.into_iter().chain(times(&taken)).chain(beside(None, taken.for_ratio())));
        if let Some(side) = side {
            plot.push(f64::from(side), [taken.wall.median, plain]);
        }
    }
    table.plots.push(plot);
    Ok(table)
}

/// A texture for a yarn `thickness` mm thick. Its colour and surface change from pixel to pixel, so
/// that a cache can't hide the cost of lookups.
fn maps(side: u32, thickness: f64) -> Maps {
    let shade = |x: u32, y: u32| u8::try_from((x * 7 + y * 13) % 96 + 128).expect("below 224");
    let base = RgbaImage::from_fn(side, side, |x, y| Rgba([shade(x, y), shade(y, x), 160, 255]));
    let normal = RgbaImage::from_fn(side, side, |x, y| {
        Rgba([shade(x, y) / 4 + 84, shade(y, x) / 4 + 84, 250, 255])
    });
    let surface = RgbaImage::from_fn(side, side, |x, y| Rgba([255, shade(x, y), 0, 255]));
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let (length, width) = ((REPEAT * thickness) as f32, thickness as f32);
    let (base, normal) = (Mips::new(base, MapKind::Color), Mips::new(normal, MapKind::Normal));
    Maps { base, normal, surface: Mips::new(surface, MapKind::Plain), length, width }
}
