//! Draws the yarn textures in `meshes/yarns/`, for `--texture` and for the `texture` of a fabric's
//! yarns.
//!
//!     cargo run --release --example make_yarns
//!
//! In: the parameters in [`YARNS`]. Out: a colour map and a height map of one repeat of each yarn,
//! x along the yarn and y across it. A procedural model draws round plies on helices, fibres in
//! them, loops of an effect yarn, and fuzz that thins out to both sides. Its random numbers come
//! from a hash, so the bytes are the same each time.

use std::error::Error;
use std::f32::consts::{PI, TAU};
use std::path::Path;

use image::imageops::{FilterType, resize};
use image::{GrayImage, Luma, Rgba, RgbaImage};
use warpknit::render::ply::hash;

/// Texels along one repeat, and across the yarn with its fuzz.
const SIZE: (u32, u32) = (384, 192);
/// Supersampling: the picture is drawn so many times finer each way and then reduced.
const FINER: u32 = 2;
/// Discs that a stroke is drawn with. Fewer would leave gaps in long strokes.
const STEPS: u32 = 600;
/// Fibre segments along a repeat; staple fibres end within it.
const PIECES: f32 = 9.0;
/// Range of a single fibre's brightness, as a share of the yarn's colour.
const SHADE: f32 = 0.16;
/// Largest distance of a fibre from the axis, in halves of the width. Less than 1, so that the
/// picture's border is transparent.
const FARTHEST: f32 = 0.96;

/// A yarn to draw.
struct Yarn {
    name: &'static str,
    plies: u32,
    /// Share of the picture's width that the plies take. The rest is fuzz, and loops if there are
    /// any.
    core: f32,
    /// sRGB colours of its fibres, equally frequent.
    colors: &'static [[f32; 3]],
    /// Number of fibres around a ply.
    fibres: f32,
    /// Number of stray fibres in the fuzz of one repeat.
    strays: u32,
    /// Number of loops that an effect yarn makes in one repeat.
    loops: u32,
    /// Width with the fuzz, mm.
    width: f32,
    /// Length of one repeat, mm.
    length: f32,
}

const YARNS: [Yarn; 5] = [
    Yarn {
        name: "spun",
        plies: 1,
        core: 0.62,
        colors: &[[206.0, 190.0, 168.0]],
        fibres: 40.0,
        strays: 110,
        loops: 0,
        width: 0.25,
        length: 1.1,
    },
    Yarn {
        name: "two-ply",
        plies: 2,
        core: 0.72,
        colors: &[[214.0, 196.0, 164.0]],
        fibres: 26.0,
        strays: 60,
        loops: 0,
        width: 0.13,
        length: 0.26,
    },
    Yarn {
        name: "three-ply",
        plies: 3,
        core: 0.72,
        colors: &[[150.0, 66.0, 60.0]],
        fibres: 24.0,
        strays: 60,
        loops: 0,
        width: 0.13,
        length: 0.3,
    },
    Yarn {
        name: "melange",
        plies: 2,
        core: 0.68,
        colors: &[
            [58.0, 62.0, 70.0],
            [110.0, 114.0, 120.0],
            [196.0, 196.0, 192.0],
            [236.0, 232.0, 224.0],
        ],
        fibres: 30.0,
        strays: 80,
        loops: 0,
        width: 0.23,
        length: 0.5,
    },
    Yarn {
        name: "boucle",
        plies: 2,
        core: 0.26,
        colors: &[[120.0, 140.0, 128.0]],
        fibres: 16.0,
        strays: 50,
        loops: 16,
        width: 0.5,
        length: 1.5,
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    for yarn in &YARNS {
        let folder = Path::new("meshes/yarns").join(yarn.name);
        std::fs::create_dir_all(&folder)?;
        let (color, height) = yarn.pictures();
        color.save(folder.join("base_color.png"))?;
        height.save(folder.join("height.png"))?;
        std::fs::write(folder.join("yarn.toml"), yarn.sizes())?;
    }
    Ok(())
}

/// Colour, alpha and height of a texel.
#[derive(Clone, Copy)]
struct Point {
    rgb: [f32; 3],
    alpha: f32,
    /// Height over the axis, in halves of the picture's width: 0..1.
    height: f32,
}

impl Point {
    fn color(&self) -> Rgba<u8> {
        let [r, g, b] = self.rgb.map(byte);
        Rgba([r, g, b, byte(255.0 * self.alpha)])
    }
}

/// The picture while it is drawn.
struct YarnImage {
    points: Vec<Point>,
}

/// A fibre or a yarn that is drawn along a path.
struct Stroke {
    /// Half its thickness, in halves of the picture's width.
    radius: f32,
    alpha: f32,
    /// Seed of its fibres' colours.
    seed: u32,
}

impl Yarn {
    /// The colour map and the height map.
    fn pictures(&self) -> (RgbaImage, GrayImage) {
        let image = self.drawn();
        let fine = (FINER * SIZE.0, FINER * SIZE.1);
        let color = RgbaImage::from_fn(fine.0, fine.1, |x, y| image.at(x, y).color());
        let height =
            GrayImage::from_fn(fine.0, fine.1, |x, y| Luma([byte(255.0 * image.at(x, y).height)]));
        (
            resize(&color, SIZE.0, SIZE.1, FilterType::Triangle),
            resize(&height, SIZE.0, SIZE.1, FilterType::Triangle),
        )
    }

    /// The text of yarn.toml.
    fn sizes(&self) -> String {
        format!("width_mm = {}\nlength_mm = {}\n", self.width, self.length)
    }

    /// Draws the yarn: plies first, then stray fibres and loops over them.
    fn drawn(&self) -> YarnImage {
        let (width, height) = (FINER * SIZE.0, FINER * SIZE.1);
        let share = 1.0 / self.colors.iter().map(|_| 1.0).sum::<f32>();
        let mean = [0, 1, 2].map(|c| self.colors.iter().map(|color| share * color[c]).sum());
        // Transparent texels have the mean colour: filtering would otherwise mix black into the
        // fuzz.
        let empty = Point { rgb: mean, alpha: 0.0, height: 0.0 };
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let mut image = YarnImage {
            points: places.map(|(x, y)| self.core_at(x, y).unwrap_or(empty)).collect(),
        };
        (0..self.strays).for_each(|stray| self.stray(stray, &mut image));
        (0..self.loops).for_each(|number| self.effect_loop(number, &mut image));
        image
    }

    /// The uppermost ply at a texel. Plies are round cylinders on helices around the axis and touch
    /// each other there.
    fn core_at(&self, x: u32, y: u32) -> Option<Point> {
        let turn = (to_float(x) + 0.5) / to_float(FINER * SIZE.0);
        let across = ((to_float(y) + 0.5) / to_float(FINER * SIZE.1) * 2.0 - 1.0) / self.core;
        let helix = if self.plies == 1 { 0.0 } else { 0.5 };
        let radius = 1.0 - helix;
        let near = (0..self.plies).filter_map(|ply| {
            // The ply's centre in this cross section: cos across, sin in height.
            let phase = TAU * (turn + to_float(ply) / to_float(self.plies));
            let off = (across - helix * phase.cos()) / radius;
            let round = (1.0 - off * off).max(0.0).sqrt();
            (off.abs() < 1.0).then_some((helix * phase.sin() + radius * round, off, round, ply))
        });
        let (height, off, round, ply) = near.max_by(|a, b| a.0.total_cmp(&b.0))?;
        // In a single yarn the fibres show the twist. Plied yarns are twisted against their
        // singles, so that their fibres lie nearly along the axis.
        let wound = if self.plies == 1 { 1.0 } else { -1.0 };
        let fibre = self.fibre(off.asin() / TAU + wound * turn, turn, ply);
        // Shading as in a photo: flanks and grooves between plies receive less light.
        let light = (0.66 + 0.34 * round) * (0.8 + 0.2 * (0.5 + 0.5 * height));
        let ridge = 0.97 + 0.06 * (fibre.1 - 0.5);
        Some(Point {
            rgb: fibre.0.map(|c| c * light),
            alpha: 1.0,
            height: (height * self.core * ridge).clamp(0.0, 1.0),
        })
    }

    /// Colour and brightness (0..1) of the fibre at the angle `around` of a ply, in turns, and at
    /// the place `along`, a share of the repeat.
    fn fibre(&self, around: f32, along: f32, salt: u32) -> ([f32; 3], f32) {
        // The sine makes fibres waver. All indices are modulo a whole number, so the repeat tiles.
        let band = whole(((around + 4.0) * self.fibres) + 0.35 * (TAU * 3.0 * along).sin())
            % whole(self.fibres);
        let start = random(band * 31 + salt * 7);
        let piece = whole((along + start) * PIECES) % whole(PIECES);
        let own = hash(band * 977 + piece * 13 + salt * 101);
        let color = self.colors[own as usize % self.colors.len()];
        let bright = random(own);
        (color.map(|c| c * (1.0 + SHADE * (bright - 0.5))), bright)
    }

    /// A fibre that leaves the yarn in an arc and comes back.
    fn stray(&self, number: u32, image: &mut YarnImage) {
        let random = |salt: u32| random(number * 7 + salt);
        let (start, length, side) =
            (random(1), 0.08 + 0.22 * random(2), if random(3) < 0.5 { -1.0 } else { 1.0 });
        let (inside, farthest) = (
            self.core * 0.8,
            self.core + (FARTHEST - self.core) * (0.2 + 0.8 * random(4) * random(5)),
        );
        let stroke = Stroke { radius: 0.008, alpha: 0.55 + 0.3 * random(6), seed: 5000 + number };
        image.lay(self, &stroke, |t| {
            let off = inside + (farthest - inside) * (PI * t).sin();
            (start + length * t, side * off, 0.3)
        });
    }

    /// A loop of the effect yarn: out to one side and back, crossing its own foot.
    fn effect_loop(&self, number: u32, image: &mut YarnImage) {
        let random = |salt: u32| random(900 + number * 11 + salt);
        let start = (to_float(number) + 0.6 * random(1)) / to_float(self.loops);
        let (side, far) = (if random(2) < 0.5 { -1.0 } else { 1.0 }, 0.45 + 0.42 * random(3));
        let (wide, drift) = (0.025 + 0.03 * random(4), 1.3 / to_float(self.loops));
        let stroke = Stroke { radius: 0.075, alpha: 1.0, seed: 9000 + number };
        image.lay(self, &stroke, |t| {
            let out = (PI * t).sin();
            (
                start + drift * t - wide * (TAU * t).sin(),
                side * (far * out.powf(0.8) - 0.1 * (1.0 - out)),
                0.25 + 0.3 * (PI * t).cos().abs(),
            )
        });
    }
}

impl Stroke {
    /// The place along the fibres for a share of the path. A stray fibre is a single one from end
    /// to end, so it has one colour.
    fn share_of(&self, t: f32) -> f32 {
        if self.alpha < 1.0 { 0.0 } else { t }
    }
}

impl YarnImage {
    fn at(&self, x: u32, y: u32) -> Point {
        self.points[(y * FINER * SIZE.0 + x) as usize]
    }

    /// Draws a stroke along a path, with a height test. `path` gives for a share of its length the
    /// place along the repeat, across it, and its height. Strokes wrap around the repeat's ends.
    fn lay(&mut self, yarn: &Yarn, stroke: &Stroke, path: impl Fn(f32) -> (f32, f32, f32)) {
        let (width, height) = (FINER * SIZE.0, FINER * SIZE.1);
        let texels = stroke.radius * 0.5 * to_float(height);
        let reach = whole(texels.ceil());
        for step in 0..=STEPS {
            let t = to_float(step) / to_float(STEPS);
            let (along, across, over) = path(t);
            let (x, y) = (
                along.rem_euclid(1.0) * to_float(width),
                (0.5 + 0.5 * across.clamp(-FARTHEST, FARTHEST)) * to_float(height),
            );
            for (dx, dy) in (0..=2 * reach).flat_map(|dx| (0..=2 * reach).map(move |dy| (dx, dy))) {
                let (column, row) = (
                    whole(x) + width + dx - reach,
                    (whole(y) + dy).saturating_sub(reach).min(height - 1),
                );
                let off = (to_float(row) + 0.5 - y)
                    .hypot(to_float(whole(x) + dx) - to_float(reach) + 0.5 - x)
                    / texels;
                if off < 1.0 {
                    // Each step draws the upper half of a sphere; together they are a round yarn.
                    let round = (1.0 - off * off).sqrt();
                    let light = if stroke.alpha < 1.0 { 0.92 } else { 0.66 + 0.34 * round };
                    let (rgb, _) = yarn.fibre(0.0, stroke.share_of(t), stroke.seed);
                    let lifted = (over + stroke.radius * round).clamp(0.0, 1.0);
                    let point = &mut self.points[(row * width + column % width) as usize];
                    if lifted > point.height {
                        *point = Point {
                            rgb: rgb.map(|c| c * light),
                            alpha: point.alpha.max(stroke.alpha),
                            height: lifted,
                        };
                    }
                }
            }
        }
    }
}

/// A pseudo-random number, 0..1, from a hash.
fn random(number: u32) -> f32 {
    to_float(hash(number) >> 16) / 65_536.0
}

#[expect(clippy::cast_precision_loss, reason = "texels")]
fn to_float(number: u32) -> f32 {
    number as f32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(number: f32) -> u32 {
    number as u32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn byte(value: f32) -> u8 {
    value.round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean difference of bytes. Another machine's sine may round differently.
    fn difference(one: &[u8], other: &[u8]) -> f64 {
        assert_eq!(one.len(), other.len());
        one.iter().zip(other).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>()
            / one.len() as f64
    }

    #[test]
    fn the_shipped_yarns_are_what_this_draws() {
        for yarn in &YARNS {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/yarns").join(yarn.name);
            let shipped = |name: &str| image::open(folder.join(name)).unwrap();
            let (color, height) = yarn.pictures();
            assert!(
                difference(&shipped("base_color.png").into_rgba8(), &color) < 0.1,
                "{}",
                yarn.name
            );
            assert!(
                difference(&shipped("height.png").into_luma8(), &height) < 0.1,
                "{}",
                yarn.name
            );
            assert_eq!(std::fs::read_to_string(folder.join("yarn.toml")).unwrap(), yarn.sizes());
        }
    }
}
