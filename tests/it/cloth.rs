//! Pictures of cloth whose yarns are known, for `capture`: our own renderer's, under a sky that is
//! equally light everywhere, which is not how the fit shades its cylinders.
//!
//! Lengths are pixels. Truth is what is seen: stretches of yarn over which nothing else lies, in
//! pieces that leave their chords by less than a fifth of the yarn's width.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3, Vec3Swizzles};
use image::RgbImage;
use warpknit::fabric::Fabric;
use warpknit::photo::capture::{Captured, GivenLayout, Segment};
use warpknit::render::cloth;
use warpknit::render::scene::{Scene, YarnLook};
use warpknit::render::{Background, Camera, Light, RenderOptions, render};
use warpknit::yarn::curve;

/// How a cloth is made.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Plain,
    /// The same with wefts of another colour.
    Colored,
    /// So many wefts over which a warp goes, and under which.
    Twill(u8, u8),
    Jersey,
}

/// A stretch of yarn that is seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// Where it is seen in the picture, or of [`Sample::in_cell`] from a cell's corner.
    pub(crate) centre: DVec2,
    /// Its direction where nothing moves the cloth.
    pub(crate) angle: f64,
    pub(crate) length: f64,
    pub(crate) width: f64,
}

/// What a photo does to a cloth.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Disturbance {
    /// How far the cloth is moved by slow waves.
    pub(crate) distortion: f64,
    /// Standard deviation of the noise, white being 1.
    pub(crate) noise: f64,
    /// How much lighter one side is.
    pub(crate) light: f64,
}

/// A picture and the truth about it, y down.
pub(crate) struct Sample {
    pub(crate) image: RgbImage,
    pub(crate) lattice: [DVec2; 2],
    pub(crate) stretches: Vec<Stretch>,
}

impl Stretch {
    /// Whether it is long enough to have a direction.
    pub(crate) fn is_long(&self) -> bool {
        self.length > 0.8 * self.width
    }
}

impl Sample {
    /// Its stretches as `found` has its segments: from a cell's corner, where nothing moves the
    /// cloth.
    pub(crate) fn in_cell(&self, found: &Captured) -> Vec<Stretch> {
        let place = |pixel: DVec2| found.unit.lattice.matrix() * found.cell_coordinates(pixel);
        self.stretches
            .iter()
            .map(|stretch| Stretch { centre: place(stretch.centre), ..*stretch })
            .collect()
    }
}

/// Numbers that a seed tells (Marsaglia's xorshift).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678_9ABC_DEF1);
        for _ in 0..4 {
            random.bits();
        }
        random
    }

    fn bits(&mut self) -> u64 {
        for shift in [13_i32, -7, 17] {
            self.0 ^= if shift > 0 { self.0 << shift } else { self.0 >> -shift };
        }
        self.0
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        let bits = u32::try_from(self.bits() >> 32).unwrap();
        low + (high - low) * f64::from(bits) / f64::from(u32::MAX)
    }

    /// Normal, nearly.
    pub(crate) fn bell(&mut self) -> f64 {
        (0..12).map(|_| self.within(0.0, 1.0)).sum::<f64>() - 6.0
    }
}

/// Yarns around the origin, y up.
struct Laid {
    yarns: Vec<Vec<DVec3>>,
    /// From which yarn on they are of the second colour.
    colored: usize,
    radius: f64,
    lattice: [DVec2; 2],
}

/// A square picture of a cloth.
pub(crate) fn sample(kind: Kind, seed: u64, size: u32, disturbance: Disturbance) -> Sample {
    let mut random = Random::new(seed);
    let side = f64::from(size);
    let laid = match kind {
        Kind::Plain => weave(&mut random, [1, 1], side),
        Kind::Colored => {
            let laid = weave(&mut random, [1, 1], side);
            let warps = laid.yarns.iter().take_while(|yarn| yarn[0].x == yarn[1].x).count();
            Laid { colored: warps, ..laid }
        }
        Kind::Twill(over, under) => weave(&mut random, [i64::from(over), i64::from(under)], side),
        Kind::Jersey => jersey(&mut random, side),
    };
    pictured(&laid, &laid.yarns, laid.radius, size, disturbance, &mut random)
}

/// A square picture of a plain weave whose yarns are bundles of twisted fibres, `fibre` pixels wide
/// each, and the degrees by which the outermost lean against the yarn: S over 0, Z under 0.
pub(crate) fn fibrous(seed: u64, size: u32, fibre: f64, disturbance: Disturbance) -> (Sample, f64) {
    let mut random = Random::new(seed);
    let count = u16::try_from(whole(random.within(40.0, 90.0))).unwrap();
    let radius = 0.5 * fibre * (f64::from(count) / PACKING).sqrt();
    let pitch = 2.0 * radius / random.within(0.8, 0.95);
    let aspect: f64 = random.within(0.92, 1.08);
    let laid = woven(
        DVec2::new(pitch * aspect.sqrt(), pitch / aspect.sqrt()),
        radius,
        [1, 1],
        8,
        f64::from(size),
    );
    let degrees = random.within(8.0, 35.0) * if random.within(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
    let near = |p: &DVec3| p.truncate().abs().max_element() < 0.75 * f64::from(size);
    let mut fibres = Vec::new();
    for yarn in &laid.yarns {
        let (first, last) = (yarn.iter().position(near), yarn.iter().rposition(near));
        if let (Some(first), Some(last)) = (first, last) {
            fibres.extend(bundle(
                &yarn[first..=last],
                radius,
                0.5 * fibre,
                count,
                degrees,
                &mut random,
            ));
        }
    }
    (pictured(&laid, &fibres, 0.5 * fibre, size, disturbance, &mut random), degrees)
}

/// Share of a yarn's section that is fibre.
const PACKING: f64 = 0.6;

/// Fibres wound around a yarn's axis, all with as many turns; each wanders a little in and out.
fn bundle(
    yarn: &[DVec3],
    radius: f64,
    fibre: f64,
    count: u16,
    degrees: f64,
    random: &mut Random,
) -> Vec<Vec<DVec3>> {
    let outermost = radius - fibre;
    // From aside over the top and back against the way ahead: fibres seen from above lean as the
    // bar of an S does.
    let turns = degrees.to_radians().tan() / outermost;
    let (mut axis, mut along) = (Vec::new(), 0.0);
    for at in 0..yarn.len() - 1 {
        let span = curve::span(yarn, at);
        let pieces = whole(span.length() / (0.3 * radius)) + 1;
        for piece in 0..pieces {
            let t = piece as f64 / pieces as f64;
            let ahead = span.tangent(t).normalize();
            let aside = ahead.cross(DVec3::Z).normalize();
            axis.push((span.at(t), aside, aside.cross(ahead), along + t * span.length()));
        }
        along += span.length();
    }
    let start = random.within(0.0, TAU);
    (0..count)
        .map(|number| {
            // Sunflower seeds: evenly over the section.
            let out = outermost * ((f64::from(number) + 0.5) / f64::from(count)).sqrt()
                + 0.3 * fibre * random.bell();
            let around = start + f64::from(number) * 2.399_963 + 0.1 * random.bell();
            let (wave, phase) = (random.within(0.3, 0.8) / radius, random.within(0.0, TAU));
            let place = |&(middle, aside, up, along): &(DVec3, DVec3, DVec3, f64)| {
                let out = (out + 0.35 * fibre * (wave * along + phase).sin()).clamp(0.0, outermost);
                let (sin, cos) = (around + turns * along).sin_cos();
                middle + (aside * cos + up * sin) * out
            };
            axis.iter().map(place).collect()
        })
        .collect()
}

/// A cloth as a camera sees it, drawn with `strands` of a radius, and its truth.
fn pictured(
    laid: &Laid,
    strands: &[Vec<DVec3>],
    strand_radius: f64,
    size: u32,
    disturbance: Disturbance,
    random: &mut Random,
) -> Sample {
    let side = f64::from(size);
    let turn = random.within(-8.0, 8.0).to_radians();
    let turned = |p: DVec2| DVec2::from_angle(turn).rotate(p);
    let waves: Vec<(DVec2, f64, DVec2)> = (0..4)
        .map(|_| {
            let wave = DVec2::from_angle(random.within(0.0, TAU))
                * (TAU / (random.within(0.45, 1.2) * side));
            (wave, random.within(0.0, TAU), DVec2::from_angle(random.within(0.0, TAU)))
        })
        .collect();
    let moved = |p: DVec2| {
        p + waves.iter().map(|(wave, phase, way)| *way * (wave.dot(p) + phase).sin()).sum::<DVec2>()
            * (disturbance.distortion / 2.0)
    };
    let strands = strands.iter().map(|strand| {
        strand.iter().map(|p| moved(turned(p.truncate())).extend(p.z).as_vec3()).collect()
    });
    let picture = photographed(strands.collect(), laid.colored, strand_radius, size, random);
    let gradient = DVec2::from_angle(random.within(0.0, TAU)) * disturbance.light;
    let image = RgbImage::from_fn(size, size, |x, y| {
        let light = 1.0 + 2.0 * gradient.dot(DVec2::new(f64::from(x), f64::from(y)) / side - 0.5);
        let noise = 255.0 * disturbance.noise * random.bell();
        let [r, g, b, _] = picture.get_pixel(x, y).0;
        image::Rgb([r, g, b].map(|value| byte(f64::from(value) * light + noise)))
    });
    let flipped = |p: DVec2| DVec2::new(p.x, -p.y);
    let in_picture = |stretch: Stretch| Stretch {
        // The middle of the first pixel is at 0.
        centre: flipped(moved(turned(stretch.centre))) + 0.5 * side - 0.5,
        angle: -(stretch.angle + turn),
        ..stretch
    };
    let lattice = laid.lattice.map(|vector| flipped(turned(vector)));
    Sample { image, lattice, stretches: seen(laid).into_iter().map(in_picture).collect() }
}

pub(crate) fn byte(value: f64) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    let byte = value.round() as u8;
    byte
}

pub(crate) fn whole(value: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "pixels")]
    let whole = value as i64;
    whole
}

/// Warps that go over and under so many wefts, a weft later at each next warp.
fn weave(random: &mut Random, [over, under]: [i64; 2], side: f64) -> Laid {
    let (pitch, aspect) = (random.within(13.0, 32.0), random.within(0.85, 1.18));
    let spacing = DVec2::new(pitch * aspect.sqrt(), pitch / aspect.sqrt());
    let radius = 0.5 * random.within(0.72, 0.95) * spacing.min_element();
    woven(spacing, radius, [over, under], 2, side)
}

/// The same with so many points from one crossing to the next.
fn woven(spacing: DVec2, radius: f64, [over, under]: [i64; 2], parts: u8, side: f64) -> Laid {
    let is_up = |warp: i64, weft: i64| (weft - warp).rem_euclid(over + under) < over;
    let [warps, wefts] = (spacing.recip() * (0.75 * side)).to_array().map(|count| whole(count) + 1);
    let mut yarns = Vec::new();
    for (count, steps, along_y) in [(warps, wefts, true), (wefts, warps, false)] {
        for yarn in -count..=count {
            let height = |step: i64| {
                if along_y == if along_y { is_up(yarn, step) } else { is_up(step, yarn) } {
                    radius
                } else {
                    -radius
                }
            };
            let mut points = Vec::new();
            for step in -steps..=steps {
                for part in 0..parts {
                    let share = f64::from(part) / f64::from(parts);
                    let (along, eased) = (step as f64 + share, 0.5 - 0.5 * (PI * share).cos());
                    let z = height(step) + eased * (height(step + 1) - height(step));
                    let place = if along_y {
                        DVec2::new(yarn as f64, along)
                    } else {
                        DVec2::new(along, yarn as f64)
                    };
                    points.push((place * spacing).extend(z));
                }
            }
            yarns.push(points);
        }
    }
    Laid {
        colored: yarns.len(),
        yarns,
        radius,
        lattice: [spacing, DVec2::new(0.0, (over + under) as f64 * spacing.y)],
    }
}

/// Our own jersey, from its technical face.
fn jersey(random: &mut Random, side: f64) -> Laid {
    let (aspect, width, wales) =
        (random.within(1.15, 1.5), random.within(24.0, 52.0), random.within(11.0, 13.5));
    let fabric = Fabric::named("jersey").unwrap().at_densities(wales, wales * aspect).unwrap();
    let scale = width / fabric.wale_spacing();
    let count = |spacing: f64| u32::try_from(whole(1.6 * side / spacing)).unwrap() + 2;
    let scene = cloth::swatch(&fabric, count(width), count(width / aspect));
    let centre = scene.bounds().unwrap().centre().as_dvec3().with_z(0.0);
    let points = |points: &std::ops::Range<u32>| {
        &scene.positions[points.start as usize..points.end as usize]
    };
    let yarns = scene.strands.iter().map(|strand| {
        points(&strand.points).iter().map(|p| (p.as_dvec3() - centre) * scale).collect()
    });
    let lattice = [DVec2::new(width, 0.0), DVec2::new(0.0, width / aspect)];
    let yarns: Vec<_> = yarns.collect();
    Laid { colored: yarns.len(), yarns, radius: fabric.radius() * scale, lattice }
}

/// Seen from far above, in a light that comes from everywhere.
fn photographed(
    yarns: Vec<Vec<Vec3>>,
    colored: usize,
    radius: f64,
    size: u32,
    random: &mut Random,
) -> image::RgbaImage {
    let mut part = || random.within(0.25, 0.7) as f32;
    let mut look = YarnLook::plain(Vec3::new(part(), part(), part()), 0.8, radius as f32);
    look.plies = 1 + u32::from(random.within(0.0, 1.0) > 0.5);
    let second = YarnLook { albedo: look.albedo.zxy() * Vec3::new(1.0, 0.3, 0.15), ..look };
    let mut scene = Scene { looks: vec![look, second], ..Scene::default() };
    (0..)
        .zip(yarns)
        .for_each(|(number, yarn)| scene.push_strand(yarn, u16::from(number >= colored)));
    let far = 40.0 * f64::from(size);
    let camera = Camera::look_at(
        DVec3::new(0.0, 0.0, far),
        DVec3::ZERO,
        2.0 * (0.5 * f64::from(size) / far).atan(),
        1.0,
    );
    let sky = Vec3::splat(0.9);
    let light = Light { sun: Vec3::ZERO, sky_above: sky, sky_below: sky, ..Light::default() };
    let background = Background::Color([12, 12, 12]);
    let options = RenderOptions {
        width: size,
        height: size,
        spp: 4,
        sky_rays: 6,
        background,
        light,
        ..RenderOptions::default()
    };
    render(&scene, &camera, &options, &|_| ()).unwrap()
}

/// The stretches of yarn that are seen from above, one of each class of the lattice, near the
/// origin.
fn seen(laid: &Laid) -> Vec<Stretch> {
    let longest = laid.lattice.iter().map(|vector| vector.length()).fold(0.0, f64::max);
    let reach = 3.6 * longest + 4.0 * laid.radius;
    let step = laid.radius / 12.0;
    let near = |p: &DVec3| p.truncate().abs().max_element() < reach + 3.0 * laid.radius;
    let path = |yarn: &Vec<DVec3>| -> Vec<DVec3> {
        let spans = (0..yarn.len() - 1).filter(|&at| near(&yarn[at]) || near(&yarn[at + 1]));
        spans
            .flat_map(|at| {
                let (span, pieces) =
                    (curve::span(yarn, at), whole(yarn[at].distance(yarn[at + 1]) / step) + 1);
                (0..pieces).map(move |piece| span.at(piece as f64 / pieces as f64))
            })
            .collect()
    };
    let paths: Vec<Vec<DVec3>> = laid.yarns.iter().map(path).collect();
    let top = top(&paths, reach, step, laid.radius);
    let mut found = Vec::new();
    for (number, path) in paths.iter().enumerate() {
        let is_seen = |at: usize| {
            // Of a yarn that turns back, the part that is meant.
            top.at(path[at].truncate())
                .is_some_and(|(yarn, place)| yarn == number && place.abs_diff(at) < 26)
        };
        let flags: Vec<bool> = (0..path.len()).map(is_seen).collect();
        let mut start = 0;
        for run in flags.chunk_by(|a, b| a == b) {
            let end = start + run.len();
            if run[0] && start > 0 && end < path.len() {
                straight(&path[start..end], laid.radius, &mut found);
            }
            start = end;
        }
    }
    one_of_each(found, laid.lattice, longest)
}

/// What lies uppermost at each place: height, yarn and place along it.
struct Top {
    cells: Vec<(f64, usize, usize)>,
    side: i64,
    reach: f64,
    step: f64,
}

impl Top {
    fn at(&self, p: DVec2) -> Option<(usize, usize)> {
        let [x, y] = ((p + self.reach) / self.step).to_array().map(|at| whole(at.round()));
        let is_in = (0..self.side).contains(&x) && (0..self.side).contains(&y);
        is_in
            .then(|| self.cells[usize::try_from(y * self.side + x).unwrap()])
            .map(|(_, yarn, place)| (yarn, place))
    }
}

fn top(paths: &[Vec<DVec3>], reach: f64, step: f64, radius: f64) -> Top {
    let side = whole(2.0 * reach / step) + 1;
    let mut top = Top {
        cells: vec![(f64::NEG_INFINITY, usize::MAX, 0); usize::try_from(side * side).unwrap()],
        side,
        reach,
        step,
    };
    let cells = whole(radius / step);
    for (number, path) in paths.iter().enumerate() {
        for (at, p) in path.iter().enumerate() {
            let [cx, cy] = ((p.truncate() + reach) / step).to_array().map(|at| whole(at.round()));
            for y in (cy - cells).max(0)..=(cy + cells).min(side - 1) {
                for x in (cx - cells).max(0)..=(cx + cells).min(side - 1) {
                    let off = ((x - cx).pow(2) + (y - cy).pow(2)) as f64 * step * step;
                    let cell = &mut top.cells[usize::try_from(y * side + x).unwrap()];
                    let height = p.z + (radius * radius - off).max(0.0).sqrt();
                    if off <= radius * radius && height > cell.0 {
                        *cell = (height, number, at);
                    }
                }
            }
        }
    }
    top
}

/// A stretch in pieces that are straight enough.
pub(crate) fn straight(path: &[DVec3], radius: f64, found: &mut Vec<Stretch>) {
    let (p, q) = (path[0].truncate(), path[path.len() - 1].truncate());
    let way = (q - p).normalize_or_zero();
    let off = |at: usize| way.perp_dot(path[at].truncate() - p).abs();
    let farthest = (0..path.len()).max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap();
    if off(farthest) > 0.4 * radius && path.len() > 8 {
        straight(&path[..=farthest], radius, found);
        straight(&path[farthest..], radius, found);
    } else if p.distance(q) > 0.3 * radius {
        // However short: gaps of loose cloth show such pieces of the yarns below.
        found.push(Stretch {
            centre: 0.5 * (p + q),
            angle: way.to_angle(),
            length: p.distance(q),
            width: 2.0 * radius,
        });
    }
}

fn one_of_each(mut found: Vec<Stretch>, [a, b]: [DVec2; 2], longest: f64) -> Vec<Stretch> {
    found.sort_by(|p, q| p.centre.length().total_cmp(&q.centre.length()));
    let mut kept: Vec<Stretch> = Vec::new();
    for stretch in found.into_iter().filter(|stretch| stretch.centre.length() < 1.2 * longest) {
        let same = |other: &Stretch| {
            let off = stretch.centre - other.centre;
            let count = DVec2::new(off.perp_dot(b), a.perp_dot(off)) / a.perp_dot(b);
            let off = count - count.round();
            (a * off.x + b * off.y).length() < 0.3 * stretch.width
                && (stretch.length - other.length).abs() < 0.3 * stretch.width
        };
        if !kept.iter().any(same) {
            kept.push(stretch);
        }
    }
    kept
}

/// The layout of a picture as somebody would give it who sees all of it; lightness is what a yarn's
/// mostly is.
pub(crate) fn layout(truth: &Sample) -> GivenLayout {
    let long = truth.stretches.iter().filter(|stretch| stretch.is_long());
    let segment = |&Stretch { centre, angle, length, width }: &Stretch| {
        Segment::straight(centre, angle, width, length, 1.0)
    };
    GivenLayout { cell: truth.lattice, ground: -1.0, segments: long.map(segment).collect() }
}

/// The angle between two directions without a sign, radians.
pub(crate) fn between(a: f64, b: f64) -> f64 {
    let turn = (a - b).rem_euclid(PI);
    turn.min(PI - turn)
}
