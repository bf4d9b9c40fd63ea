//! Makes the gallery of built-in fabrics: `docs/gallery.md` and a picture of each side of each in `docs/gallery/`.
//!
//! In: nothing. Out: the same bytes for any number of threads.
//!
//! `cargo run --release --example gallery [FOLDER]`, with `docs` as the default folder.

mod page;
mod picture;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use warpknit::drape::picture::swatch;
use warpknit::fabric::{Fabric, builtin};
use warpknit::render::View;

use crate::picture::Frame;

fn main() -> Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("docs"), PathBuf::from);
    let pictures = folder.join("gallery");
    std::fs::create_dir_all(&pictures).with_context(|| pictures.display().to_string())?;
    for name in builtin::names() {
        draw(&pictures, &Fabric::named(name)?)?;
    }
    let text = folder.join("gallery.md");
    std::fs::write(&text, page::text()).with_context(|| text.display().to_string())
}

/// Both sides of a fabric.
fn draw(folder: &Path, fabric: &Fabric) -> Result<()> {
    let frame = Frame::of(fabric);
    let (wales, courses) = frame.swatch(fabric);
    let scene = swatch(fabric, wales, courses);
    for (side, view) in [("front", View::Front), ("back", View::Back)] {
        let name = page::picture_name(&fabric.name, side);
        picture::write(&folder.join(name), &frame.draw(&scene, view))?;
    }
    Ok(())
}
