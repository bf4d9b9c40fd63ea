//! Knits onto a tube that no file holds: `cargo run --release --example custom_garment`.

use glam::{DVec2, DVec3};
use warpknit::drape::{Cloth, DrapeOptions, run};
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A strip of 300 x 200 mm, closed to a tube: 60 columns of two triangles.
    let (mut flat, mut draped, mut triangles) = (vec![], vec![], vec![]);
    for column in 0..=60_u32 {
        for y in [0.0, 200.0] {
            flat.push(DVec2::new(5.0 * f64::from(column), y));
            let around = DVec2::from_angle(f64::from(column * 6).to_radians()) * 47.75;
            draped.push(DVec3::new(around.x, y, around.y));
        }
    }
    for a in (0..120).step_by(2) {
        triangles.extend([[a, a + 2, a + 3], [a, a + 3, a + 1]]);
    }
    let garment = Garment::from_arrays(&flat, &draped, &triangles)?;
    let cloth = Cloth::cover(&garment, &Fabric::named("rib-1x1")?)?;
    run(&cloth, &DrapeOptions::default(), &mut |_, _| {}, &mut |blocks| {
        let points: usize = blocks.iter().map(|block| block.draped.positions.len()).sum();
        println!("{points} more points on the body");
        Ok::<_, std::convert::Infallible>(())
    })?;
    Ok(())
}
