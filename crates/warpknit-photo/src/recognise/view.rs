//! A photo of one face, ready to be compared with sketches.
//!
//! In: a photo. Out: a [`FaceView`]: frames that its lattices allow, and the photo laid out in each.
//! The cloth's bends are taken off first, by the waves of each lattice whose cell isn't long. Cost:
//! some tenths of a second a photo of 300 pixels.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use image::RgbImage;
use image::imageops::crop_imm;
use rayon::prelude::*;

use super::bends::Bends;
use super::compare::{CellSpectrum, Match, Template};
use super::frames::{Frame, frames, is_long};
use super::sketch::{CHANNELS, Detail, Ground, Raster, Sketch, WALE};
use super::unfold::{UnfoldedPhoto, beyond_stripes};
use super::{Face, LEAST_BEYOND_STRIPES};
use crate::capture::lattice::Lattice;
use crate::capture::plane::normalized_contrast;
use crate::capture::register::register_in;
use crate::fourier::Fourier;
use crate::plane::{Plane, double, float};

/// Pixels each way that are looked at: thirty wales of twenty pixels. More takes longer and tells
/// little more.
const MOST_SIDE: u32 = 640;
/// Deviation of the window in which shading is taken off, as a share of the shorter side: about a
/// wale in a photo of twenty.
const SHADING: f32 = 0.05;
/// Blur before sampling, pixels. It takes noise off that a grid as coarse as the photo would fold
/// in.
const BLUR: f32 = 1.0;
/// Deviation of the registration's window, in lengths of the cell, and at most this share of the
/// photo's side.
const WINDOW: [f64; 2] = [1.1, 0.11];

/// The most courses of a lapping that is searched for.
pub(super) const MOST_COURSES: usize = 4;

/// A photo of a face.
pub(super) struct FaceView {
    pub(super) face: Face,
    /// What is seen between the yarns: dark until somebody finds out.
    pub(super) ground: Ground,
    pub(super) frames: Vec<Frame>,
    sheets: Vec<UnfoldedPhoto>,
    /// For each frame the lattice by whose waves bends were taken off.
    lattice_of: Vec<usize>,
    bends: Vec<Bends>,
    /// The photo's channels, linear light.
    channels: [Plane; 3],
    /// For the pixels of each repeat that was asked for: transforms, and its fold in each frame.
    folds: BTreeMap<Raster, (Fourier, Vec<FrameFold>)>,
}

/// The fold of a repeat in one frame.
struct FrameFold {
    spectrum: CellSpectrum,
    /// Share of the photo's variance that it explains.
    share: f64,
}

/// How well a sketch fits in its best frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score {
    /// Share of the photo's variance that it explains.
    pub(super) explained: f64,
    /// Index of the frame.
    pub(super) frame: usize,
    pub(super) matched: Match,
}

impl FaceView {
    /// A photo in all of its frames.
    pub(super) fn new(photo: &RgbImage, face: Face) -> Self {
        let photo = &middle(photo);
        let lightness = Plane::lightness(photo);
        let side = lightness.width.min(lightness.height);
        let even = normalized_contrast(&lightness, SHADING * float(side));
        let smooth = even.smoothed(BLUR);
        let lattices = frames(&even);
        let bends: Vec<Bends> = lattices
            .par_iter()
            .map(|(vectors, _)| {
                if is_long(*vectors, &even) {
                    return Bends::none(even.width, even.height);
                }
                let lattice = Lattice::reduced(vectors.x_axis, vectors.y_axis);
                let sigma = (WINDOW[0] * lattice.longer()).min(WINDOW[1] * double(side));
                Bends::new(&register_in(&even, &lattice, sigma), even.width, even.height)
            })
            .collect();
        let of_lattices = lattices
            .iter()
            .enumerate()
            .flat_map(|(at, (_, frames))| frames.iter().map(move |frame| (at, *frame)));
        let (lattice_of, frames): (Vec<usize>, Vec<Frame>) = of_lattices.unzip();
        let sheets = frames
            .par_iter()
            .zip(&lattice_of)
            .map(|(frame, at)| laid_out(&smooth, *frame, &bends[*at]))
            .collect();
        let channels = Plane::channels(photo);
        Self {
            face,
            ground: Ground::default(),
            frames,
            sheets,
            lattice_of,
            bends,
            channels,
            folds: BTreeMap::new(),
        }
    }

    /// Folds the photo into a repeat in all frames, unless that is done.
    pub(super) fn fold(&mut self, repeat: [usize; 2]) {
        let sheets = &self.sheets;
        let raster = Raster::fine(repeat);
        self.folds.entry(raster).or_insert_with(|| {
            let fourier = fourier(raster);
            let folds = sheets
                .par_iter()
                .map(|sheet| {
                    let fold = sheet.fold(repeat);
                    let spectrum = CellSpectrum::new(&fourier, &fold.values);
                    FrameFold { spectrum, share: fold.share }
                })
                .collect();
            (fourier, folds)
        });
    }

    /// A sketch, ready to be compared.
    pub(super) fn template(&self, sketch: &Sketch, blur: f64) -> Option<Template> {
        let (fourier, _) = self.folds.get(&Raster::fine(sketch.repeat))?;
        Some(Template::new(fourier, sketch.on(self.ground), self.ground, blur))
    }

    /// The lights of a repeat, ready to be compared. The blur is in their own pixels.
    pub(super) fn template_of(
        &self,
        raster: Raster,
        lights: &[[f32; CHANNELS]],
        blur: f64,
    ) -> Option<Template> {
        let (fourier, _) = self.folds.get(&raster)?;
        Some(Template::of_lights(fourier, lights, self.ground, blur))
    }

    /// The best frames for a template of a repeat, among some of them, the best first.
    pub(super) fn scores(
        &self,
        template: &Template,
        raster: Raster,
        among: impl Iterator<Item = usize>,
    ) -> Vec<Score> {
        let Some((fourier, folds)) = self.folds.get(&raster) else { return Vec::new() };
        let mut scores: Vec<Score> = among
            .map(|frame| {
                let fold = &folds[frame];
                let matched = template.best(fourier, &fold.spectrum);
                Score { explained: matched.explained * fold.share, frame, matched }
            })
            .collect();
        scores.sort_by(|a, b| b.explained.total_cmp(&a.explained));
        scores
    }

    /// The mean colour of all copies of a repeat in a frame, linear light.
    pub(super) fn mean_colors(&self, repeat: [usize; 2], frame: usize) -> Vec<DVec3> {
        let bends = &self.bends[self.lattice_of[frame]];
        let [red, green, blue] = self.channels.each_ref().map(|channel| {
            let fold = laid_out(channel, self.frames[frame], bends).fold(repeat);
            let mean = fold.mean;
            fold.values.into_iter().map(move |value| f64::from(value + mean))
        });
        red.zip(green).zip(blue).map(|((red, green), blue)| DVec3::new(red, green, blue)).collect()
    }

    /// The mean of all copies of a repeat in a frame.
    pub(super) fn mean_cell(&self, repeat: [usize; 2], frame: usize) -> Vec<f32> {
        self.sheets[frame].fold(repeat).values
    }

    /// Whether the mean of all copies of a repeat varies in one direction only. Any spacing of the
    /// other direction fits it then.
    pub(super) fn is_striped(&self, repeat: [usize; 2], frame: usize) -> bool {
        let cell = self.mean_cell(repeat, frame);
        beyond_stripes(&cell, repeat[0] * WALE) < LEAST_BEYOND_STRIPES
    }

    /// Folds the photo into the repeats of one wale and few courses.
    pub(super) fn fold_few_courses(&mut self) {
        (1..=MOST_COURSES).for_each(|courses| self.fold([1, courses]));
    }

    /// Folds the photo into the repeats of one wale and few courses, finely and roughly.
    pub(super) fn fold_few_courses_roughly(&mut self) {
        self.fold_few_courses();
        for courses in 1..=MOST_COURSES {
            let repeat = [1, courses];
            let (fine, folds) = &self.folds[&Raster::fine(repeat)];
            let raster = Raster { repeat, detail: Detail::Rough };
            let rough = fourier(raster);
            let coarser = |fold: &FrameFold| FrameFold {
                spectrum: fold.spectrum.coarser(fine, &rough),
                share: fold.share,
            };
            let folds = folds.iter().map(coarser).collect();
            self.folds.insert(raster, (rough, folds));
        }
    }

    /// The largest share that copies of any repeat have in common.
    pub(super) fn most_common(&self) -> f64 {
        let fine = self.folds.keys().filter(|raster| raster.detail == Detail::Fine);
        let all = fine.flat_map(|raster| {
            (0..self.frames.len()).map(|frame| self.common(raster.repeat, frame))
        });
        all.fold(0.0, f64::max)
    }

    /// The share of its variance that copies of a repeat have in common in a frame. What noise alone
    /// makes common, one part of as many as there are copies, is taken off.
    pub(super) fn common(&self, repeat: [usize; 2], frame: usize) -> f64 {
        let folds = self.folds.get(&Raster::fine(repeat));
        let share = folds.map_or(0.0, |(_, folds)| folds[frame].share);
        let chance = 1.0 / self.sheets[frame].copies(repeat).max(2.0);
        ((share - chance) / (1.0 - chance)).max(0.0)
    }
}

/// The transforms of the pixels of a repeat.
fn fourier(raster: Raster) -> Fourier {
    let [width, height] = raster.size();
    Fourier::new(width, height)
}

/// The middle of a photo, at most [`MOST_SIDE`] each way.
fn middle(photo: &RgbImage) -> RgbImage {
    let (width, height) = photo.dimensions();
    let [columns, rows] = [width, height].map(|side| side.min(MOST_SIDE));
    crop_imm(photo, (width - columns) / 2, (height - rows) / 2, columns, rows).to_image()
}

/// A photo in a frame, its bends taken off.
fn laid_out(plane: &Plane, frame: Frame, bends: &Bends) -> UnfoldedPhoto {
    UnfoldedPhoto::new(plane, frame, |at: DVec2| bends.displaced(at))
}
