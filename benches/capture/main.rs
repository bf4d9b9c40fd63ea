//! How much of a known cloth `capture` finds again, on seeds that it was not tuned on: `cargo bench
//! --bench capture`.
//!
//! In: two dozen drawn pictures of each cloth, 480 pixels each way. Three of four have distortion,
//! noise and uneven light, up to the most that a decent photo has. Out: the tables of
//! docs/capture.md, for layouts, fibres and photos (`-- fibres` prints that one only). Cost:
//! minutes. Nothing runs where arguments name none of its parts, since they are for other benches then.

#![expect(
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "it counts in small numbers, and a failure is a message to us and not to a user"
)]

#[path = "../../tests/it/aperiodic.rs"]
mod aperiodic;
#[path = "../../tests/it/cloth.rs"]
mod cloth;
#[path = "../../tests/it/knit_photo.rs"]
mod knit_photo;
mod knits;

use std::path::Path;
use std::time::Instant;

use aperiodic::{bricks, face, fur, noise};
use cloth::{
    Disturbance, Kind, Random, Sample, Stretch, between, fibrous, layout, sample, straight,
};
use glam::{DMat2, DVec2, DVec3};
use image::RgbImage;
use warpknit::photo::capture::{CaptureSettings, Captured, Lattice, Segment, capture};

/// Seeds below are for tuning. Those of the tests are among them. Those from 2000, 3000 and so on
/// up to 8000 were new once each, and showed what to mend next.
const FIRST_SEED: u64 = 9000;
const PICTURES: u64 = 24;
const SIDE: u32 = 480;
/// A segment that leaves a stretch's direction by more degrees belongs to another yarn.
const NEAR: f64 = 25.0;
/// Intervals between the sample points along a segment.
const STEPS: i32 = 96;

/// What was found in the pictures of one kind of cloth.
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
    let parts = [
        ("layouts", layouts as fn()),
        ("fibres", fibres),
        ("photos", photos),
        ("knits", knits::knits),
    ];
    let names = parts.map(|(part, _)| part);
    let mut filters = std::env::args().skip(1).filter(|word| !word.starts_with('-')).peekable();
    let is_for_others =
        filters.peek().is_some() && !filters.any(|word| names.contains(&word.as_str()));
    if is_for_others {
        return;
    }
    for (_, of) in parts.into_iter().filter(|(part, _)| is_wanted(part, &names)) {
        of();
    }
}

/// Whether a part is to run: one alone if an argument names it, for a person who works on it, and all
/// if none of them is named.
fn is_wanted(part: &str, all: &[&str]) -> bool {
    let is_named = |part: &str| std::env::args().any(|argument| argument == part);
    is_named(part) || !all.iter().any(|part| is_named(part))
}

/// A quarter of the pictures is undisturbed, and another one is disturbed as much as can be.
fn disturbance(seed: u64) -> Disturbance {
    let most = f64::from(u32::try_from(seed % 4).unwrap()) / 3.0;
    Disturbance { distortion: 4.0 * most, noise: 0.03 * most, light: 0.3 * most }
}

/// Accuracy of the twist where the layout is known, by the width of a fibre.
fn fibres() {
    println!(
        "\n| pixels a fibre | degrees off, median | 90th percentile | within 4 degrees | sign \
         right | guesses | fibre's width off | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for fibre in [2.0, 4.0, 6.0, 8.0] {
        let (mut off, mut widths, mut seconds, mut signs, mut guesses) =
            (Vec::new(), Vec::new(), Vec::new(), 0, 0);
        for seed in FIRST_SEED..FIRST_SEED + PICTURES {
            let (truth, degrees) = fibrous(seed, (100.0 * fibre) as u32, fibre, disturbance(seed));
            let settings =
                CaptureSettings { layout: Some(layout(&truth)), ..CaptureSettings::default() };
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
        let measured = off.len();
        let seconds = format!("{:.2}", quantile(&mut seconds, 0.5));
        if measured == 0 {
            println!("| {fibre} | | | | | {} | | {seconds} |", share(guesses, guesses));
            continue;
        }
        let near = off.iter().filter(|off| **off <= 4.0).count();
        println!(
            "| {fibre} | {:.1} | {:.1} | {} | {} | {} | {:.0} % | {seconds} |",
            quantile(&mut off, 0.5),
            quantile(&mut off, 0.9),
            share(near, measured),
            share(signs, measured),
            share(guesses, measured + guesses),
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
        "| cloth | lattice right | vectors off | stretches found | segments wrong | width off | \
         degrees off | widths off across | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut all = Score::default();
    for (name, kind) in [
        ("plain", Kind::Plain),
        ("plain, two colours", Kind::Colored),
        ("twill 2/1", Kind::Twill(2, 1)),
        ("twill 2/2", Kind::Twill(2, 2)),
        ("jersey", Kind::Jersey),
    ] {
        let mut score = Score::default();
        for seed in 0..PICTURES {
            score.take(&sample(kind, FIRST_SEED + seed, SIDE, disturbance(seed)));
        }
        println!("| {name} | {} |", score.row());
        all.add(score);
    }
    println!("| all | {} |", all.row());
    let refused = |images: &dyn Fn(u64) -> RgbImage| {
        (0..PICTURES)
            .filter(|seed| {
                capture(&images(FIRST_SEED + seed), &CaptureSettings::default()).is_err()
            })
            .count()
    };
    let noise = |seed: u64| noise(&mut Random::new(seed), SIDE);
    let grain = |seed: u64| image::imageops::fast_blur(&noise(seed), 1.0 + (seed % 6) as f32);
    println!(
        "\nRefused, of {PICTURES} each: noise {}, noise of a grain {}, fur {}, faces {}, old walls \
         {}",
        refused(&noise),
        refused(&grain),
        refused(&|seed| fur(seed, SIDE)),
        refused(&|seed| face(seed, SIDE)),
        refused(&|seed| bricks(seed, SIDE))
    );
}

/// Photos with a normal map that somebody else made, and how far the captured depth agrees with it.
fn photos() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cloth-photos");
    if !folder.is_dir() {
        println!("\nskipped: no photos in ../shared/cloth-photos");
        return;
    }
    println!(
        "\n| photo | cell, pixels | light and heights correlate | slopes and normal map correlate \
         | seconds |\n|---|---|---|---|---|"
    );
    for (name, normals) in [
        ("cotton_jersey_diff_2k.jpg", "cotton_jersey_nor_gl_2k.jpg"),
        ("rough_linen_diff_2k.jpg", "rough_linen_nor_gl_2k.jpg"),
        ("fabric_pattern_05_col_01_2k.jpg", "fabric_pattern_05_nor_gl_2k.jpg"),
    ] {
        let read = |name: &str| image::open(folder.join(name)).unwrap().to_rgb8();
        let begun = Instant::now();
        match capture(&read(name), &CaptureSettings::default()) {
            Ok(found) => {
                let seconds = begun.elapsed().as_secs_f64();
                let agreement = slopes_agree(&found, &read(normals));
                let [a, b] = [found.unit.lattice.a, found.unit.lattice.b];
                println!(
                    "| {name} | {a:.2} and {b:.2} | {:.2} | {agreement:.2} | {seconds:.1} |",
                    found.correlation()
                );
            }
            Err(error) => println!("| {name} | {error} | | | |"),
        }
    }
}

/// Correlation of the depth's slopes with those of a normal map (OpenGL's: y up), both as means
/// over all copies of the cell.
fn slopes_agree(found: &Captured, normals: &RgbImage) -> f64 {
    const BINS: f64 = 24.0;
    let mut bins = vec![(DVec2::ZERO, DVec2::ZERO, 0.0); (BINS * BINS) as usize];
    let reach = 1200.0 / found.scale;
    let within = |at: f64, corner: f64| at > corner + 2.0 && at < corner + reach - 2.0;
    for (x, y, pixel) in normals.enumerate_pixels() {
        let place = DVec2::new(f64::from(x), f64::from(y));
        if !within(place.x, found.corner.x) || !within(place.y, found.corner.y) {
            continue;
        }
        let [nx, ny, nz] = pixel.0.map(|byte| f64::from(byte) / 127.5 - 1.0);
        let height =
            |x: f64, y: f64| found.height(found.cell_coordinates(place + DVec2::new(x, y)));
        let ours = 0.5
            * DVec2::new(
                height(1.0, 0.0) - height(-1.0, 0.0),
                height(0.0, 1.0) - height(0.0, -1.0),
            );
        let bin = (found.cell_coordinates(place).rem_euclid(DVec2::ONE) * BINS)
            .min(DVec2::splat(BINS - 1.0))
            .floor();
        let bin = &mut bins[(bin.y * BINS + bin.x) as usize];
        *bin = (bin.0 + ours, bin.1 + DVec2::new(-nx, ny) / nz.max(0.2), bin.2 + 1.0);
    }
    let pairs: Vec<(f64, f64)> = bins
        .iter()
        .filter(|bin| bin.2 > 0.0)
        .flat_map(|(ours, theirs, count)| {
            [(ours.x / count, theirs.x / count), (ours.y / count, theirs.y / count)]
        })
        .collect();
    let mean =
        |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
    let (x, y) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let product = |p: &dyn Fn(&(f64, f64)) -> f64, q: &dyn Fn(&(f64, f64)) -> f64| {
        mean(&|pair| p(pair) * q(pair))
    };
    let (ours, theirs) = (|pair: &(f64, f64)| pair.0 - x, |pair: &(f64, f64)| pair.1 - y);
    product(&ours, &theirs) / (product(&ours, &ours) * product(&theirs, &theirs)).sqrt()
}

impl Score {
    fn take(&mut self, truth: &Sample) {
        let begun = Instant::now();
        let found = capture(&truth.image, &CaptureSettings::default());
        self.seconds.push(begun.elapsed().as_secs_f64());
        self.pictures += 1;
        self.stretches += truth.stretches.iter().filter(|stretch| stretch.is_long()).count();
        let Ok(found) = found else { return };
        let Some(off) = lattice_error(&found, truth.lattice) else { return };
        self.lattices += 1;
        self.vectors.push(off);
        let (segments, lattice) = (&found.layout.visible, &found.unit.lattice);
        let stretches = truth.in_cell(&found);
        let hits = |stretch: &Stretch| {
            segments.iter().filter_map(|segment| passes(segment, stretch, lattice)).collect()
        };
        let matches: Vec<Vec<[f64; 3]>> =
            stretches.iter().filter(|stretch| stretch.is_long()).map(hits).collect();
        self.recalled += matches.iter().filter(|hits| !hits.is_empty()).count();
        for hits in matches {
            if let Some([width, turn, off]) = hits.into_iter().min_by(|p, q| p[2].total_cmp(&q[2]))
            {
                self.widths.push(width.abs());
                self.degrees.push(turn.to_degrees());
                self.places.push(off);
            }
        }
        let found: Vec<Stretch> = segments.iter().flat_map(pieces).collect();
        self.segments += found.len();
        let is_true =
            |piece: &&Stretch| stretches.iter().any(|stretch| lies_on(piece, stretch, lattice));
        self.wrong += found.len() - found.iter().filter(is_true).count();
    }

    fn add(&mut self, other: Self) {
        self.pictures += other.pictures;
        self.lattices += other.lattices;
        self.stretches += other.stretches;
        self.recalled += other.recalled;
        self.segments += other.segments;
        self.wrong += other.wrong;
        self.vectors.extend(other.vectors);
        self.widths.extend(other.widths);
        self.degrees.extend(other.degrees);
        self.places.extend(other.places);
        self.seconds.extend(other.seconds);
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

/// Sample points of a segment's axis, with its direction at each.
fn axis(segment: &Segment) -> impl Iterator<Item = (DVec2, f64)> {
    let along = |step: i32| (f64::from(step) / f64::from(STEPS) - 0.5) * segment.length;
    (0..=STEPS).map(move |step| segment.axis(along(step)))
}

/// A segment in pieces that are as straight as the true stretches.
fn pieces(segment: &Segment) -> Vec<Stretch> {
    let path: Vec<DVec3> = axis(segment).map(|(place, _)| place.extend(0.0)).collect();
    let mut pieces = Vec::new();
    straight(&path, 0.5 * segment.width, &mut pieces);
    pieces
}

/// Coordinates of a place along and across a stretch from its middle, and the angle between a
/// direction and it.
fn beside(place: DVec2, angle: f64, stretch: &Stretch, lattice: &Lattice) -> (DVec2, f64) {
    let off = lattice.nearest(place - stretch.centre);
    (DVec2::from_angle(-stretch.angle).rotate(off), between(angle, stretch.angle))
}

/// Whether the middle of a piece lies on a stretch, and the piece runs along it.
fn lies_on(piece: &Stretch, stretch: &Stretch, lattice: &Lattice) -> bool {
    let (off, turn) = beside(piece.centre, piece.angle, stretch, lattice);
    off.x.abs() < 0.5 * stretch.length
        && off.y.abs() < 0.5 * stretch.width
        && turn < NEAR.to_radians()
}

/// Errors of a segment where it passes the middle of a stretch and runs along it: the relative
/// error of the width, the angle between both in radians, and the offset across the stretch in
/// widths. `None` where it doesn't. Directions are those of chords as long as the stretch.
fn passes(segment: &Segment, stretch: &Stretch, lattice: &Lattice) -> Option<[f64; 3]> {
    let places: Vec<(DVec2, f64)> = axis(segment).collect();
    let seen: Vec<(DVec2, f64)> =
        places.iter().map(|&(place, angle)| beside(place, angle, stretch, lattice)).collect();
    let nearest =
        (0..seen.len()).min_by(|&p, &q| seen[p].0.length().total_cmp(&seen[q].0.length()))?;
    let (off, turn) = seen[nearest];
    // The other places relative to the nearest one: all beside the same copy of the stretch.
    let relative =
        |place: &DVec2| off + DVec2::from_angle(-stretch.angle).rotate(*place - places[nearest].0);
    // A chord instead of a tangent: stretches are straight, and segments that fit them are bent.
    let mut chord = places
        .iter()
        .map(|(place, _)| relative(place))
        .filter(|off| off.x.abs() <= 0.5 * stretch.length && off.y.abs() < stretch.width);
    let turn_of_chord = chord
        .next()
        .zip(chord.next_back())
        .map(|(first, last)| between((last - first).to_angle(), 0.0));
    let is_there = off.x.abs() < 0.1 * stretch.length
        && off.y.abs() < 0.5 * stretch.width
        && turn < NEAR.to_radians();
    is_there.then(|| {
        [
            segment.width / stretch.width - 1.0,
            turn_of_chord.unwrap_or(turn),
            off.y.abs() / stretch.width,
        ]
    })
}
