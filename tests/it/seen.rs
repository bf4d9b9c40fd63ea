//! Pictures for which only what is seen was knitted, beside pictures of the whole garment.

use std::convert::Infallible;

use glam::DVec3;
use image::RgbaImage;
use warpknit::drape::{Cloth, DrapeOptions, run};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, ReadOptions, read};
use warpknit::knit::Pattern;
use warpknit::pipeline::{InView, add_thread_look, add_threads, draped_points, edges_of, extent};
use warpknit::render::cloth::{add_to, looks};
use warpknit::render::scene::Scene;
use warpknit::render::{Camera, RenderOptions, View, render};

use crate::drape::mesh;

/// A picture of a garment.
struct Shot {
    fabric: Fabric,
    options: DrapeOptions,
    camera: Camera,
    size: [u32; 2],
}

/// A picture for which only what is seen was knitted, beside that of the whole.
struct Compared {
    /// Root mean square difference of all channels, of 255.
    rms: f64,
    /// Share of the pixels of which a channel differs by more than 2.
    differing: f64,
    /// Share of the stitches that were knitted.
    knitted: f64,
}

impl Shot {
    fn new(fabric: &str, wales_per_cm: f64, camera: Camera, size: [u32; 2]) -> Self {
        let fabric = Fabric::named(fabric).unwrap();
        let aspect = fabric.courses_per_cm / fabric.wales_per_cm;
        let fabric = fabric.at_densities(wales_per_cm, aspect * wales_per_cm).unwrap();
        Self { fabric, options: DrapeOptions::default(), camera, size }
    }

    fn compare(&self, garment: &Garment) -> Compared {
        let cloth = Cloth::cover(garment, &self.fabric).unwrap();
        let points = draped_points(garment);
        let looks = looks(&self.fabric, self.fabric.radius());
        let empty = Scene { looks, extent: extent(&points, &cloth), ..Scene::default() };
        let [width, height] = self.size;
        let options = RenderOptions { width, height, ..RenderOptions::default() };
        let in_view = InView::of_cameras(&cloth, &empty, &[self.camera], &options, false);
        let in_view = in_view.expect("a part of it is seen");
        let needed = in_view.cloth(&cloth, &self.options);
        let mut seen = empty.clone();
        let Ok(_) = run(&needed, &self.options, &mut |_, _| {}, &mut |blocks| {
            blocks.iter().for_each(|block| in_view.add_to(&mut seen, block));
            Ok::<_, Infallible>(())
        });
        let mut whole = empty;
        let Ok(_) = run(&cloth, &self.options, &mut |_, _| {}, &mut |blocks| {
            blocks.iter().for_each(|block| add_to(&mut whole, block));
            Ok::<_, Infallible>(())
        });
        let [seen, whole] =
            [seen, whole].map(|scene| render(&scene, &self.camera, &options, &|_| ()).unwrap());
        let (rms, differing) = differences(&seen, &whole);
        let knitted = needed.stitches() as f64 / cloth.stitches() as f64;
        Compared { rms, differing, knitted }
    }
}

/// Root mean square of all differences, and the share of pixels that differ by more than 2.
fn differences(one: &RgbaImage, other: &RgbaImage) -> (f64, f64) {
    let (mut squares, mut differing) = (0.0, 0.0);
    for (a, b) in one.pixels().zip(other.pixels()) {
        let apart = |channel: usize| f64::from(a.0[channel].abs_diff(b.0[channel]));
        squares += (0..4).map(|channel| apart(channel).powi(2)).sum::<f64>();
        differing += f64::from(u8::from((0..4).any(|channel| apart(channel) > 2.0)));
    }
    let pixels = f64::from(one.width() * one.height());
    ((squares / (4.0 * pixels)).sqrt(), differing / pixels)
}

fn tshirt() -> Garment {
    read(&mesh("tshirt.obj"), None, &ReadOptions::default()).unwrap()
}

fn framed(garment: &Garment, view: View, zoom: f64) -> Camera {
    Camera::view(view, &draped_points(garment), Camera::DEFAULT_FOV, zoom, 4.0 / 3.0)
}

#[test]
fn close_ups_are_those_of_the_whole_garment() {
    let garment = tshirt();
    // Plies that show, courses that run across, and yarns that were swept on the body.
    for (fabric, wales_per_cm, zoom, sweeps) in
        [("tricot", 2.0, 8.0, false), ("jersey", 1.5, 6.0, false), ("tricot", 1.5, 6.0, true)]
    {
        let camera = framed(&garment, View::Front, zoom);
        let mut shot = Shot::new(fabric, wales_per_cm, camera, [320, 240]);
        shot.options.sweeps = Some(sweeps);
        let Compared { rms, differing, knitted } = shot.compare(&garment);
        println!("{fabric} {sweeps}: {rms} {differing}");
        // Shadows of what is out of view are cast by coarser yarns; all else is the same.
        assert!(rms < 1.0 && differing < 0.03, "{fabric} {sweeps}: {rms} {differing}");
        assert!(knitted < 0.8, "{fabric} {sweeps}: {knitted}");
    }
}

#[test]
fn yarns_thinner_than_pixels_are_cut_to_what_is_seen() {
    let garment = tshirt();
    for (view, zoom) in [(View::Front, 3.0), (View::Iso, 5.0), (View::Left, 2.0)] {
        let mut shot = Shot::new("locknit", 5.0, framed(&garment, view, zoom), [200, 150]);
        shot.options.sweeps = Some(false);
        let Compared { rms, differing, knitted } = shot.compare(&garment);
        assert!(rms < 0.11 && differing < 1e-3, "{view:?}: {rms} {differing}");
        assert!(knitted < 0.9, "{view:?}: {knitted}");
    }
}

#[test]
fn what_is_out_of_view_casts_its_shadows() {
    let garment = tshirt();
    let points = draped_points(&garment);
    let middle = points.iter().map(|point| point.as_dvec3()).sum::<DVec3>() / points.len() as f64;
    for (x, y) in [(-1.0, -0.5), (1.0, 0.3), (-0.2, 1.0)] {
        let eye = middle + DVec3::new(x, y, 0.9) * 900.0;
        let camera = Camera::look_at(eye, middle, Camera::DEFAULT_FOV, 4.0);
        let mut shot = Shot::new("tricot", 2.0, camera, [240, 180]);
        shot.options.sweeps = Some(false);
        let Compared { rms, .. } = shot.compare(&garment);
        println!("shadows: {rms}");
        assert!(rms < 1.0, "{x} {y}: {rms}");
    }
}

#[test]
fn threads_in_view_are_those_of_the_whole_garment() {
    let garment = tshirt();
    let fabric = Fabric::named("tricot").unwrap();
    let pattern = Pattern::new(&fabric);
    let threads = edges_of(&garment, &pattern, fabric.radius()).finish(&garment).threads;
    let cloth = Cloth::cover_with(&garment, &fabric, pattern).unwrap();
    let points = draped_points(&garment);
    let mut empty = Scene {
        looks: looks(&fabric, fabric.radius()),
        extent: extent(&points, &cloth),
        ..Scene::default()
    };
    add_thread_look(&mut empty, &threads);
    // Some stitches of the longest thread fill the picture.
    let hem = threads.iter().max_by_key(|thread| thread.len()).unwrap();
    let (place, normal) = hem[hem.len() / 3];
    let camera = Camera::look_at(place + normal * 60.0, place, 0.3, 1.0);
    let options = RenderOptions { width: 240, height: 180, ..RenderOptions::default() };
    let in_view = InView::of_cameras(&cloth, &empty, &[camera], &options, false).unwrap();
    let scene = |in_view: Option<&InView>| {
        let mut scene = empty.clone();
        add_threads(&mut scene, &threads, in_view);
        scene
    };
    let (seen, whole) = (scene(Some(&in_view)), scene(None));
    assert!(seen.strands.iter().filter(|strand| !strand.is_shadow).count() < threads.len() / 2);
    let pictures = [&seen, &whole].map(|scene| render(scene, &camera, &options, &|_| ()).unwrap());
    let background = pictures[1].get_pixel(0, 0);
    let covered = pictures[1].pixels().filter(|pixel| *pixel != background).count();
    let (rms, differing) = differences(&pictures[0], &pictures[1]);
    assert!(covered > 1000, "{covered}");
    assert!(rms < 0.2 && differing < 0.003, "{rms} {differing}");
}
