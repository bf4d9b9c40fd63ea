//! Yarns up to two pixels wide, and the thread sewn into their cloth, without noise. Each piece is
//! drawn into the pixels that it covers, instead of each ray searching a tree of millions of pieces.
//!
//! In: a scene of tubes, a camera, a light. Out: [`Splatter`], which adds the light of a pixel's
//! pieces to the film. Coverage is exact to 1/64 of a pixel ([`masks`]): pieces are binned in
//! blocks by tile ([`blocks`]), drawn as masks of 64 places in a pixel, and hidden front to back
//! ([`tiles`]). A piece is lit once in each pixel that sees it ([`light`]). A shadow map decides
//! what the sun lights (Williams 1978, 'Casting curved shadows on curved surfaces'). The mean depth
//! of the nearest layer around a pixel gives the visibility of the sky, as in the GPU renderer
//! (`shaders/cloth.wgsl`). Both are estimates, whose mean errors are measured and taken out
//! ([`fit`]).
//!
//! With more than 64 samples a pixel, it is split into cells with 64 places each.
//!
//! Not promised: the exact outlines of the ray tracer. Bends between data points are straight here.

mod blocks;
pub(in crate::cpu) mod fit;
mod layers;
mod light;
mod masks;
mod outline;
mod pieces;
mod screen;
mod sun;
mod tiles;
mod visible;

use std::ops::Range;

use glam::{Vec2, Vec4};

use super::backdrop::{Behind, QUARTERS};
use super::film::{NEAR, Splats, weights_around};
use super::lit::opaque_sample;
use super::to_f32;
use crate::scene::{Bounds, Scene, Shape};
use crate::{Camera, RenderOptions};
use blocks::Blocks;
use fit::{LightFit, Picture};
use layers::LayerDepths;
use light::Lights;
use masks::{HalfPlanes, PLACES, places};
use pieces::SplatPieces;
use screen::Screen;
use sun::ShadowMap;
use tiles::Fragment;
use visible::{TileRows, tile_rows};

/// Largest length of a piece over its distance from the eye. A piece is interpolated linearly in
/// the picture. Along a longer one, perspective would make that wrong, and yarns are traced
/// instead.
const MAX_PIECE_ANGLE: f32 = 0.05;
/// Radius of the cloth's thickest yarn, pixels, below which a pixel has four cells. With one, its 64
/// places are too few for as many yarns: RMS 4.6 of 255 on locknit with a radius of 0.03 pixels.
const THIN_PIXELS: f32 = 0.045;
/// Extra rows of pixels above and below the prepared ones, whose depths count for the sky of these.
/// It must cover the reach of [`LayerDepths::sky_visibility`], two squares of pixels; otherwise
/// parts of a picture would show seams.
const SKY_MARGIN_ROWS: u32 = 4;

/// Everything that a pixel's colour depends on.
pub(super) struct Splatter<'a> {
    pieces: SplatPieces<'a>,
    screen: Screen,
    planes: HalfPlanes,
    blocks: Blocks,
    lights: Lights,
    options: &'a RenderOptions,
    /// Cells across and down in a pixel.
    split: u32,
    /// Weights of each place of a pixel's cells in the pixels around, cell by cell.
    weights: Vec<[f32; NEAR]>,
    /// Sums of all of them.
    total: [f32; NEAR],
    /// The places of each cell that lie in each quarter of the pixel.
    quarters: Vec<[u64; QUARTERS]>,
    visible: Option<VisibleRows>,
}

/// The visible pieces in some rows of pixels.
struct VisibleRows {
    rows: Range<u32>,
    tiles: TileRows,
    layers: LayerDepths,
}

impl<'a> Splatter<'a> {
    /// Prepares a scene that lies within `bounds`, if splatting suits it: tubes only, and all of
    /// them far enough away. 'Far enough' is decided by the bounding sphere and not by the view, so
    /// that all pictures of a turntable use the same method.
    pub(super) fn new(
        scene: &'a Scene,
        bounds: &Bounds,
        camera: &Camera,
        options: &'a RenderOptions,
    ) -> Option<Self> {
        let centre = bounds.centre();
        let nearest = camera.eye().distance(centre.as_dvec3())
            - f64::from(bounds.min.distance(bounds.max)) / 2.0;
        let pixel = to_f32(camera.pixel_size(nearest, options.height));
        if !options.lod || scene.shape != Shape::Tube || pixel <= scene.mask_pixel() {
            return None;
        }
        let pieces = SplatPieces::new(scene, centre);
        if pieces.longest() > MAX_PIECE_ANGLE * to_f32(nearest) || !pieces.are_in_order() {
            return None;
        }
        let middle = camera.pixel_size(camera.eye().distance(centre.as_dvec3()), options.height);
        let (_, thickest) = scene.cloth_radii();
        let is_thin = thickest < THIN_PIXELS * to_f32(middle);
        let split = split(options.spp).max(if is_thin { 2 } else { 1 });
        let screen = Screen::new(bounds, camera, options, split);
        // The sky is fitted to the whole picture, whichever rows of it are wanted.
        let blocks = Blocks::new(&pieces, &screen, tile_rows(&(0..screen.size[1])));
        let rig = options.light.around(camera);
        let mut shadows = ShadowMap::new(&pieces, &screen, pixel, rig.toward_sun);
        if let Some(body) = options.set.as_ref().and_then(|set| set.body.as_ref()) {
            shadows.add_body(body, centre);
        }
        if let Some(averaged) = &options.averaged {
            shadows.add_body(&averaged.surface, centre);
        }
        let planes = HalfPlanes::new();
        let fit = LightFit::new(
            Picture {
                pieces: &pieces,
                screen: &screen,
                planes: &planes,
                blocks: &blocks,
                shadows: &shadows,
                toward_sun: rig.toward_sun,
                camera,
                options,
                split,
            },
            &rig,
        );
        let lights = Lights::new(rig, shadows, fit, scene.mean_albedo());
        let weights = cell_weights(split);
        Some(Self {
            pieces,
            screen,
            planes,
            blocks,
            lights,
            options,
            split,
            total: total(&weights),
            weights,
            quarters: quarters(split),
            visible: None,
        })
    }

    /// Finds the visible pieces of some rows. Only these rows have samples then.
    pub(super) fn prepare_rows(&mut self, rows: &Range<u32>) {
        let before = self.visible.take().map_or_else(TileRows::default, |visible| visible.tiles);
        let cells = around(rows, self.options.height, self.split);
        let parts = (&self.pieces, &self.screen, &self.planes, &self.blocks);
        let tiles = TileRows::new(before, parts, &cells);
        let layers = LayerDepths::new(&tiles, self.pieces.scene.cloth_radii().0, self.split);
        self.visible = Some(VisibleRows { rows: rows.clone(), tiles, layers });
    }

    /// Adds the light of one pixel to its film row, where no body hides it.
    pub(super) fn pixel(&self, [x, y]: [u32; 2], behind: &Behind, splats: &mut Splats) {
        let Some(visible) = self.visible.as_ref().filter(|visible| visible.rows.contains(&y))
        else {
            return;
        };
        let mut lights = [Vec4::ZERO; NEAR];
        let parts = (&self.pieces, &self.screen, &visible.layers);
        for (number, weights) in self.weights.chunks_exact(PLACES).enumerate() {
            let number = warpknit_core::ids::index32(number);
            let cell = [x * self.split + number % self.split, y * self.split + number / self.split];
            let corner = Vec2::new(cell[0] as f32, cell[1] as f32);
            let mut left = u64::MAX;
            for fragment in visible.tiles.cell(cell) {
                let mask =
                    fragment.mask & shown(behind, fragment.depth, &self.quarters[number as usize]);
                let fragment = &Fragment { mask, ..*fragment };
                if mask == 0 {
                    continue;
                }
                left &= !mask;
                let light = self.lights.of(parts, corner, fragment);
                let light = light.map_or(Vec4::ZERO, opaque_sample);
                add(&mut lights, light, weights, fragment.mask);
            }
            // The body is seen where no yarn before it is.
            for (light, quarter) in behind.body.iter().zip(&self.quarters[number as usize]) {
                if light.w > 0.0 {
                    add(&mut lights, *light, weights, left & quarter);
                }
            }
        }
        splats.add_sums(x, &lights, &self.total);
    }
}

/// Cells across a pixel for so many samples: enough that each sample has a place.
fn split(spp: u32) -> u32 {
    (1..).find(|split| split * split * 64 >= spp).unwrap_or(1)
}

/// The rows of cells of some rows of pixels and of those around them that count for their sky.
fn around(rows: &Range<u32>, height: u32, split: u32) -> Range<u32> {
    rows.start.saturating_sub(SKY_MARGIN_ROWS) * split
        ..height.min(rows.end + SKY_MARGIN_ROWS) * split
}

/// Weights of the places of all cells of a pixel in the pixels around it.
fn cell_weights(split: u32) -> Vec<[f32; NEAR]> {
    let cells = (0..split).flat_map(|y| (0..split).map(move |x| Vec2::new(x as f32, y as f32)));
    cells
        .flat_map(|cell| {
            places().map(|place| weights_around(((cell + place) / split as f32).to_array()))
        })
        .collect()
}

/// The places of all cells that lie in each quarter of a pixel.
fn quarters(split: u32) -> Vec<[u64; QUARTERS]> {
    let cells = (0..split).flat_map(|y| (0..split).map(move |x| Vec2::new(x as f32, y as f32)));
    let of_cell = |cell: Vec2| {
        let mut masks = [0; QUARTERS];
        for (bit, place) in places().into_iter().enumerate() {
            let right_and_low = ((cell + place) * 2.0).cmpge(Vec2::splat(split as f32));
            masks[right_and_low.bitmask() as usize] |= 1 << bit;
        }
        masks
    };
    cells.map(of_cell).collect()
}

/// The places of a cell at which yarn at this depth is not behind a body.
fn shown(behind: &Behind, depth: f32, quarters: &[u64; QUARTERS]) -> u64 {
    let shown = behind.reach.iter().zip(quarters).filter(|(reach, _)| depth <= **reach);
    shown.fold(0, |mask, (_, quarter)| mask | quarter)
}

/// Sums of the weights of all places.
fn total(weights: &[[f32; NEAR]]) -> [f32; NEAR] {
    std::array::from_fn(|near| weights.iter().map(|own| own[near]).sum())
}

/// Adds light at the places of a mask.
fn add(lights: &mut [Vec4; NEAR], light: Vec4, weights: &[[f32; NEAR]], mask: u64) {
    for (sum, weight) in lights.iter_mut().zip(weight_of(weights, mask)) {
        *sum += light * weight;
    }
}

/// Sums of the weights of a mask's places.
fn weight_of(weights: &[[f32; NEAR]], mask: u64) -> [f32; NEAR] {
    let (mut sums, mut left) = ([0.0; NEAR], mask);
    while left != 0 {
        let own = &weights[left.trailing_zeros() as usize % PLACES];
        // Clears the lowest set bit.
        left &= left - 1;
        sums.iter_mut().zip(own).for_each(|(sum, weight)| *sum += weight);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::raytrace::{Bounces, RayTracer};
    use crate::cpu::render;
    use crate::scene::{YarnKind, YarnLook};
    use crate::{View, cloth};
    use glam::{DVec3, Vec3};
    use image::RgbaImage;
    use warpknit_core::fabric::Fabric;

    /// Ten straight yarns a millimetre apart, of two looks in turn.
    pub(super) fn mat() -> Scene {
        let look = |albedo: f32| YarnLook::plain(Vec3::splat(albedo), 0.7, 0.1);
        let mut scene = Scene { looks: vec![look(0.5), look(0.2)], ..Scene::default() };
        for line in 0_u8..10 {
            scene.push_strand(
                (0_u8..=20).map(|i| Vec3::new(f32::from(i) * 0.5, f32::from(line), 0.0)),
                u16::from(line % 2),
            );
        }
        scene
    }

    /// Whether a scene is drawn and not traced.
    fn is_splatted(scene: &Scene, options: &RenderOptions) -> bool {
        let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        Splatter::new(scene, &scene.bounds().unwrap(), &camera, options).is_some()
    }

    #[test]
    fn tubes_thinner_than_pixels_are_drawn_and_nothing_else() {
        let far = RenderOptions { width: 30, height: 30, ..RenderOptions::default() };
        assert!(is_splatted(&mat(), &far));
        assert!(!is_splatted(&mat(), &RenderOptions { lod: false, ..far.clone() }));
        assert!(!is_splatted(&mat(), &RenderOptions { width: 300, height: 300, ..far.clone() }));
        let mut ribbons = Scene { shape: Shape::Ribbon, ..mat() };
        ribbons
            .normals
            .resize(ribbons.positions.len(), crate::octahedral::PackedUnit::new(Vec3::Z));
        assert!(!is_splatted(&ribbons, &far));
        let mut long = mat();
        long.push_strand([Vec3::ZERO, Vec3::X * 9.0], 0);
        assert!(!is_splatted(&long, &far), "perspective along its piece");
        let mut crossed = mat();
        crossed.strands.swap(2, 5);
        assert!(!is_splatted(&crossed, &far), "strands are looked up by their order");
        let (scene, inside) =
            (mat(), Camera::look_at(DVec3::new(5.0, 5.0, 0.0), DVec3::ZERO, 0.5, 1.0));
        assert!(Splatter::new(&scene, &scene.bounds().unwrap(), &inside, &far).is_none());
    }

    #[test]
    fn sewing_thread_decides_only_where_it_is_many_pixels_wide() {
        // A pixel is a third of a millimetre wide.
        let far = RenderOptions { width: 30, height: 30, ..RenderOptions::default() };
        let with = |kind: YarnKind, radius: f32| {
            let mut scene = mat();
            scene.looks.push(YarnLook { kind, ..YarnLook::plain(Vec3::ONE, 0.7, radius) });
            scene.push_strand((0_u8..=20).map(|i| Vec3::new(f32::from(i) * 0.5, 4.5, 0.5)), 2);
            scene
        };
        assert!(is_splatted(&with(YarnKind::SewingThread, 0.7), &far));
        assert!(!is_splatted(&with(YarnKind::SewingThread, 2.0), &far));
        assert!(!is_splatted(&with(YarnKind::Yarn, 0.7), &far));
        // Alone it is all that there is to see.
        let mut alone = with(YarnKind::SewingThread, 0.7);
        alone.strands.drain(..10);
        assert!(!is_splatted(&alone, &far));
        // A scene that is still empty counts as one with all its looks.
        let filled = with(YarnKind::SewingThread, 2.0);
        let empty = Scene { looks: filled.looks.clone(), ..Scene::default() };
        assert_eq!(empty.mask_pixel().to_bits(), filled.mask_pixel().to_bits());
    }

    /// The root mean square difference of two pictures on the cloth, and that of the means of each
    /// channel, of 255.
    fn differences(one: &RgbaImage, other: &RgbaImage) -> (f64, f64) {
        let (mut squares, mut sums, mut count) = (0.0, [0.0; 3], 0.0);
        for (one, other) in one.pixels().zip(other.pixels()) {
            if one.0[..3] != [255; 3] || other.0[..3] != [255; 3] {
                count += 1.0;
                for (sum, (one, other)) in sums.iter_mut().zip(one.0.iter().zip(other.0)) {
                    let difference = f64::from(*one) - f64::from(other);
                    *sum += difference;
                    squares += difference * difference;
                }
            }
        }
        let mean = sums.iter().fold(0.0_f64, |most, sum| most.max((sum / count).abs()));
        ((squares / count / 3.0).sqrt(), mean)
    }

    /// A swatch of a fabric with so many wales, drawn 160 pixels wide.
    fn drawn(fabric: &str, wales: u32, change: &RenderOptions) -> RgbaImage {
        let scene = cloth::swatch(&Fabric::named(fabric).unwrap(), wales, wales);
        let camera = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        let options = RenderOptions { width: 160, height: 160, ..change.clone() };
        render(&scene, &camera, &options, &|_| ())
    }

    #[test]
    fn pictures_have_no_noise_and_are_the_same_with_any_number_of_threads() {
        let usual = RenderOptions::default();
        let many = RenderOptions { spp: 256, ..usual.clone() };
        for (fabric, wales) in [("marquisette", 80), ("jersey", 80), ("locknit", 160)] {
            let draw = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| drawn(fabric, wales, &usual))
            };
            let picture = draw(1);
            assert!(picture == draw(3), "{fabric}");
            let (rms, mean) = differences(&picture, &drawn(fabric, wales, &many));
            println!("{fabric}: {rms:.2} {mean:.2}");
            assert!(rms < 4.0 && mean < 1.0, "{fabric}: {rms} {mean}");
        }
    }

    #[test]
    fn rows_looked_at_apart_are_as_those_looked_at_together() {
        let (scene, options) =
            (mat(), RenderOptions { width: 30, height: 30, spp: 5, ..RenderOptions::default() });
        let camera = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        let pixels = |parts: &[Range<u32>]| {
            let mut far =
                Splatter::new(&scene, &scene.bounds().unwrap(), &camera, &options).unwrap();
            let mut rows = Vec::new();
            for part in parts {
                // As if memory held no more rows.
                far.visible = None;
                far.prepare_rows(part);
                for y in part.clone() {
                    let mut splats = [(); 3].map(|()| Splats::new(30));
                    (0..30).for_each(|x| far.pixel([x, y], &Behind::NOTHING, &mut splats[1]));
                    rows.push((0..30).map(|x| Splats::pixel(&splats, x)).collect::<Vec<_>>());
                }
            }
            rows
        };
        let whole = pixels(std::slice::from_ref(&(0..30)));
        assert!(
            whole.iter().flatten().any(|light| light.w > 0.0)
                && whole.iter().flatten().any(|light| light.w == 0.0)
        );
        assert_eq!(pixels(&[0..8, 8..9, 9..30]), whole);
    }

    /// Green light and coverage of a square picture.
    fn sums(size: u32, draw: impl Fn([u32; 2], &mut Splats)) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for y in 0..size {
            let mut rows = [(); 3].map(|()| Splats::new(size));
            (0..size).for_each(|x| draw([x, y], &mut rows[1]));
            for pixel in (0..size as usize).map(|x| Splats::pixel(&rows, x)) {
                sums = (sums.0 + f64::from(pixel.y), sums.1 + f64::from(pixel.w));
            }
        }
        sums
    }

    #[test]
    fn oblique_cloth_has_the_light_of_traced_cloth() {
        const SIZE: u32 = 80;
        for (fabric, view) in
            [("tricot", View::Iso), ("jersey", View::Iso), ("locknit", View::Front)]
        {
            let scene = cloth::swatch(&Fabric::named(fabric).unwrap(), 60, 60);
            let bounds = scene.bounds().unwrap();
            let camera = Camera::view(view, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
            let options = RenderOptions { width: SIZE, height: SIZE, ..RenderOptions::default() };
            let mut far = Splatter::new(&scene, &bounds, &camera, &options).unwrap();
            far.prepare_rows(&(0..SIZE));
            let (light, cover) =
                sums(SIZE, |pixel, splats| far.pixel(pixel, &Behind::NOTHING, splats));
            // Six times as fine: in large pixels, traced bends are coarse.
            let (width, height) = (6 * SIZE, 6 * SIZE);
            let fine = RenderOptions { width, height, spp: 1, lod: false, ..options.clone() };
            let tracer = RayTracer::new(&scene, &bounds, &camera, &fine, Bounces::Traced);
            let traced = sums(width, |pixel, splats| tracer.pixel(pixel, &Behind::NOTHING, splats));
            let [light, cover] = [light / cover / (traced.0 / traced.1), 36.0 * cover / traced.1];
            println!("{fabric}: light {light:.3}, coverage {cover:.3}");
            assert!((light - 1.0).abs() < 0.04, "{fabric}: light {light}");
            assert!((cover - 1.0).abs() < 0.02, "{fabric}: coverage {cover}");
        }
    }
}
