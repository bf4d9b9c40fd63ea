//! Makes the gallery of built-in fabrics: `docs/gallery.md`, and in `docs/gallery/` three pictures of
//! each fabric: of both sides, and as a garment.
//!
//! In: nothing. Out: the files, the same bytes for any number of threads.
//!
//! `cargo run --release --example gallery [FOLDER]`, with `docs` as the default folder.

mod page;
mod picture;
mod worn;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use warpknit::drape::evenness::Evenness;
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::{Fabric, builtin};
use warpknit::photo::yarn::read_maps;
use warpknit::render::View;
use warpknit::render::cloth::{looks, with_cloth};
use warpknit::render::scene::{Scene, Shape};

use crate::picture::Frame;

/// Enlargement of the pictures that compare tubes and ribbons, over those of the fabrics.
const NEARER: f64 = 2.5;

fn main() -> Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("docs"), PathBuf::from);
    let pictures = folder.join("gallery");
    std::fs::create_dir_all(&pictures).with_context(|| pictures.display().to_string())?;
    compare(&pictures)?;
    for name in builtin::names() {
        let fabric = Fabric::named(name)?;
        draw(&pictures, &fabric)?;
        let worn = pictures.join(page::picture_name(name, page::WORN));
        picture::write(&worn, &worn::draw(&fabric)?)?;
    }
    let text = folder.join("gallery.md");
    std::fs::write(&text, page::text()).with_context(|| text.display().to_string())
}

/// Draws both sides of a fabric.
fn draw(folder: &Path, fabric: &Fabric) -> Result<()> {
    let frame = Frame::new(fabric);
    let (wales, courses) = frame.swatch(fabric);
    let panel = swatch_panel(fabric, wales, courses);
    let cloth = Cloth::swatch(&panel, fabric, wales, courses);
    let cloth = cloth.with_spread_yarns(fabric, fabric.radius());
    let looks = looks(fabric, fabric.radius());
    let scene = with_cloth(&cloth, Scene { looks, evenness: Evenness::Uneven, ..Scene::default() });
    both_sides(folder, &fabric.name, &frame, &scene)
}

/// Draws the same cloth of the same yarn as tubes and as ribbons, enlarged so that the fuzz shows.
fn compare(folder: &Path) -> Result<()> {
    let fabric = Fabric::named(page::COMPARED)?;
    let frame = Frame::new(&fabric).nearer(NEARER);
    let (wales, courses) = frame.swatch(&fabric);
    let panel = swatch_panel(&fabric, wales, courses);
    let cloth = Cloth::swatch(&panel, &fabric, wales, courses);
    let yarn = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/yarns").join(page::TEXTURE);
    for (name, shape) in [("tubes", Shape::Tube), ("ribbons", Shape::Ribbon)] {
        let maps = read_maps(&yarn, 2.0 * fabric.radius(), None)?;
        let scene = with_cloth(
            &cloth,
            Scene::with_textures(shape, looks(&fabric, fabric.radius()), vec![maps], |_| Some(0)),
        );
        both_sides(folder, name, &frame, &scene)?;
    }
    Ok(())
}

/// Draws and writes a scene from the front and from the back.
fn both_sides(folder: &Path, name: &str, frame: &Frame, scene: &Scene) -> Result<()> {
    for (side, view) in [("front", View::Front), ("back", View::Back)] {
        picture::write(&folder.join(page::picture_name(name, side)), &frame.draw(scene, view))?;
    }
    Ok(())
}
