//! Nets are open and cloth is closed, seen through the renderer: shares of see-through pixels, and
//! sizes of holes.

use glam::{DVec2, DVec3};
use warpknit::fabric::Fabric;
use warpknit::knit::{Pattern, numbers};
use warpknit::render::cloth::swatch;
use warpknit::render::{Background, Camera, RenderOptions, render};

/// Pixels a wale: a hole's edge is then well under a hundredth of its area.
const FINE: f64 = 48.0;
/// The picture is taken from so many times its height, so that all is seen straight from the front.
const FAR: f64 = 200.0;
/// Holes smaller than this share of the largest are the insides of loops and the corners that an
/// inlay cuts off, not meshes.
const MESH: f64 = 0.6;

/// Whole repeats of a fabric as seen from the front.
struct Window {
    /// Opacity, row by row.
    alpha: Vec<f64>,
    size: [usize; 2],
    /// Repeats across and along.
    repeats: [usize; 2],
}

impl Window {
    /// As few repeats as hold 4 wales and 6 courses.
    fn of(fabric: &Fabric) -> Self {
        let repeat = [fabric.threading_repeat(), fabric.repeat()];
        let repeats = [4_usize.div_ceil(repeat[0]), 6_usize.div_ceil(repeat[1])];
        let [wales, courses] = [repeat[0] * repeats[0], repeat[1] * repeats[1]];
        let size = DVec2::new(
            wales as f64 * fabric.wale_spacing(),
            courses as f64 * fabric.course_spacing(),
        );
        let scene = swatch(fabric, wales as u32 + 16, courses as u32 + 12);
        let middle = scene.bounds().unwrap().centre().as_dvec3();
        let width = (wales as f64 * FINE) as u32;
        // Pixels are square, so the picture is cut to whole ones: under a thousandth of it.
        let height = (f64::from(width) * size.y / size.x).round() as u32;
        let distance = FAR * size.y;
        let fov = 2.0 * (size.y / 2.0 / distance).atan();
        let camera = Camera::look_at(middle + DVec3::Z * distance, middle, fov, 1.0);
        let options = RenderOptions {
            width,
            height,
            sky_rays: 1,
            background: Background::Transparent,
            ..RenderOptions::default()
        };
        let picture = render(&scene, &camera, &options, &|_| ()).unwrap();
        let alpha = picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).collect();
        Self { alpha, size: [width as usize, height as usize], repeats }
    }

    fn see_through(&self) -> f64 {
        1.0 - self.alpha.iter().sum::<f64>() / self.alpha.len() as f64
    }

    /// Pixels of each see-through region; regions go on beyond the window's edge at its other side,
    /// as the fabric does.
    fn regions(&self) -> Vec<usize> {
        let [width, height] = self.size;
        let mut open: Vec<bool> = self.alpha.iter().map(|alpha| *alpha < 0.5).collect();
        let mut regions = Vec::new();
        for start in 0..open.len() {
            let mut waiting = Vec::new();
            let mut pixels = 0;
            if std::mem::take(&mut open[start]) {
                waiting.push(start);
            }
            while let Some(at) = waiting.pop() {
                pixels += 1;
                let (x, y) = (at % width, at / width);
                for (x, y) in [(x + 1, y), (x + width - 1, y), (x, y + 1), (x, y + height - 1)] {
                    let next = y % height * width + x % width;
                    if std::mem::take(&mut open[next]) {
                        waiting.push(next);
                    }
                }
            }
            regions.extend((pixels > 0).then_some(pixels));
        }
        regions
    }

    /// Sizes of the meshes, the large holes.
    fn meshes(&self) -> Vec<usize> {
        let regions = self.regions();
        let largest = regions.iter().copied().max().unwrap_or(0);
        regions.into_iter().filter(|size| *size as f64 > MESH * largest as f64).collect()
    }
}

/// Name, the least and the most see-through share, and meshes a repeat if it has meshes to be
/// counted.
const SHARES: [(&str, f64, f64, Option<usize>); 10] = [
    // The loops of both bars lie behind each other and leave its holes open.
    ("tricot", 0.0, 0.25, None),
    // Its pillars stand a wale apart, and the inlay crosses between them in each third course.
    ("tulle-3", 0.35, 0.9, Some(2)),
    // Neighbouring pillars meet once in five courses.
    ("tulle-5", 0.35, 0.9, Some(2)),
    // One a wale and course: the inlay crosses in each.
    ("marquisette", 0.4, 0.8, Some(2)),
    ("marquisette-3", 0.4, 0.8, Some(6)),
    ("square-net", 0.5, 0.9, None),
    // Two rows of meshes a repeat, staggered.
    ("atlas-net", 0.5, 0.9, Some(2)),
    ("hex-net-3", 0.5, 0.9, Some(2)),
    ("hex-net-5", 0.5, 0.9, Some(2)),
    // The same; the elastane keeps to the wales.
    ("power-net", 0.35, 0.7, Some(2)),
];

#[test]
fn cloth_is_as_open_as_its_name_promises_and_its_cover_factor_says() {
    for (name, least, most, meshes) in SHARES {
        let fabric = Fabric::named(name).unwrap();
        let window = Window::of(&fabric);
        let open = window.see_through();
        assert!((least..most).contains(&open), "{name} is {:.1} % open", 100.0 * open);
        let cover = numbers::measure(&fabric, &Pattern::new(&fabric)).cover;
        assert!((1.0 - open - cover).abs() < 0.03, "{name}: {open} open, cover factor {cover}");
        if let Some(meshes) = meshes {
            let sizes = window.meshes();
            assert_eq!(
                sizes.len(),
                meshes * window.repeats[0] * window.repeats[1],
                "{name}: {sizes:?}"
            );
            let mean = sizes.iter().sum::<usize>() as f64 / sizes.len() as f64;
            let deviation = sizes.iter().map(|size| (*size as f64 - mean).powi(2)).sum::<f64>()
                / sizes.len() as f64;
            assert!(deviation.sqrt() < 0.1 * mean, "{name}: {sizes:?}");
        }
    }
}
