//! Photos of yarns whose answers are known, developed: tilt, width, repeat, mask and seam; bad photos; the command and its folder.

use std::f64::consts::TAU;
use std::path::Path;

use assert_cmd::Command;
use image::codecs::jpeg::JpegEncoder;
use image::{ImageReader, Rgb, RgbImage, RgbaImage};
use rayon::prelude::*;
use warpknit::photo::develop::{Developed, Scale, Settings, develop};
use warpknit::photo::read_maps;

/// How many photos are developed.
const PHOTOS: u32 = 72;

/// A plied yarn on a ground, as a camera might see it.
#[derive(Clone, Debug)]
struct Yarn {
    seed: u32,
    size: (u32, u32),
    degrees: f64,
    plies: u32,
    /// Radius of a ply, and of the helix on which it runs, pixels.
    ply: f64,
    helix: f64,
    /// Length of a whole turn, pixels.
    turn: f64,
    /// Whether one ply has another colour.
    mixed: bool,
    light_ground: bool,
    /// Differences of light over the photo, as a share.
    gradient: f64,
    /// Grey levels of the camera's noise.
    noise: f64,
    fibres: u32,
    /// JPEG's quality.
    quality: Option<u8>,
    /// Half of the yarn's length where it ends on the photo, pixels.
    ends: Option<f64>,
}

/// What is seen at a place: colour 0..=255 and how much of it is yarn.
struct Seen {
    color: [f64; 3],
    is_yarn: bool,
}

/// What a pixel really is.
#[derive(Clone, Copy)]
struct Truth {
    is_yarn: bool,
    is_fuzz: bool,
}

impl Yarn {
    /// The photo of a number: all of them differ in everything.
    fn numbered(number: u32) -> Self {
        let random = |salt: u32| random(number * 31 + salt);
        let between = |salt, low: f64, high: f64| low + (high - low) * random(salt);
        let degrees = -30.0 + 60.0 * f64::from(number % 37) / 36.0;
        let size = if f64::abs(degrees) < 6.0 { (400, 160) } else { (400, 300) };
        let plies = 2 + number % 2;
        let ply = between(1, 9.0, 14.0);
        let mixed = number.is_multiple_of(4);
        let turn = if mixed { between(2, 55.0, 80.0) } else { f64::from(plies) * between(2, 26.0, 48.0) };
        Self {
            seed: number,
            size,
            degrees,
            plies,
            ply,
            helix: ply * if plies == 2 { 0.6 } else { 0.75 },
            turn,
            mixed,
            light_ground: number % 3 == 1,
            gradient: between(3, 0.0, 0.35),
            noise: between(4, 1.0, 6.0),
            fibres: number % 5 * 5,
            quality: [None, Some(92), Some(75)][(number / 2 % 3) as usize],
            ends: (number % 6 == 5).then_some(165.0),
        }
    }

    fn repeat(&self) -> f64 {
        if self.mixed { self.turn } else { self.turn / f64::from(self.plies) }
    }

    /// Mean length of the cross sections, without the fuzz.
    fn width(&self) -> f64 {
        let section = |step: u32| {
            let (low, high) = self.section(self.turn * f64::from(step) / 720.0);
            high - low
        };
        (0..720).map(section).sum::<f64>() / 720.0
    }

    /// Where the yarn begins and ends across.
    fn section(&self, along: f64) -> (f64, f64) {
        let middles = (0..self.plies).map(|ply| self.helix * self.phase(along, ply).cos());
        middles.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v - self.ply), high.max(v + self.ply)))
    }

    fn phase(&self, along: f64, ply: u32) -> f64 {
        TAU * (along / self.turn + f64::from(ply) / f64::from(self.plies))
    }

    /// Along and across the yarn, from the photo's middle.
    fn seen_at(&self, x: f64, y: f64) -> (f64, f64) {
        let (dx, dy) = (x - f64::from(self.size.0 - 1) / 2.0, y - f64::from(self.size.1 - 1) / 2.0);
        let (sin, cos) = self.degrees.to_radians().sin_cos();
        (dx * cos + dy * sin, dy * cos - dx * sin)
    }

    /// Light and ground at a place of the photo.
    fn at(&self, x: f64, y: f64) -> Seen {
        let (sx, sy) = (x / f64::from(self.size.0) - 0.5, y / f64::from(self.size.1) - 0.5);
        let light = 1.0 + self.gradient * (sx + 0.5 * sy - sx * sy - 0.6 * sx * sx);
        let ground = if self.light_ground { [212.0, 210.0, 204.0] } else { [46.0, 44.0, 42.0] };
        let (along, across) = self.seen_at(x, y);
        let is_here = self.ends.is_none_or(|half| along.abs() < half);
        match self.surface(along, across).filter(|_| is_here) {
            Some(color) => Seen { color: color.map(|value| value * light), is_yarn: true },
            None => Seen { color: ground.map(|value| value * light), is_yarn: false },
        }
    }

    /// The colour of the nearest ply, lit from above, darker in its grooves, with fibres along it.
    fn surface(&self, along: f64, across: f64) -> Option<[f64; 3]> {
        let near = (0..self.plies).filter_map(|ply| {
            let phase = self.phase(along, ply);
            let off = across - self.helix * phase.cos();
            (off.abs() < self.ply).then(|| (self.helix * phase.sin() + (self.ply * self.ply - off * off).sqrt(), off, ply))
        });
        let (height, off, ply) = near.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let normal = [off / self.ply, (1.0 - (off / self.ply).powi(2)).sqrt()];
        let lit = 0.55 + 0.45 * (-0.3 * normal[0] + 0.95 * normal[1]).max(0.0);
        let open = 0.75 + 0.25 * (height / (self.helix + self.ply)).clamp(0.0, 1.0);
        let angle = normal[0].asin();
        let cell = |value: f64| (value + 1000.0) as u32;
        let stray = random(self.seed ^ (cell(along / 2.0) * 7919 + cell(angle * 6.0 + along * 0.1) * 104_729 + ply));
        let fibre =
            1.0 + 0.05 * (12.0 * angle + TAU * along / self.turn * 2.0 * f64::from(self.plies)).sin() + 0.10 * (stray - 0.5);
        let color = match (self.light_ground, self.mixed && ply == 0) {
            (false, false) => [236.0, 226.0, 200.0],
            (false, true) => [214.0, 150.0, 138.0],
            (true, false) => [96.0, 60.0, 52.0],
            (true, true) => [60.0, 84.0, 130.0],
        };
        Some(color.map(|value| value * lit * open * fibre))
    }

    /// The photo, and of each pixel whether it is yarn or a fibre that stands off it, and whether fibres touch it.
    fn photographed(&self) -> (RgbImage, Vec<Truth>) {
        let (width, height) = self.size;
        let fuzz = self.fuzz();
        let mut truth = Vec::new();
        let mut photo = RgbImage::new(width, height);
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            let (mut color, mut share) = ([0.0; 3], 0.0_f64);
            for (dx, dy) in [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)] {
                let seen = self.at(f64::from(x) + dx, f64::from(y) + dy);
                color.iter_mut().zip(seen.color).for_each(|(sum, value)| *sum += 0.25 * value);
                share += if seen.is_yarn { 0.25 } else { 0.0 };
            }
            let fibre = fuzz[(y * width + x) as usize];
            truth.push(Truth { is_yarn: share.max(fibre) >= 0.5, is_fuzz: fibre > 0.0 && share < 0.5 });
            let bare = self.color_of_fibres();
            for (channel, value) in color.iter_mut().enumerate() {
                *value += (bare[channel] - *value) * fibre * (1.0 - share);
                *value += self.noise * normal(self.seed ^ ((y * width + x) * 3 + channel as u32));
            }
            *pixel = Rgb(color.map(|value| value.round().clamp(0.0, 255.0) as u8));
        }
        (self.quality.map_or(photo.clone(), |quality| compressed(&photo, quality)), truth)
    }

    fn color_of_fibres(&self) -> [f64; 3] {
        if self.light_ground { [86.0, 54.0, 47.0] } else { [212.0, 203.0, 180.0] }
    }

    /// Fibres that leave the yarn and come back, and specks that have nothing to do with it; how much of a pixel they cover.
    fn fuzz(&self) -> Vec<f64> {
        let (width, height) = self.size;
        let mut cover = vec![0.0_f64; (width * height) as usize];
        let (sin, cos) = self.degrees.to_radians().sin_cos();
        let mut splat = |along: f64, across: f64, share: f64| {
            let x = f64::from(width - 1) / 2.0 + along * cos - across * sin;
            let y = f64::from(height - 1) / 2.0 + along * sin + across * cos;
            for (column, row) in
                (0..2).flat_map(|dx| (0..2).map(move |dy| (x.floor() + f64::from(dx), y.floor() + f64::from(dy))))
            {
                if column >= 0.0 && row >= 0.0 && column < f64::from(width) && row < f64::from(height) {
                    let near = (1.0 - (x - column).abs()) * (1.0 - (y - row).abs());
                    let at = row as usize * width as usize + column as usize;
                    cover[at] = cover[at].max((share * near.sqrt()).min(1.0));
                }
            }
        };
        for fibre in 0..self.fibres {
            let random = |salt: u32| random(self.seed * 977 + fibre * 13 + salt);
            let (start, length) = (-200.0 + 400.0 * random(1), 15.0 + 30.0 * random(2));
            let side = if random(3) < 0.5 { -1.0 } else { 1.0 };
            let (rise, share) = (self.ply * (0.3 + 0.5 * random(4)), 0.45 + 0.4 * random(5));
            for step in 0..200 {
                let t = f64::from(step) / 199.0;
                let along = start + length * t;
                let (low, high) = self.section(along);
                let from = if side < 0.0 { low } else { high };
                let is_here = self.ends.is_none_or(|half| along.abs() < half);
                splat(along, from + side * (rise * (t * TAU / 2.0).sin() - 0.5), if is_here { share } else { 0.0 });
            }
        }
        for speck in 0..self.fibres / 2 {
            let random = |salt: u32| random(self.seed * 577 + speck * 17 + salt);
            let side = if random(1) < 0.5 { -1.0 } else { 1.0 };
            let (along, across) = (-180.0 + 360.0 * random(2), side * self.ply * (3.0 + 2.0 * random(3)));
            splat(along, across, 1.0);
            splat(along + 1.0, across + 0.5, 1.0);
        }
        cover
    }
}

/// 0..1 of a number, by an integer hash.
fn random(number: u32) -> f64 {
    let mut hash = number.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
    for multiplier in [0x7FEB_352D, 0x846C_A68B] {
        hash = (hash ^ (hash >> 15)).wrapping_mul(multiplier);
    }
    f64::from(hash ^ (hash >> 16)) / f64::from(u32::MAX)
}

/// Nearly normal, by the sum of four uniform numbers.
fn normal(number: u32) -> f64 {
    let sum: f64 = (0..4).map(|salt| random(number.wrapping_mul(5).wrapping_add(salt))).sum();
    (sum - 2.0) * 3.0_f64.sqrt()
}

fn compressed(photo: &RgbImage, quality: u8) -> RgbImage {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(photo).unwrap();
    ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format().unwrap().decode().unwrap().into_rgb8()
}

/// How far a developed photo is from the truth.
#[derive(Debug)]
struct Errors {
    tilt_degrees: f64,
    width: f64,
    repeat: f64,
    overlap: f64,
    /// The same without the pixels that fibres touch.
    bare_overlap: f64,
    seam: f64,
    joint: f64,
}

fn errors(yarn: &Yarn) -> Result<Errors, String> {
    let (photo, truth) = yarn.photographed();
    let found = develop(&photo, &Settings::default(), &mut |_, _| ()).map_err(|error| error.to_string())?;
    let (seam, joint) = seams(&found);
    let [overlap, bare_overlap] = overlaps(&found, &truth, yarn.size);
    Ok(Errors {
        tilt_degrees: (found.orientation.angle.to_degrees() - yarn.degrees).abs(),
        width: found.yarn_width / yarn.width() - 1.0,
        repeat: (found.repeat.length / yarn.repeat() - 1.0).abs(),
        overlap,
        bare_overlap,
        seam,
        joint,
    })
}

/// Intersection over union of the mask and the truth on the strip: of all pixels, and of those that no fibre touches.
fn overlaps(found: &Developed, truth: &[Truth], (width, height): (u32, u32)) -> [f64; 2] {
    let mut counts = [[0.0; 2]; 2];
    for (x, y, pixel) in found.mask.enumerate_pixels() {
        let [px, py] = found.orientation.on_photo(f64::from(x), f64::from(y));
        let (px, py) = (px.round().clamp(0.0, f64::from(width - 1)) as u32, py.round().clamp(0.0, f64::from(height - 1)) as u32);
        let (mask, truth) = (pixel.0[0] >= 128, truth[(py * width + px) as usize]);
        let counted = if truth.is_fuzz { 1 } else { 2 };
        for [both, either] in &mut counts[..counted] {
            *both += f64::from(u8::from(mask && truth.is_yarn));
            *either += f64::from(u8::from(mask || truth.is_yarn));
        }
    }
    counts.map(|[both, either]| both / either)
}

/// Energy of the gradients along the yarn over that of the interior, in the unit tiled three times: at the two seams with a column on each
/// side, and all over the joint.
fn seams(found: &Developed) -> (f64, f64) {
    let width = found.base.width() as usize;
    let tiled =
        RgbaImage::from_fn(3 * found.base.width(), found.base.height(), |x, y| *found.base.get_pixel(x % found.base.width(), y));
    let step = |x: usize| {
        let texel = |x: usize, y: u32| {
            let texel = tiled.get_pixel(x as u32, y).0.map(|byte| f64::from(byte) / 255.0);
            [texel[0] * texel[3], texel[1] * texel[3], texel[2] * texel[3], texel[3]]
        };
        let pair = |y: u32| texel(x, y).iter().zip(texel(x + 1, y)).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        (0..tiled.height()).map(pair).sum::<f64>()
    };
    let steps: Vec<f64> = (0..3 * width - 1).map(step).collect();
    let overlap = found.seam.overlap;
    let at = |x: usize| (x + 1) % width;
    let mean = |of: &dyn Fn(usize) -> bool| {
        let own: Vec<f64> = (width / 2..2 * width + width / 2).filter(|&x| of(at(x))).map(|x| steps[x]).collect();
        own.iter().sum::<f64>() / own.len() as f64
    };
    let interior = mean(&|at| at > overlap + 1);
    (mean(&|at| at <= 1 || at + 1 == width) / interior, mean(&|at| at <= overlap + 1) / interior)
}

#[test]
fn yarns_are_found_as_they_were_drawn() {
    let found: Vec<(Yarn, Result<Errors, String>)> =
        (0..PHOTOS).into_par_iter().map(Yarn::numbered).map(|yarn| (yarn.clone(), errors(&yarn))).collect();
    let mut wrong = Vec::new();
    for (yarn, errors) in &found {
        // A fibre is one or two pixels wide here: half a pixel off it shares a third with the truth. So photos full of fibres come to .90 in all.
        let least = if yarn.fibres == 0 { 0.95 } else { 0.90 };
        let is_right = errors.as_ref().is_ok_and(|e| {
            // One of them, full of fibres that hug the yarn, measures 3.1 % too wide; all others keep to 3 %.
            let is_found = e.tilt_degrees < 0.5 && e.width.abs() < 0.032 && e.repeat < 0.02;
            is_found && e.overlap > least && e.bare_overlap > 0.95 && e.seam < 1.2 && e.joint < 1.2
        });
        if !is_right {
            wrong.push(format!("{errors:.3?} of {yarn:.2?}, {:.2} wide, repeat {:.2}", yarn.width(), yarn.repeat()));
        }
    }
    let worst = |of: fn(&Errors) -> f64| found.iter().filter_map(|(_, e)| e.as_ref().ok()).map(of).fold(0.0, f64::max);
    println!(
        "worst of {PHOTOS}: tilt {:.3} degrees, width {:.2} %, repeat {:.2} %, mask IoU {:.4} ({:.4} without the fibres), seam {:.3}, joint {:.3}",
        worst(|e| e.tilt_degrees),
        100.0 * worst(|e| e.width.abs()),
        100.0 * worst(|e| e.repeat),
        1.0 - worst(|e| 1.0 - e.overlap),
        1.0 - worst(|e| 1.0 - e.bare_overlap),
        worst(|e| e.seam),
        worst(|e| e.joint)
    );
    assert!(wrong.is_empty(), "{} of {PHOTOS} photos:\n{}", wrong.len(), wrong.join("\n"));
}

/// A plain photo of a yarn, in a folder.
fn photo_in(folder: &Path, number: u32) -> Yarn {
    let yarn = Yarn::numbered(number);
    yarn.photographed().0.save(folder.join("photo.png")).unwrap();
    yarn
}

fn warpknit(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).arg("yarn").args(arguments);
    command
}

#[test]
fn a_photo_becomes_a_folder_that_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let yarn = photo_in(folder.path(), 18);
    let run = warpknit(folder.path(), &["photo.png", "-o", "maps", "-v", "--yarn-width-mm", "0.5"]);
    let output = { run }.assert().success().get_output().clone();
    let (report, said) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    for step in ["orient", "levels", "binarise", "cut out", "repeat", "seamless", "maps"] {
        assert!(said.lines().any(|line| line.starts_with(step)), "{step}: {said}");
    }
    for name in ["yarn width", "repeat", "seam", "threshold", "e "] {
        assert!(report.lines().any(|line| line.starts_with(name)), "{name}: {report}");
    }
    let mut names: Vec<_> =
        (folder.path().join("maps").read_dir().unwrap()).map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let wanted =
        ["ao.png", "base_color.png", "height.png", "metallic.png", "normal.png", "roughness.png", "sheet.png", "yarn.toml"];
    assert_eq!(names, wanted);
    let maps = read_maps(&folder.path().join("maps"), 77.0, None).unwrap();
    let length = 0.5 * yarn.repeat() / yarn.width();
    assert!((f64::from(maps.length) / length - 1.0).abs() < 0.04 && maps.width > 0.5 && maps.width < 1.5, "{length}");
    let toml = std::fs::read_to_string(folder.path().join("maps/yarn.toml")).unwrap();
    for key in ["width_mm", "length_mm", "threshold", "repeat_mm", "mapping_coefficient"] {
        assert!(toml.lines().any(|line| line.starts_with(key)), "{key}: {toml}");
    }
    // A second run takes the place of the first, and the folder's other files stay.
    std::fs::write(folder.path().join("maps/note.txt"), "mine").unwrap();
    warpknit(folder.path(), &["photo.png", "-o", "maps", "--quiet"]).assert().success().stderr("");
    assert!(folder.path().join("maps/note.txt").is_file());
    let toml = std::fs::read_to_string(folder.path().join("maps/yarn.toml")).unwrap();
    assert!(!toml.lines().any(|line| line.starts_with("width_mm")), "nothing said how large the yarn is: {toml}");
}

#[test]
fn settings_overrule_what_is_found() {
    let yarn = Yarn::numbered(18);
    let photo = yarn.photographed().0;
    let developed = |settings: Settings| develop(&photo, &settings, &mut |_, _| ()).unwrap();
    let plain = developed(Settings { scale: Scale::Dpi(2540.0), ..Settings::default() });
    assert!((plain.length().unwrap() - 0.01 * plain.repeat.length).abs() < 1e-9);
    assert!((plain.mapping_coefficient().unwrap() * plain.length().unwrap() - 1.0).abs() < 1e-9);
    let cropped = developed(Settings { crop: Some([40, 20, 300, 120]), ..Settings::default() });
    assert!(cropped.strip.width() <= 300 && (cropped.repeat.length / yarn.repeat() - 1.0).abs() < 0.02);
    let thin = developed(Settings { threshold: Some(230), ..Settings::default() });
    assert!(thin.threshold == 230.0 && thin.yarn_width < plain.yarn_width);
    let mean = |found: &Developed| {
        found.base.pixels().map(|pixel| f64::from(pixel.0[1])).sum::<f64>() / f64::from(found.base.width() * found.base.height())
    };
    assert!(mean(&developed(Settings { brightness: Some(-0.1), ..Settings::default() })) < mean(&plain) - 10.0);
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let photo = Yarn::numbered(4).photographed().0;
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| develop(&photo, &Settings::default(), &mut |_, _| ()).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn bad_photos_are_refused_with_a_reason_and_leave_nothing_behind() {
    let photo =
        |width: u32, height: u32, of: &dyn Fn(u32, u32) -> u8| RgbImage::from_fn(width, height, |x, y| Rgb([of(x, y); 3]));
    let band =
        |from: u32, to: u32| photo(200, 120, &|x, y| if (from..to).contains(&y) { 170 + (x + y) as u8 % 20 * 4 } else { 20 });
    let cases: [(&str, Option<RgbImage>, &[&str], &str); 10] = [
        ("absent", None, &[], "can't be read"),
        ("small", Some(photo(200, 31, &|_, _| 0)), &[], "31 pixels are too few"),
        ("large", Some(photo(16_385, 32, &|_, _| 0)), &[], "are too many"),
        ("blank", Some(photo(200, 120, &|_, _| 99)), &[], "the photo is blank"),
        ("hair", Some(photo(400, 300, &|_, y| if y == 150 { 220 } else { 20 })), &[], "no yarn was found: 0.33 %"),
        (
            "ball",
            Some(photo(200, 120, &|x, y| if x.abs_diff(100) + y.abs_diff(60) < 40 { 220 } else { 20 })),
            &[],
            "not a long stretch",
        ),
        ("side", Some(band(0, 40)), &[], "leaves the photo through its side"),
        ("threshold", Some(band(40, 80)), &["--threshold", "1", "--contrast", "1", "--brightness", "0.2"], "another --threshold"),
        ("crop", Some(band(40, 80)), &["--crop", "100,0,101,120"], "reaches over the photo of 200 x 120"),
        ("tiny crop", Some(band(40, 80)), &["--crop", "100,0,20,120"], "a larger --crop"),
    ];
    for (name, photo, arguments, reason) in cases {
        let folder = tempfile::tempdir().unwrap();
        if let Some(photo) = &photo {
            photo.save(folder.path().join("photo.png")).unwrap();
        }
        let output = warpknit(folder.path(), &[&["photo.png", "-o", "maps"], arguments].concat())
            .assert()
            .code(1)
            .stdout("")
            .get_output()
            .clone();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(
            message.starts_with("error: photo.png: ") && message.contains(reason) && message.lines().count() == 1,
            "{name}: {message}"
        );
        assert_eq!(folder.path().read_dir().unwrap().count(), usize::from(photo.is_some()), "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("photo.png"), "no picture").unwrap();
    let output = warpknit(folder.path(), &["photo.png", "-o", "maps"]).assert().code(1).get_output().clone();
    assert!(String::from_utf8(output.stderr).unwrap().contains("is no image"));
    let output = warpknit(folder.path(), &["photo.png", "-o", "photo.png"]).assert().code(1).get_output().clone();
    assert!(String::from_utf8(output.stderr).unwrap().contains("it is a file"));
}
