//! How much of a known cloth `capture` finds again, on seeds that nobody tuned it on: `cargo bench --bench capture`.
//!
//! Twelve pictures of each cloth, 480 pixels each way, every other with distortion, noise and uneven light up to the most that a decent photo has. Prints the tables of docs/capture.md:
//! that of layouts, and that of fibres (`-- fibres` prints this one only).

#![expect(
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "it counts in small numbers, and a failure is a message to us and not to a user"
)]

#[path = "../../tests/it/cloth.rs"]
mod cloth;

use std::time::Instant;

use cloth::{Disturbance, Kind, Random, Sample, Stretch, between, fibrous, fur, layout, sample};
use glam::{DMat2, DVec2};
use image::RgbImage;
use warpknit::capture::{Captured, Settings, capture};

/// Seeds below are for tuning, and those of the tests are among them.
const FIRST_SEED: u64 = 2000;
const PICTURES: u64 = 12;
const SIDE: u32 = 480;

/// What was found of one kind of cloth.
#[derive(Default)]
struct Score {
    pictures: usize,
    lattices: usize,
    vectors: Vec<f64>,
    stretches: usize,
    recalled: usize,
    segments: usize,
    wrong: usize,
    widths: Vec<f64>,
    degrees: Vec<f64>,
    places: Vec<f64>,
    seconds: Vec<f64>,
}

fn main() {
    // `cargo test --benches` runs benches too, and this takes minutes.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    if !std::env::args().any(|argument| argument == "fibres") {
        layouts();
    }
    fibres();
}

fn disturbance(seed: u64) -> Disturbance {
    let most = f64::from(u32::try_from(seed % 4).unwrap()) / 3.0;
    Disturbance { distortion: 4.0 * most, noise: 0.03 * most, light: 0.3 * most }
}

/// How well twist is told where the layout is known, by the width of a fibre.
fn fibres() {
    println!(
        "\n| pixels a fibre | degrees off, median | 90th percentile | within 4 degrees | sign right | guesses | fibre's width off | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for fibre in [2.0, 4.0, 6.0, 8.0] {
        let (mut off, mut widths, mut seconds, mut signs, mut guesses) = (Vec::new(), Vec::new(), Vec::new(), 0, 0);
        for seed in FIRST_SEED..FIRST_SEED + PICTURES {
            let (truth, degrees) = fibrous(seed, (100.0 * fibre) as u32, fibre, disturbance(seed));
            let settings = Settings { layout: Some(layout(&truth)), ..Settings::default() };
            let begun = Instant::now();
            let found = capture(&truth.image, &settings).unwrap();
            seconds.push(begun.elapsed().as_secs_f64());
            for twist in &found.twists {
                guesses += usize::from(twist.is_guess);
                if !twist.is_guess {
                    off.push((twist.degrees - degrees).abs());
                    widths.push((twist.fibre_px / fibre - 1.0).abs());
                    signs += usize::from(twist.degrees * degrees > 0.0);
                }
            }
        }
        let told = off.len();
        let seconds = format!("{:.2}", quantile(&mut seconds, 0.5));
        if told == 0 {
            println!("| {fibre} | | | | | {} | | {seconds} |", share(guesses, guesses));
            continue;
        }
        let near = off.iter().filter(|off| **off <= 4.0).count();
        println!(
            "| {fibre} | {:.1} | {:.1} | {} | {} | {} | {:.0} % | {seconds} |",
            quantile(&mut off, 0.5),
            quantile(&mut off, 0.9),
            share(near, told),
            share(signs, told),
            share(guesses, told + guesses),
            100.0 * quantile(&mut widths, 0.5),
        );
    }
}

fn share(part: usize, whole: usize) -> String {
    format!("{:.0} %", 100.0 * part as f64 / whole.max(1) as f64)
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN)
}

fn layouts() {
    println!(
        "| cloth | lattice right | vectors off | stretches found | segments wrong | width off | degrees off | widths off across | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, kind) in
        [("plain", Kind::Plain), ("twill 2/1", Kind::Twill(2, 1)), ("twill 2/2", Kind::Twill(2, 2)), ("jersey", Kind::Jersey)]
    {
        let mut score = Score::default();
        for seed in 0..PICTURES {
            score.take(&sample(kind, FIRST_SEED + seed, SIDE, disturbance(seed)));
        }
        println!("| {name} | {} |", score.row());
    }
    let refused = |images: &dyn Fn(u64) -> RgbImage| {
        (0..PICTURES).filter(|seed| capture(&images(FIRST_SEED + seed), &Settings::default()).is_err()).count()
    };
    let noise = |seed: u64| {
        let mut random = Random::new(seed);
        RgbImage::from_fn(SIDE, SIDE, |_, _| image::Rgb([(128.0 + 40.0 * random.bell()) as u8; 3]))
    };
    let grain = |seed: u64| image::imageops::fast_blur(&noise(seed), 1.0 + (seed % 6) as f32);
    println!(
        "\nRefused, of {PICTURES} each: noise {}, noise of a grain {}, fur {}",
        refused(&noise),
        refused(&grain),
        refused(&|seed| fur(seed, SIDE))
    );
}

impl Score {
    fn take(&mut self, truth: &Sample) {
        let begun = Instant::now();
        let found = capture(&truth.image, &Settings::default());
        self.seconds.push(begun.elapsed().as_secs_f64());
        self.pictures += 1;
        let wanted: Vec<&Stretch> = truth.stretches.iter().filter(|stretch| stretch.length > 0.8 * stretch.width).collect();
        self.stretches += wanted.len();
        let Ok(found) = found else { return };
        let Some(off) = lattice_error(&found, truth.lattice) else { return };
        self.lattices += 1;
        self.vectors.push(off);
        let matches: Vec<Vec<[f64; 3]>> = wanted.iter().map(|stretch| hits(&found, stretch)).collect();
        self.recalled += matches.iter().filter(|hits| !hits.is_empty()).count();
        for hits in matches {
            if let Some([width, turn, off]) = hits.into_iter().min_by(|p, q| p[2].total_cmp(&q[2])) {
                self.widths.push(width.abs());
                self.degrees.push(turn.to_degrees());
                self.places.push(off);
            }
        }
        self.segments += found.layout.seen.len();
        let is_true = |number: usize| truth.stretches.iter().any(|stretch| hit(&found, number, stretch).is_some());
        self.wrong += (0..found.layout.seen.len()).filter(|&number| !is_true(number)).count();
    }

    fn row(&mut self) -> String {
        let median = |values: &mut Vec<f64>| quantile(values, 0.5);
        [
            share(self.lattices, self.pictures),
            format!("{:.2} %", 100.0 * median(&mut self.vectors)),
            share(self.recalled, self.stretches),
            share(self.wrong, self.segments),
            format!("{:.1} %", 100.0 * median(&mut self.widths)),
            format!("{:.1}", median(&mut self.degrees)),
            format!("{:.2}", median(&mut self.places)),
            format!("{:.1}", median(&mut self.seconds)),
        ]
        .join(" | ")
    }
}

/// The larger share by which a vector is off, if both span the same lattice.
fn lattice_error(found: &Captured, truth: [DVec2; 2]) -> Option<f64> {
    let matrix = found.unit.lattice.matrix();
    let counts = truth.map(|vector| (matrix.inverse() * vector).round());
    let off = [0, 1].map(|n| (matrix * counts[n]).distance(truth[n]) / truth[n].length());
    let is_same = DMat2::from_cols(counts[0], counts[1]).determinant().abs() == 1.0;
    Some(off[0].max(off[1])).filter(|off| is_same && *off < 0.1)
}

fn hits(found: &Captured, stretch: &Stretch) -> Vec<[f64; 3]> {
    (0..found.layout.seen.len()).filter_map(|number| hit(found, number, stretch)).collect()
}

/// Share by which a segment is too wide, radians and widths off across, if it lies on a stretch and runs along it.
fn hit(found: &Captured, number: usize, stretch: &Stretch) -> Option<[f64; 3]> {
    let segment = &found.layout.seen[number];
    let off = found.unit.lattice.nearest(segment.centre + found.corner - stretch.centre);
    let off = DVec2::from_angle(-stretch.angle).rotate(off);
    let turn = between(segment.angle, stretch.angle);
    let lies_on = off.x.abs() < 0.5 * stretch.length && off.y.abs() < 0.5 * stretch.width;
    (lies_on && turn < 25_f64.to_radians()).then(|| [segment.width / stretch.width - 1.0, turn, off.y.abs() / stretch.width])
}
