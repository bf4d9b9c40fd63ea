//! Knits a fabric onto a shipped skirt, and writes files: `cargo run --release --example drape`.

use std::path::Path;

use warpknit::export::Format;
use warpknit::fabric::Fabric;
use warpknit::garment::{ReadOptions, read};
use warpknit::pipeline::{Clock, Settings, Source, drape};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let draped = meshes.join("skirt_draped.obj");
    let garment = read(&meshes.join("skirt_flat.obj"), Some(&draped), &ReadOptions::default())?;
    let settings = Settings {
        outputs: vec![("skirt.png".into(), Format::Png), ("skirt.glb".into(), Format::Glb)],
        ..Settings::default()
    };
    let (fabric, source) = (Fabric::named("locknit")?, Source::default());
    let done = drape(garment, None, &fabric, &source, &settings, Clock::start(&()))?;
    for part in done.parts {
        println!("{} stitches: {}", part.totals.losses.stitches, part.files);
    }
    Ok(())
}
