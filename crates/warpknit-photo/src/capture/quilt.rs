//! `texture.png`: some cells each way that tile and are the photo's own cloth, lint and light and
//! dark yarns and all, where the mean cell is that of no place.
//!
//! In: the colours of the view, its [`Warp`] and its lattice. Out: a picture along both vectors as
//! the mean cell is: columns go along a, rows along b, and its corner is a cell's corner. Source:
//! Efros and Freeman 2001, *Image quilting for texture synthesis and transfer*. Blocks of one or
//! two cells come from the photo, whole cells apart so that yarns meet; each is the one that
//! differs least from what lies where it overlaps others, and is cut there where it differs least.
//! The last block of a row overlaps the first, and the last row the first, so that the picture
//! tiles. Cost: about half a second, and four bytes for each pixel of the view.
//!
//! Not promised: patterns wider than a block, and colours as in another light: of the photo's light
//! only slow differences are taken off, and its colours stay.

use glam::DVec2;
use image::imageops::interpolate_bilinear;
use image::{Rgb, RgbImage, Rgba, RgbaImage};
use rayon::prelude::*;

use super::lattice::Lattice;
use super::register::Warp;
use super::steps;
use crate::plane::{Plane, byte, double, float, narrow, side, whole};

/// Cells of the texture each way, at most.
const CELLS: usize = 6;
/// Pixels of the texture each way, unless two blocks are more.
const PIXELS: f64 = 1024.0;
/// A photo that shows so many cells each way gives blocks of two.
const MANY: f64 = 8.0;
/// The overlap of blocks as a share of a cell. With it, a block of one cell is in any photo that
/// shows three each way.
const OVERLAP: f64 = 1.0 / 3.0;
/// How much lighter or darker a place is made, at most.
const GAIN: f32 = 4.0;

/// A picture that tiles.
pub(super) fn quilt(picture: &RgbImage, warp: &Warp, lattice: &Lattice) -> RgbaImage {
    let blocks = Blocks::of(lattice, f64::from(picture.width().min(picture.height())));
    let along = Unsheared::of(&evenly_lit(picture, lattice), warp, &blocks);
    let origins = along.origins();
    let mut tile = Tile::empty(blocks);
    for row in 0..blocks.count[1] {
        for column in 0..blocks.count[0] {
            let laid = tile.laid(column, row);
            let error = |origin: &[usize; 2]| -> u64 {
                laid.iter()
                    .map(|&([x, y], old)| {
                        u64::from(difference(old, along.at(origin[0] + x, origin[1] + y).0))
                    })
                    .sum()
            };
            // Of equally good ones the first, which is nearest to the middle.
            let best = origins
                .par_iter()
                .enumerate()
                .min_by_key(|(number, origin)| (error(origin), *number));
            let [left, top] = *best.expect("the middle one, if no other").1;
            tile.lay(column, row, |x, y| along.at(left + x, top + y).0);
        }
    }
    tile.picture(along.start)
}

/// How blocks lie, pixels of the texture: columns along a, rows along b.
#[derive(Clone, Copy)]
struct Blocks {
    cell: [usize; 2],
    /// From one block to the next: whole cells.
    stride: [usize; 2],
    /// How far a block goes beyond that.
    overlap: [usize; 2],
    /// Blocks of the texture.
    count: [usize; 2],
}

impl Blocks {
    fn of(lattice: &Lattice, side: f64) -> Self {
        let cells = if side >= MANY * lattice.longer() { 2 } else { 1 };
        let lengths = [lattice.a, lattice.b].map(DVec2::length);
        let cell = lengths.map(|length| whole(narrow(length.round())).max(8));
        let fit = |length: f64| whole(narrow(side.min(PIXELS) / (length * double(cells))));
        Self {
            cell,
            stride: cell.map(|cell| cells * cell),
            overlap: cell.map(|cell| whole(narrow(OVERLAP * double(cell)))),
            count: lengths.map(|length| fit(length).clamp(2, CELLS / cells)),
        }
    }

    /// Of one block with its overlap.
    fn size(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.stride[axis] + self.overlap[axis])
    }

    /// Of the texture.
    fn whole(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.stride[axis] * self.count[axis])
    }
}

/// A photo without slow differences of its light.
fn evenly_lit(picture: &RgbImage, lattice: &Lattice) -> RgbImage {
    let grey = Plane::grey(picture, 1);
    let sigma = (1.5 * narrow(lattice.longer())).max(float(grey.width.min(grey.height)) / 8.0);
    let slow = grey.smoothed(sigma);
    let mean = slow.values.iter().sum::<f32>() / float(slow.values.len());
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let gain = (mean / slow.at(x as usize, y as usize).max(1.0)).clamp(1.0 / GAIN, GAIN);
        Rgb(picture.get_pixel(x, y).0.map(|value| byte(f32::from(value) * gain)))
    })
}

/// A photo along both vectors of its cloth.
struct Unsheared {
    width: usize,
    /// Colours, and whether the photo shows that place.
    pixels: Vec<([u8; 3], bool)>,
    /// Its corner, where a cell's corner is at 0.
    start: [i32; 2],
    /// The block that is in the photo's middle.
    middle: [usize; 2],
    blocks: Blocks,
}

impl Unsheared {
    fn of(picture: &RgbImage, warp: &Warp, blocks: &Blocks) -> Self {
        let cell = DVec2::from(blocks.cell.map(double));
        let last = DVec2::new(f64::from(picture.width()), f64::from(picture.height())) - 1.0;
        let [centre, corners @ ..] = [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|share| warp.count(last * DVec2::from(share)) * cell);
        // Vectors that a person gives may be nearly parallel, and the photo along them endless.
        let reach = DVec2::splat(last.max_element());
        let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min).max(centre - reach);
        let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max).min(centre + reach);
        let size = blocks.size();
        let first = (centre - 0.5 * DVec2::from(size.map(double))).round();
        let before = ((first - low) / cell).floor().max(DVec2::ZERO);
        let start = first - before * cell;
        let [width, height] =
            [0, 1].map(|axis| whole(narrow((high - start)[axis])).max(size[axis]));
        let pixel = |x: usize, y: usize| {
            let place = warp.place((start + DVec2::new(double(x), double(y))) / cell);
            let near = place.clamp(DVec2::ZERO, last);
            let color = interpolate_bilinear(picture, narrow(near.x), narrow(near.y))
                .map_or([0; 3], |Rgb(color)| color);
            (color, near == place)
        };
        let pixels =
            (0..width * height).into_par_iter().map(|at| pixel(at % width, at / width)).collect();
        let middle = [0, 1].map(|axis| whole(narrow(before[axis])) * blocks.cell[axis]);
        Self { width, pixels, start: start.to_array().map(steps), middle, blocks: *blocks }
    }

    fn at(&self, x: usize, y: usize) -> ([u8; 3], bool) {
        self.pixels[y * self.width + x]
    }

    /// Corners of all blocks that the photo shows whole, those nearest to its middle first.
    fn origins(&self) -> Vec<[usize; 2]> {
        let [width, height] = self.blocks.size();
        let rows = (0..=self.pixels.len() / self.width - height).step_by(self.blocks.cell[1]);
        let all = rows.flat_map(|y| {
            (0..=self.width - width).step_by(self.blocks.cell[0]).map(move |x| [x, y])
        });
        let is_seen =
            |&[x, y]: &[usize; 2]| (y..y + height).all(|y| (x..x + width).all(|x| self.at(x, y).1));
        let mut origins: Vec<_> = all.filter(is_seen).collect();
        let off = |origin: &[usize; 2]| {
            [0, 1].map(|axis| origin[axis].abs_diff(self.middle[axis]).pow(2)).iter().sum::<usize>()
        };
        origins.sort_by_key(off);
        if origins.is_empty() { vec![self.middle] } else { origins }
    }
}

/// The texture while it is made; it goes around on all sides.
struct Tile {
    blocks: Blocks,
    pixels: Vec<Option<[u8; 3]>>,
}

impl Tile {
    fn empty(blocks: Blocks) -> Self {
        Self { blocks, pixels: vec![None; blocks.whole().iter().product()] }
    }

    /// Where a pixel of a block is.
    fn index(&self, column: usize, row: usize, x: usize, y: usize) -> usize {
        let ([width, height], [across, down]) = (self.blocks.whole(), self.blocks.stride);
        (row * down + y) % height * width + (column * across + x) % width
    }

    /// What lies already where a block will be.
    fn laid(&self, column: usize, row: usize) -> Vec<([usize; 2], [u8; 3])> {
        let [width, height] = self.blocks.size();
        let places = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        places
            .filter_map(|[x, y]| {
                self.pixels[self.index(column, row, x, y)].map(|color| ([x, y], color))
            })
            .collect()
    }

    /// Lays a block up to the cuts through its overlaps.
    fn lay(&mut self, column: usize, row: usize, color: impl Fn(usize, usize) -> [u8; 3]) {
        let ([width, height], [across, down]) = (self.blocks.size(), self.blocks.overlap);
        let differs = |x: usize, y: usize| {
            self.pixels[self.index(column, row, x, y)].map_or(0, |old| difference(old, color(x, y)))
        };
        let [last_column, last_row] = self.blocks.count.map(|count| count - 1);
        let left = (column > 0).then(|| cut(height, across, |y, x| differs(x, y)));
        let right = (column == last_column)
            .then(|| cut(height, across, |y, x| differs(width - across + x, y)));
        let top = (row > 0).then(|| cut(width, down, differs));
        let bottom =
            (row == last_row).then(|| cut(width, down, |x, y| differs(x, height - down + y)));
        let from = |seam: &Option<Vec<usize>>, at: usize| seam.as_ref().map_or(0, |seam| seam[at]);
        let until = |seam: &Option<Vec<usize>>, at: usize, size: usize, overlap: usize| {
            seam.as_ref().map_or(size, |seam| size - overlap + seam[at])
        };
        for y in 0..height {
            for x in from(&left, y)..until(&right, y, width, across) {
                if (from(&top, x)..until(&bottom, x, height, down)).contains(&y) {
                    let index = self.index(column, row, x, y);
                    self.pixels[index] = Some(color(x, y));
                }
            }
        }
    }

    /// The picture with a cell's corner in its corner, which the blocks' own corner is off by
    /// `start`.
    fn picture(&self, start: [i32; 2]) -> RgbaImage {
        let [width, height] = self.blocks.whole();
        let off = [(start[0], width), (start[1], height)]
            .map(|(start, size)| start.rem_euclid(steps(double(size))).unsigned_abs());
        let at = |place: u32, axis: usize, size: usize| {
            (place as usize + size - off[axis] as usize) % size
        };
        RgbaImage::from_fn(side(width), side(height), |x, y| {
            let [red, green, blue] = self.pixels[at(y, 1, height) * width + at(x, 0, width)]
                .expect("blocks leave no gap");
            Rgba([red, green, blue, u8::MAX])
        })
    }
}

/// Square of the distance of two colours.
fn difference(a: [u8; 3], b: [u8; 3]) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

/// The cheapest way along a strip, which goes at most one place aside at a time: its place across
/// at each place along.
fn cut(length: usize, breadth: usize, cost: impl Fn(usize, usize) -> u32) -> Vec<usize> {
    let near = |across: usize| across.saturating_sub(1)..(across + 2).min(breadth);
    let mut sums: Vec<Vec<u64>> = Vec::with_capacity(length);
    for along in 0..length {
        let before = |across: usize| {
            let least = |sums: &Vec<u64>| sums[near(across)].iter().copied().min();
            sums.last().and_then(least).unwrap_or(0)
        };
        let row =
            (0..breadth).map(|across| before(across) + u64::from(cost(along, across))).collect();
        sums.push(row);
    }
    let mut way = vec![0; length];
    let mut reach = 0..breadth;
    for (place, sums) in way.iter_mut().zip(&sums).rev() {
        *place = reach.min_by_key(|&across| sums[across]).unwrap_or(0);
        reach = near(*place);
    }
    way
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::super::plane::without_shading;
    use super::super::register::register;
    use super::*;
    use warpknit_core::ids::index32;
    use warpknit_render::ply::hash;

    const LATTICE: Lattice = Lattice { a: DVec2::new(20.0, 0.0), b: DVec2::new(4.0, 16.0) };

    /// A cloth of two bumps a cell, in a light that is lighter by a share on the right, with so
    /// much noise.
    fn cloth(size: [usize; 2], light: f64, noise: f64) -> RgbImage {
        let inverse = LATTICE.matrix().inverse();
        RgbImage::from_fn(side(size[0]), side(size[1]), |x, y| {
            let count = inverse * DVec2::new(f64::from(x), f64::from(y));
            let wave = 0.6 * (TAU * count.x).cos()
                + 0.4 * (TAU * (count.y - count.x)).sin()
                + 0.2 * (2.0 * TAU * count.y).cos();
            let random = f64::from(hash(y * 1000 + x)) / f64::from(u32::MAX) - 0.5;
            let lit = 1.0 + light * (f64::from(x) / double(size[0]) - 0.5);
            let grey = narrow((120.0 + 50.0 * wave + noise * random) * lit);
            Rgb([byte(grey), byte(0.8 * grey), byte(0.5 * grey)])
        })
    }

    fn quilted(picture: &RgbImage) -> RgbaImage {
        quilt(picture, &register(&without_shading(&Plane::lightness(picture)), &LATTICE), &LATTICE)
    }

    /// Mean difference of the red of pixels, each from the one that a function gives.
    fn differs(picture: &RgbaImage, of: impl Fn(u32, u32) -> Option<[u32; 2]>) -> f64 {
        let pairs = picture.enumerate_pixels().filter_map(|(x, y, pixel)| {
            of(x, y).map(|[x, y]| f64::from(pixel.0[0].abs_diff(picture.get_pixel(x, y).0[0])))
        });
        let values: Vec<f64> = pairs.collect();
        values.iter().sum::<f64>() / double(values.len())
    }

    #[test]
    fn a_cut_follows_the_valley_and_costs_least() {
        let valley = [2, 3, 3, 4, 3, 2, 1, 1_usize];
        assert_eq!(cut(8, 6, |along, across| if valley[along] == across { 0 } else { 9 }), valley);
        assert_eq!(cut(3, 1, |_, _| 5), [0, 0, 0]);
        let cost = |along: usize, across: usize| hash(index32(7 * along + across)) % 100;
        let paths = (0..4_usize.pow(5))
            .map(|code| [0, 1, 2, 3, 4].map(|along| code / 4_usize.pow(along) % 4));
        let allowed = paths.filter(|path| path.windows(2).all(|two| two[0].abs_diff(two[1]) <= 1));
        let of = |path: &[usize]| {
            path.iter().enumerate().map(|(along, across)| cost(along, *across)).sum::<u32>()
        };
        assert_eq!(of(&cut(5, 4, cost)), allowed.map(|path| of(&path)).min().unwrap());
    }

    #[test]
    fn identical_cells_give_those_cells() {
        for size in [[240, 220], [75, 70]] {
            let picture = cloth(size, 0.0, 0.0);
            let texture = quilted(&picture);
            let [width, height] = [20, 16_u32];
            assert!(
                texture.width().is_multiple_of(width)
                    && texture.height().is_multiple_of(height)
                    && texture.width() >= 3 * width
            );
            let next = |x: u32, y: u32| {
                Some([(x + width) % texture.width(), (y + height) % texture.height()])
            };
            assert!(differs(&texture, next) < 4.0, "{}", differs(&texture, next));
            // In the middle of the photo nothing is moved: the cell there is the texture's.
            let light = |at: DVec2| {
                interpolate_bilinear(&picture, narrow(at.x), narrow(at.y)).unwrap().0[0]
            };
            let corner = LATTICE.matrix() * DVec2::new(1.0, 1.0);
            let off = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).map(|[x, y]| {
                let at =
                    corner + LATTICE.a * (f64::from(x) / 20.0) + LATTICE.b * (f64::from(y) / 16.0);
                f64::from(light(at).abs_diff(texture.get_pixel(x, y).0[0]))
            });
            let mean = off.sum::<f64>() / 320.0;
            assert!(mean < 6.0, "{size:?}: {mean}");
        }
    }

    #[test]
    fn no_seam_is_seen_where_it_tiles() {
        let texture = quilted(&cloth([300, 260], 0.0, 60.0));
        let (width, height) = texture.dimensions();
        let across = |edge: bool| {
            differs(&texture, |x, y| ((x + 1 == width) == edge).then_some([(x + 1) % width, y]))
        };
        let down = |edge: bool| {
            differs(&texture, |x, y| ((y + 1 == height) == edge).then_some([x, (y + 1) % height]))
        };
        assert!(across(true) < 1.15 * across(false), "{} {}", across(true), across(false));
        assert!(down(true) < 1.15 * down(false), "{} {}", down(true), down(false));
        // Noise is the photo's own, and not the mean of some copies.
        let cells = differs(&texture, |x, y| Some([(x + 20) % width, y]));
        assert!(cells > 10.0, "{cells}");
    }

    #[test]
    fn uneven_light_is_taken_off() {
        let texture = quilted(&cloth([300, 260], 0.4, 0.0));
        let mean = |column: u32| {
            let cell = image::imageops::crop_imm(&texture, 20 * column, 0, 20, texture.height())
                .to_image();
            cell.pixels().map(|pixel| f64::from(pixel.0[0])).sum::<f64>()
                / f64::from(20 * texture.height())
        };
        let means: Vec<f64> = (0..texture.width() / 20).map(mean).collect();
        let (low, high) = (
            means.iter().copied().fold(f64::MAX, f64::min),
            means.iter().copied().fold(0.0, f64::max),
        );
        assert!(high / low < 1.06, "{means:?}");
    }
}
