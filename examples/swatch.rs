//! Draws a lapping and prints its numbers: `cargo run --release --example swatch`.

use warpknit::fabric::Fabric;
use warpknit::pipeline::RealCloth;
use warpknit::render::{Camera, RenderOptions, View, cloth, render};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A satin: the front bar laps under three needles, the back bar under one against it.
    let fabric =
        Fabric::named("tricot")?.with_chains(&["3-4/1-0//".into(), "1-0/1-2//".into()], &[])?;
    fabric.warnings().iter().for_each(|warning| println!("warning: {warning}"));

    let scene = cloth::swatch(&fabric, 14, 16);
    let options = RenderOptions::default();
    let aspect = options.aspect();
    let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, aspect);
    render(&scene, &camera, &options, &|_| ())?.save("satin.png")?;

    let numbers = RealCloth::new(&fabric).numbers;
    println!("{:.1} g/m², {:.3} mm thick: satin.png", numbers.mass, numbers.thickness);
    for (bar, run_in) in (1..).zip(&numbers.run_in) {
        println!("bar {bar}: {:.0} mm of yarn a rack", run_in.unwrap_or(0.0));
    }
    Ok(())
}
