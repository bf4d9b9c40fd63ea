//! Pictures that `capture` must refuse: they repeat nowhere.

use std::f64::consts::{PI, TAU};

use glam::DVec2;
use image::RgbImage;

use super::cloth::{Random, byte, whole};

/// Fur: strokes that lie nearly one way.
pub(crate) fn fur(seed: u64, size: u32) -> RgbImage {
    let mut random = Random::new(seed);
    let mut image = RgbImage::from_pixel(size, size, image::Rgb([128; 3]));
    let way = random.within(0.0, PI);
    for _ in 0..size * size / 60 {
        let mut at =
            DVec2::new(random.within(0.0, f64::from(size)), random.within(0.0, f64::from(size)));
        let (mut turn, bend, shade) =
            (way + 0.35 * random.bell(), 0.01 * random.bell(), byte(random.within(50.0, 230.0)));
        for _ in 0..whole(random.within(20.0, 60.0)) {
            turn += bend;
            at += DVec2::from_angle(turn);
            let [x, y] = at.to_array().map(|place| u32::try_from(whole(place)).unwrap_or(size));
            if let Some(pixel) = image.get_pixel_mut_checked(x, y) {
                *pixel = image::Rgb([shade; 3]);
            }
        }
    }
    image
}

/// A portrait: a head, its hair and eyes, nose and mouth, on shoulders, as smoothly shaded as skin
/// is, with the noise of skin.
pub(crate) fn face(seed: u64, size: u32) -> RgbImage {
    let mut random = Random::new(seed);
    let side = f64::from(size);
    let middle = DVec2::new(random.within(0.45, 0.55), random.within(0.42, 0.5));
    let head = DVec2::new(random.within(0.2, 0.26), random.within(0.28, 0.34));
    let light = DVec2::from_angle(random.within(0.0, TAU)) * random.within(0.1, 0.3);
    let skin = random.within(120.0, 200.0);
    let [behind, cloth, hair] =
        [(40.0, 220.0), (30.0, 200.0), (20.0, 90.0)].map(|(low, high)| random.within(low, high));
    // Squares of the distance from the middle of an ellipse; 1 on its rim.
    let within = |at: DVec2, centre: [f64; 2], radii: [f64; 2]| {
        ((at - DVec2::from(centre)) / DVec2::from(radii)).length_squared()
    };
    let shade = |at: DVec2| {
        let p = (at - middle) / head;
        let mut grey = behind * (1.0 + 0.4 * light.dot(at - 0.5));
        let mut lay = |how_far: f64, value: f64| {
            let share = ((1.0 - how_far) / 0.12).clamp(0.0, 1.0);
            grey += (value - grey) * share;
        };
        lay(within(p, [0.0, 2.3], [2.0, 1.3]), cloth * (1.0 - 0.2 * p.x * p.x));
        lay(within(p, [0.0, 1.0], [0.45, 0.6]), 0.75 * skin);
        lay(within(p, [0.0, -0.25], [1.12, 1.0]), hair);
        lay(
            within(p, [0.0, 0.08], [0.95, 0.98]),
            skin * (1.0 + light.dot(p) - 0.25 * p.length_squared()),
        );
        for eye in [-0.38, 0.38] {
            lay(within(p, [eye, -0.3], [0.24, 0.05]), hair);
            lay(within(p, [eye, -0.12], [0.17, 0.08]), 1.15 * skin);
            lay(within(p, [eye, -0.12], [0.08, 0.08]), 35.0);
        }
        lay(within(p, [0.06, 0.2], [0.1, 0.2]), 0.85 * skin);
        lay(within(p, [0.0, 0.52], [0.32, 0.09]), 0.6 * skin);
        grey
    };
    let pores = image::imageops::fast_blur(&noise(&mut random, size), 1.2);
    RgbImage::from_fn(size, size, |x, y| {
        let grain = 0.12 * (f64::from(pores.get_pixel(x, y).0[0]) - 128.0) + 2.0 * random.bell();
        let grey = shade(DVec2::new(f64::from(x), f64::from(y)) / side) + grain;
        image::Rgb([grey, 0.8 * grey, 0.68 * grey].map(byte))
    })
}

/// An old wall, out of focus: courses of all heights, bricks of all lengths, no two alike.
pub(crate) fn bricks(seed: u64, size: u32) -> RgbImage {
    let mut random = Random::new(seed);
    let side = f64::from(size);
    let (height, joint, blur) =
        (side / random.within(8.0, 16.0), random.within(2.0, 4.0), random.within(1.5, 4.0));
    let [mortar, clay] = [random.within(140.0, 210.0), random.within(80.0, 130.0)];
    let mut image = RgbImage::from_pixel(
        size,
        size,
        image::Rgb([mortar, 0.97 * mortar, 0.9 * mortar].map(byte)),
    );
    let mut top = -random.within(0.0, height);
    while top < side {
        let bottom = top + height * random.within(0.55, 1.5);
        let mut left = -2.0 * height * random.within(0.0, 1.0);
        while left < side {
            let right = left + 2.2 * height * random.within(0.4, 1.7);
            let grey = clay + 18.0 * random.bell();
            let corners = [
                left,
                top + random.within(0.0, joint),
                right - joint,
                bottom - joint - random.within(0.0, joint),
            ];
            let [x, y, end_x, end_y] =
                corners.map(|place| u32::try_from(whole(place.clamp(0.0, side))).unwrap());
            for (x, y) in (y..end_y).flat_map(|y| (x..end_x).map(move |x| (x, y))) {
                image.put_pixel(
                    x,
                    y,
                    image::Rgb(
                        [grey, 0.6 * grey, 0.5 * grey]
                            .map(|value| byte(value + 5.0 * random.bell())),
                    ),
                );
            }
            left = right;
        }
        top = bottom;
    }
    #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
    let blur = blur as f32;
    image::imageops::fast_blur(&image, blur)
}

/// Noise without any grain.
pub(crate) fn noise(random: &mut Random, size: u32) -> RgbImage {
    RgbImage::from_fn(size, size, |_, _| image::Rgb([byte(128.0 + 40.0 * random.bell()); 3]))
}
