//! Stitches of fully threaded bars, drawn once and put together to any lapping.
//!
//! In: the proportion of courses to wales, and laps of one or two full bars. Out: the lights of a
//! sketch, place by place, finely or roughly, near those that [`super::sketch`] makes of a draft of round
//! yarns.
//!
//! Method: on straight wales a stitch (a loop and the underlap to the next one) depends on its
//! bar, the direction of its lap, that of the next lap, and the needles between them: 28 stitches a
//! bar. Each is drawn into a height buffer of its own. A lapping is the highest of its stitches at
//! each place. Then rows are moved as the wales bend. All wales of full bars are alike, so that a
//! repeat is one wale wide and needles count by their differences only.
//!
//! Rough lappings are put together from the stitches at half the resolution.
//!
//! Cost: a look at some hundred places a stitch, a quarter of that for a rough lapping. Not promised: the picture of a
//! draft. Stitches are dimmer in the depth, and what yarns around them hide of the sky plays no role.

use std::collections::BTreeMap;

use glam::DVec2;
use rayon::prelude::*;

use super::Face;
use super::candidate::{full_bars, proportioned};
use super::sketch::{CHANNELS, COURSE, Detail, FINE, Ground, HeightBuffer, NONE, WALE};
use crate::plane::{double, narrow};
use warpknit_core::fabric::Fabric;
use warpknit_core::knit::mesh::StructureMesh;
use warpknit_core::knit::upright::leans;
use warpknit_core::knit::{Knitted, Pattern};
use warpknit_core::yarn::curve;

/// Needles that a bar's laps may reach over.
pub(super) const NEEDLES: i32 = 4;
/// Stitches of a bar: the directions of two laps, and the needles from the one to the other.
const KINDS: usize = 28;
/// Diameter of the yarns, of the yarn of which drafts are made. Nothing presses the stitches
/// together as the relaxation does, so that they look like cloth of thicker yarn: at 1, fewer
/// lappings were found.
const THICKNESS: f64 = 0.85;
/// Share of the light that falls on flanks of a yarn as on its top: a part of the sky is beside it.
const FLANK: f32 = 0.35;
/// Courses of the buffer in which a stitch is drawn: it reaches over three.
const TALL: usize = 6;
/// Rows of the buffer to a course.
const ROWS: usize = COURSE * FINE;
const COLUMNS: usize = WALE * FINE;

/// A lap: its needle, and whether it goes to higher gaps.
pub(super) type Lap = (i32, bool);
/// The laps of all bars, front first: one or two bars of the same number of courses.
pub(super) type Laps = Vec<Vec<Lap>>;

/// A place of a stitch.
struct Spot {
    row: i32,
    column: usize,
    height: f32,
    light: [f32; CHANNELS],
}

/// A place of a stitch in a repeat.
struct RepeatSpot {
    /// Its place for a stitch in the first course, row by row.
    at: usize,
    height: f32,
    light: [f32; CHANNELS],
}

/// The stitches at some resolution.
struct DrawnStitches {
    /// Columns of a wale and rows of a course.
    cell: [usize; 2],
    /// From the face and from the back, for each kind and each bar.
    spots: [Vec<Vec<RepeatSpot>>; 2],
}

/// The stitches of two full bars.
pub(super) struct Stitches {
    fabric: Fabric,
    courses: usize,
    /// At the resolution of height buffers.
    fine: DrawnStitches,
    /// At half of it.
    rough: DrawnStitches,
    /// By how much wales bend in each course, of the size of a wale and a course, for the needles
    /// of all bars.
    bends: BTreeMap<Vec<Vec<i32>>, Vec<DVec2>>,
}

impl Stitches {
    /// The stitches of cloth that repeats after so many courses, which are `proportion` wale spacings high.
    pub(super) fn new(courses: usize, proportion: f64) -> Option<Self> {
        let like = full_bars(&["1-0/0-1".to_owned(), "1-0/0-1".to_owned()]).ok()?;
        let fabric = proportioned(&like, proportion, THICKNESS);
        let kinds: Vec<[Vec<Vec<Spot>>; 2]> = (0..KINDS)
            .into_par_iter()
            .map(|kind| [Face::Front, Face::Back].map(|face| drawn(&fabric, kind, face)))
            .collect();
        let mut all: [Vec<Vec<Spot>>; 2] = [Vec::new(), Vec::new()];
        for kind in kinds {
            for (to, own) in all.iter_mut().zip(kind) {
                to.extend(own);
            }
        }
        let rough = all.each_ref().map(|all| all.iter().map(|own| coarser(own)).collect());
        Some(Self {
            fabric,
            courses,
            fine: DrawnStitches::new(Detail::Fine, courses, &all),
            rough: DrawnStitches::new(Detail::Rough, courses, &rough),
            bends: BTreeMap::new(),
        })
    }

    /// Computes how wales bend in some lappings, unless that is known.
    pub(super) fn prepare(&mut self, all: &[Laps]) {
        let mut fresh: Vec<Vec<Vec<i32>>> =
            all.iter().map(needles).filter(|own| !self.bends.contains_key(own)).collect();
        fresh.sort();
        fresh.dedup();
        let like = &self.fabric;
        let spacing = DVec2::new(like.wale_spacing(), like.course_spacing());
        let bends: Vec<Vec<DVec2>> = fresh
            .par_iter()
            .map(|own| {
                let laps: Laps = own
                    .iter()
                    .map(|bar| bar.iter().map(|needle| (*needle, true)).collect())
                    .collect();
                let chains: Vec<String> = laps.iter().map(|bar| super::search::text(bar)).collect();
                let fabric = like.clone().with_chains(&chains, &[]);
                fabric.map_or_else(
                    |_| Vec::new(),
                    |fabric| leans(&fabric).into_iter().map(|lean| lean / spacing).collect(),
                )
            })
            .collect();
        self.bends.extend(fresh.into_iter().zip(bends));
    }

    /// The lights of a lapping's repeat on some ground as seen from a face, row by row. Lappings that
    /// were not prepared stand upright.
    pub(super) fn lights(
        &self,
        laps: &Laps,
        face: Face,
        ground: Ground,
        detail: Detail,
    ) -> Vec<[f32; CHANNELS]> {
        let drawn = match detail {
            Detail::Fine => &self.fine,
            Detail::Rough => &self.rough,
        };
        let spots = &drawn.spots[usize::from(face == Face::Back)];
        let course_places = drawn.cell[0] * drawn.cell[1];
        let places = course_places * self.courses;
        let mut heights = vec![f32::NEG_INFINITY; places];
        let mut lights = vec![[0.0_f32; CHANNELS]; places];
        for (bar, own) in laps.iter().enumerate() {
            for (course, lap) in own.iter().enumerate() {
                let kind = kind(*lap, own[(course + 1) % self.courses]);
                // Later courses lie further up.
                let moved = places - course * course_places;
                for spot in &spots[2 * kind + bar] {
                    let at = spot.at + moved;
                    let at = if at < places { at } else { at - places };
                    if spot.height > heights[at] {
                        heights[at] = spot.height;
                        lights[at] = spot.light;
                        if ground == Ground::Bars {
                            lights[at][CHANNELS - 1] = if bar == 0 { 0.0 } else { spot.light[0] };
                        }
                    }
                }
            }
        }
        if ground == Ground::Light {
            for (light, height) in lights.iter_mut().zip(&heights) {
                light[CHANNELS - 1] = f32::from(u8::from(*height == f32::NEG_INFINITY));
            }
        }
        let bends = self.bends.get(&needles(laps)).map_or(&[][..], |bends| bends);
        bent(&lights, drawn.cell, bends, face)
    }
}

impl DrawnStitches {
    /// Stitches in a repeat of so many courses, the highest place of each at every place there.
    fn new(detail: Detail, courses: usize, all: &[Vec<Vec<Spot>>; 2]) -> Self {
        let cell = detail.pixels().map(|pixels| pixels * FINE);
        let rows = i32::try_from(cell[1] * courses).expect("a few courses");
        let in_repeat = |own: &Vec<Spot>| {
            let mut tops: BTreeMap<usize, &Spot> = BTreeMap::new();
            for spot in own {
                let row = usize::try_from(spot.row.rem_euclid(rows)).expect("not negative");
                let top = tops.entry(row * cell[0] + spot.column).or_insert(spot);
                if spot.height > top.height {
                    *top = spot;
                }
            }
            let spot =
                |(at, top): (usize, &Spot)| RepeatSpot { at, height: top.height, light: top.light };
            tops.into_iter().map(spot).collect()
        };
        Self { cell, spots: all.each_ref().map(|face| face.iter().map(in_repeat).collect()) }
    }
}

/// The needles of all bars, from each bar's first lap on.
fn needles(laps: &Laps) -> Vec<Vec<i32>> {
    laps.iter().map(|bar| bar.iter().map(|(needle, _)| needle - bar[0].0).collect()).collect()
}

/// The number of a lap's stitch.
fn kind((needle, up): Lap, (next, next_up): Lap) -> usize {
    let across = usize::try_from(next - needle + NEEDLES - 1).expect("laps are in reach");
    (usize::from(up) * 7 + across) * 2 + usize::from(next_up)
}

/// The stitches of a kind of both bars.
fn drawn(like: &Fabric, kind: usize, face: Face) -> Vec<Vec<Spot>> {
    let across = i32::try_from(kind / 2 % 7).expect("a few needles") + 1 - NEEDLES;
    let laps = [(0, kind / 14 == 1), (across, kind % 2 == 1)];
    let chain = super::search::text(&laps);
    let Ok(fabric) = like.clone().with_chains(&[chain.clone(), chain], &[]) else {
        return vec![Vec::new(), Vec::new()];
    };
    let Some(pattern) = Pattern::upright(&fabric) else { return vec![Vec::new(), Vec::new()] };
    let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
    let bars = fabric.thickness().into_iter().enumerate();
    bars.map(|(bar, thickness)| {
        let mut knitted = Knitted::default();
        let [first, end] = [-1..0, 0..1].map(|steps| {
            pattern.lay(bar, 0, steps, &mesh, &mut knitted);
            knitted.points.len()
        });
        pattern.lay(bar, 0, 1..2, &mesh, &mut knitted);
        let points: Vec<_> = knitted.points.iter().map(|&point| face.seen(point)).collect();
        let mut buffer = HeightBuffer::new(&fabric, [1, TALL]);
        for at in first..end {
            buffer.draw_span(&curve::span(&points, at), fabric.radius() * thickness, [1.0; 2], 0);
        }
        let spots = buffer.tops.iter().enumerate().filter(|(_, top)| top.system != NONE);
        let wale = fabric.wale_spacing();
        spots
            .map(|(at, top)| {
                let row = at / COLUMNS;
                let tall = if row >= TALL * ROWS / 2 { TALL * ROWS } else { 0 };
                let [row, tall] = [row, tall].map(|row| i32::try_from(row).expect("a few rows"));
                // The highest yarns' light only scales all channels. What the yarns around it hide of
                // the sky is not known yet.
                let depth = top.depth_light(narrow(0.5 * wale), wale);
                let [x, y] = top.lean;
                let even = FLANK + (1.0 - FLANK) * top.up();
                let light = [even, x, y, 1.0].map(|light| light * depth);
                Spot { row: row - tall, column: at % COLUMNS, height: top.height, light }
            })
            .collect()
    })
    .collect()
}

/// A stitch at half the resolution: the mean of each four places of which it covers two or more.
fn coarser(all: &[Spot]) -> Vec<Spot> {
    let mut fours: BTreeMap<(i32, usize), Vec<&Spot>> = BTreeMap::new();
    for spot in all {
        fours.entry((spot.row.div_euclid(2), spot.column / 2)).or_default().push(spot);
    }
    fours
        .into_iter()
        .filter(|(_, spots)| spots.len() >= 2)
        .map(|((row, column), spots)| {
            let share = narrow(double(spots.len()).recip());
            let mean =
                |of: &dyn Fn(&Spot) -> f32| share * spots.iter().map(|spot| of(spot)).sum::<f32>();
            let light = std::array::from_fn(|channel| mean(&|spot| spot.light[channel]));
            Spot { row, column, height: mean(&|spot| spot.height), light }
        })
        .collect()
}

/// The light of a repeat, means of [`FINE`] pixels each way, its rows moved as wales bend. A wale has so
/// many columns, and a course so many rows.
fn bent(
    lights: &[[f32; CHANNELS]],
    [columns, course_rows]: [usize; 2],
    bends: &[DVec2],
    face: Face,
) -> Vec<[f32; CHANNELS]> {
    let rows = lights.len() / columns;
    let mut means = vec![[0.0_f32; CHANNELS]; lights.len() / (FINE * FINE)];
    let share = 1.0 / narrow(double(FINE * FINE));
    for row in 0..rows {
        let bend = bend_at(bends, -(double(row) + 0.5) / double(course_rows));
        let right = match face {
            Face::Front => bend.x,
            Face::Back => -bend.x,
        };
        let from = moved(row, bend.y * double(course_rows), rows) * columns;
        let to = row / FINE * (columns / FINE);
        // The row begins somewhere and goes around.
        let begin = moved(0, -right * double(columns), columns);
        let (last, first) = lights[from..from + columns].split_at(begin);
        for (column, light) in first.iter().chain(last).enumerate() {
            let sum = &mut means[to + column / FINE];
            sum.iter_mut().zip(light).for_each(|(sum, light)| *sum += share * light);
        }
    }
    means
}

/// A place moved by the nearest whole number, around `count` of them.
fn moved(at: usize, by: f64, count: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
    let by = by.round() as i64;
    let [at, count] = [at, count].map(|at| i64::try_from(at).expect("some hundred pixels"));
    usize::try_from((at + by).rem_euclid(count)).expect("a remainder is not negative")
}

/// The bend at a place along the wale, courses: a Catmull-Rom curve through those of the courses.
fn bend_at(bends: &[DVec2], course: f64) -> DVec2 {
    if bends.is_empty() {
        return DVec2::ZERO;
    }
    #[expect(clippy::cast_possible_truncation, reason = "a few courses")]
    let below = course.floor() as i64;
    let t = course - course.floor();
    let count = i64::try_from(bends.len()).expect("a few courses");
    let [p0, p1, p2, p3] = [-1, 0, 1, 2].map(|step| {
        let at = (below + step).rem_euclid(count);
        bends[usize::try_from(at).expect("a remainder is not negative")]
    });
    let (a, b, c) = (3.0 * p1 - p0 - 3.0 * p2 + p3, 2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3, p2 - p0);
    p1 + 0.5 * (((a * t) + b) * t + c) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rough_lapping_looks_like_a_fine_one() {
        let laps: Laps =
            vec![vec![(0, true), (3, false), (1, true)], vec![(1, true), (0, false), (1, false)]];
        let mut stitches = Stitches::new(3, 0.8).unwrap();
        stitches.prepare(std::slice::from_ref(&laps));
        let grounds = [Ground::Dark, Ground::Bars, Ground::Light];
        for (face, ground) in
            [Face::Front, Face::Back].into_iter().flat_map(|face| grounds.map(|own| (face, own)))
        {
            let [fine, rough] = [Detail::Fine, Detail::Rough]
                .map(|detail| stitches.lights(&laps, face, ground, detail));
            for channel in 0..CHANNELS {
                let mean = |at: usize| {
                    let corner = 2 * (at / (WALE / 2)) * WALE + 2 * (at % (WALE / 2));
                    let four = [0, 1, WALE, WALE + 1].map(|off| fine[corner + off][channel]);
                    four.iter().sum::<f32>() / 4.0
                };
                let fine: Vec<f32> = (0..rough.len()).map(mean).collect();
                let rough: Vec<f32> = rough.iter().map(|light| light[channel]).collect();
                let alike = correlation(&fine, &rough);
                assert!(alike > 0.7, "{face:?} {alike}");
            }
        }
    }

    fn correlation(one: &[f32], other: &[f32]) -> f32 {
        let centred = |values: &[f32]| -> Vec<f32> {
            let mean = values.iter().sum::<f32>() / narrow(double(values.len()));
            values.iter().map(|value| value - mean).collect()
        };
        let (one, other) = (centred(one), centred(other));
        let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        product(&one, &other) / (product(&one, &one) * product(&other, &other)).sqrt()
    }
}
