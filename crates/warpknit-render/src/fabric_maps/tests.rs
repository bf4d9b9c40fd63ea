//! Maps of all built-in fabrics: no seams, the cover of the yarns, sizes.

use super::*;
use crate::cloth;
use warpknit_core::fabric::builtin;
use warpknit_core::knit::numbers;

/// Values of a pixel as numbers, those of yarn times its cover. Occlusion comes last.
fn values(maps: &SideMaps, x: u32, y: u32) -> [f64; 10] {
    let cover = f64::from(maps.alpha.get_pixel(x, y).0[0]) / 255.0;
    let [r, g, b] = maps.base_color.get_pixel(x, y).0;
    let [nx, ny, nz] = maps.normal.get_pixel(x, y).0;
    let height = cover * f64::from(maps.height.get_pixel(x, y).0[0]) / 257.0;
    let [rough, open] = [&maps.roughness, &maps.occlusion].map(|map| map.get_pixel(x, y).0[0]);
    let [r, g, b, nx, ny, nz, rough, open] =
        [r, g, b, nx, ny, nz, rough, open].map(|byte| cover * f64::from(byte));
    [r, g, b, nx, ny, nz, rough, 255.0 * cover, height, open]
}

/// Sum of squared differences of two pixels' first `count` values.
fn apart(a: [f64; 10], b: [f64; 10], count: usize) -> f64 {
    a.iter().zip(&b).take(count).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Sums of squared differences over a column of pixels and the one to its right, and over a row
/// and the one below it.
fn energies(maps: &SideMaps, [column, row]: [u32; 2]) -> [f64; 2] {
    let (width, height) = maps.alpha.dimensions();
    // Without occlusion, whose noise is as large as its steps on smooth yarn.
    let step =
        |a: [u32; 2], b: [u32; 2]| apart(values(maps, a[0], a[1]), values(maps, b[0], b[1]), 9);
    let next = |at: u32, count: u32| (at + 1) % count;
    [
        (0..height).map(|y| step([column, y], [next(column, width), y])).sum(),
        (0..width).map(|x| step([x, row], [x, next(row, height)])).sum(),
    ]
}

/// The maps of a fabric, begun `moved` pixels to the right and up. They have 20 pixels along their
/// shorter side at least, and six a stitch.
fn begun_at(fabric: &Fabric, moved: [u32; 2]) -> FabricMaps {
    let size = repeat_size(fabric);
    let stitch = fabric.wale_spacing().min(fabric.course_spacing());
    let per_mm = (20.0 / size.min_element()).max(6.0 / stitch);
    let pixels = FabricMaps::pixels_at(fabric, per_mm * INCH).unwrap();
    // With the rays of a map, the noise at the rims of yarns is 10 % of a short row's gradient.
    let rays = if pixels[0] * pixels[1] < 10_000 { 8 * RAYS } else { RAYS };
    let bars = Scene { looks: cloth::looks(fabric, fabric.radius()), ..Scene::default() };
    let mut yarns = repeat_yarns(fabric, &Pattern::new(fabric));
    let way = DVec2::from(moved.map(f64::from)) * size / DVec2::from(pixels.map(f64::from));
    for point in yarns.iter_mut().flat_map(|yarn| &mut yarn.points) {
        *point -= way.extend(0.0);
    }
    FabricMaps::of_yarns(&yarns, size, pixels, &bars, (rays, &|_| ())).unwrap()
}

/// At the seam the maps change as much as at the same place of cloth that begins elsewhere, where
/// there is no seam, and its pixels are those of that cloth.
#[test]
fn no_built_in_fabric_has_a_seam() {
    for name in builtin::names() {
        let fabric = Fabric::named(name).unwrap();
        let maps = begun_at(&fabric, [0, 0]);
        let [width, height] = maps.pixels();
        let moved = [width / 2, height / 2];
        let elsewhere = begun_at(&fabric, moved);
        let (mut sums, mut differing) = ([0.0; 2], 0.0);
        for side in Side::BOTH {
            // The back runs to the left.
            let column = if side == Side::Front { width - moved[0] } else { moved[0] } - 1;
            let seam = energies(maps.side(side), [width - 1, height - 1]);
            let inside = energies(elsewhere.side(side), [column, moved[1] - 1]);
            sums[0] += seam.iter().sum::<f64>();
            sums[1] += inside.iter().sum::<f64>();
            differing += differences(maps.side(side), elsewhere.side(side), [column + 1, moved[1]]);
        }
        let ratio = sums[0] / sums[1];
        assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio:.3}");
        // Only noise is left. At a seam that is a pixel off they would differ as pixels do.
        assert!(differing < 0.3 * sums[1], "{name}: {differing} of {}", sums[1]);
    }
}

/// Sum of squared differences of two maps in the pixels around the edge of the first. `place` is the
/// second map's pixel that shows what the first one's upper left pixel does.
fn differences(maps: &SideMaps, other: &SideMaps, place: [u32; 2]) -> f64 {
    let (width, height) = maps.alpha.dimensions();
    let rows = [0, height - 1].into_iter().flat_map(|y| (0..width).map(move |x| (x, y)));
    let columns = [0, width - 1].into_iter().flat_map(|x| (0..height).map(move |y| (x, y)));
    rows.chain(columns)
        .map(|(x, y)| {
            let (x2, y2) = ((x + place[0]) % width, (y + place[1]) % height);
            apart(values(maps, x, y), values(other, x2, y2), 10)
        })
        .sum()
}

#[test]
fn alpha_is_the_cover_of_the_yarns() {
    for name in ["tricot", "locknit", "hex-net-5", "marquisette", "jersey", "weft-inserted"] {
        let fabric = Fabric::named(name).unwrap();
        let cover = numbers::measure(&fabric, &Pattern::new(&fabric)).cover;
        let maps = begun_at(&fabric, [0, 0]);
        for side in Side::BOTH {
            let alpha = maps.side(side).alpha.as_raw();
            let mean =
                alpha.iter().copied().map(f64::from).sum::<f64>() / 255.0 / alpha.len() as f64;
            assert!((mean - cover).abs() < 0.01, "{name} {side:?}: {mean} {cover}");
        }
    }
}

#[test]
fn sizes_out_of_range_are_refused_and_say_what_to_do() {
    let fabric = Fabric::named("locknit").unwrap();
    let message = |dpi| FabricMaps::pixels_at(&fabric, dpi).unwrap_err().to_string();
    assert!(message(100.0).contains("raise --dpi to 297"), "{}", message(100.0));
    assert!(FabricMaps::pixels_at(&fabric, 297.0).is_ok());
    assert!(message(1e6).contains("lower --dpi"), "{}", message(1e6));
    assert!(message(1e300).contains("lower --dpi"));
}
