//! Writes a swatch into memory in some formats: `cargo run --release --example export`.

use std::io::Cursor;

use warpknit::drape::{Cloth, swatch_panel};
use warpknit::export::{Format, WriteOptions, write};
use warpknit::fabric::Fabric;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let fabric = Fabric::named("hex-net-5")?;
    let panel = swatch_panel(&fabric, 24, 30);
    let cloth = Cloth::swatch(&panel, &fabric, 24, 30);
    for format in [Format::Usda, Format::Bcc, Format::Glb, Format::Ply] {
        let mut file = Cursor::new(Vec::new());
        let written = write(format, &cloth, &fabric, &WriteOptions::default(), &mut file)?;
        let bytes = file.into_inner().len();
        println!("{}: {} strands, {bytes} bytes", format.ending(), written.totals.strands);
    }
    Ok(())
}
