//! Pictures show uneven cloth, whose stitches are as unlike as those of a scan. Files and numbers are
//! of regular cloth, and `--regular` draws that.

use image::{ImageBuffer, Luma, RgbaImage, imageops};
use warpknit::drape::evenness::Evenness;
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::render::scene::Scene;
use warpknit::render::{Camera, RenderOptions, View, cloth};

use crate::cli::warpknit;
use crate::gpu;

/// Rows and columns of the picture's middle that are compared.
const CROP: u32 = 240;

/// How alike stitches six to fourteen wales apart are: the highest normalised autocorrelation of a
/// picture's middle at such distances, without its slow shades. `wale` is in pixels.
fn likeness(picture: &RgbaImage, wale: f32) -> f64 {
    let corner = [picture.width(), picture.height()].map(|side| (side - CROP) / 2);
    let light = ImageBuffer::<Luma<f32>, Vec<f32>>::from_fn(CROP, CROP, |x, y| {
        let [r, g, b, _] = picture.get_pixel(corner[0] + x, corner[1] + y).0.map(f32::from);
        Luma([(0.2126 * r + 0.7152 * g + 0.0722 * b) / 255.0])
    });
    let slow = imageops::blur(&light, 2.0 * wale);
    let detail: Vec<f32> = light.iter().zip(slow.iter()).map(|(all, slow)| all - slow).collect();
    let side = i32::try_from(CROP).unwrap();
    let at = |x: i32, y: i32| f64::from(detail[usize::try_from(y * side + x).unwrap()]);
    let alike = |right: i32, down: i32| {
        let columns = 0.max(-right)..side - 0.max(right);
        let (mut sum, mut count) = (0.0, 0.0);
        for y in 0..side - down {
            for x in columns.clone() {
                sum += at(x, y) * at(x + right, y + down);
                count += 1.0;
            }
        }
        sum / count
    };
    let own = alike(0, 0);
    let far = (14.0 * wale).ceil() as i32;
    let lags = (0..far).flat_map(|down| (-far..far).map(move |right| (right, down)));
    let ring = lags.filter(|&(right, down)| {
        let distance = f64::from(right).hypot(f64::from(down)) / f64::from(wale);
        (6.0..14.0).contains(&distance)
    });
    ring.map(|(right, down)| alike(right, down) / own).fold(0.0, f64::max)
}

#[test]
fn far_stitches_are_as_unlike_as_those_of_a_scan_unless_cloth_is_regular() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |fabric: &str, size: [&str; 2], flags: &[&str]| {
        let output = folder.path().join("x.png");
        let [wales, courses] = size;
        warpknit(folder.path())
            .args(["swatch", "--fabric", fabric, "--wales", wales, "--courses", courses])
            .args(["--size", "400x400", "--renderer", "cpu", "--quiet", "-o", "x.png"])
            .args(flags)
            .assert()
            .success();
        image::open(output).unwrap().into_rgba8()
    };
    // The swatch fills 0.9 of the height.
    for (fabric, size, wale) in [("jersey", ["46", "60"], 7.8), ("locknit", ["32", "46"], 11.6)] {
        let uneven = likeness(&drawn(fabric, size, &[]), wale);
        let regular = likeness(&drawn(fabric, size, &["--regular"]), wale);
        println!("{fabric}: {uneven:.3}, regular {regular:.3}");
        assert!((0.55..0.8).contains(&uneven), "{fabric}: {uneven}");
        assert!(regular > 0.82, "{fabric}: {regular}");
    }
}

#[test]
fn files_beside_a_picture_are_regular() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let knit = |outputs: &[&str]| {
        let outputs = outputs.iter().flat_map(|output| ["-o", *output]);
        let small = ["swatch", "--wales", "5", "--courses", "6", "--size", "64x64", "--quiet"];
        warpknit(folder).args(small).args(outputs).assert().success();
    };
    knit(&["alone.csv"]);
    knit(&["beside.csv", "beside.png"]);
    let [alone, beside] =
        ["alone.csv", "beside.csv"].map(|name| std::fs::read(folder.join(name)).unwrap());
    assert_eq!(alone, beside);
}

#[test]
fn both_renderers_draw_the_same_uneven_cloth() {
    if !gpu::can_draw("uneven cloth") {
        return;
    }
    let fabric = Fabric::named("locknit").unwrap();
    let panel = swatch_panel(&fabric, 14, 14);
    let cloth = Cloth::swatch(&panel, &fabric, 14, 14);
    let looks = cloth::looks(&fabric, fabric.radius());
    let drawn = |evenness| {
        cloth::with_cloth(&cloth, Scene { looks: looks.clone(), evenness, ..Scene::default() })
    };
    let [regular, uneven] = [Evenness::Regular, Evenness::Uneven].map(drawn);
    let camera = Camera::view(View::Front, &regular.positions, Camera::DEFAULT_FOV, 1.6, 1.0);
    // What they differ by anyway is another test's. Uneven cloth adds to it, since the graphics card
    // takes a yarn's thickness at eight places of a chunk of some stitches: 0.008 here.
    let [even, odd] =
        [&regular, &uneven].map(|scene| gpu::difference(scene, &camera, RenderOptions::default()));
    assert!(odd < even + 0.025, "{odd} and {even}");
    assert!(uneven.positions != regular.positions);
}
