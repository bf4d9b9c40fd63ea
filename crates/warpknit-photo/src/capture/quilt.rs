//! `texture.png`: some cells each way that tile and are the photo's own cloth, with its lint and
//! its light and dark yarns. The mean cell shows none of these.
//!
//! In: the colours of the view, its [`DisplacementField`] and its lattice. Out: a picture along
//! both vectors, as the mean cell is: columns run along a, rows along b, and its corner is a cell's
//! corner.
//!
//! Method: image quilting (Efros and Freeman 2001, *Image quilting for texture synthesis and
//! transfer*). Blocks of one or two cells come from the photo, whole cells apart so that yarns
//! meet. Each block is the one that differs least from its neighbours in their overlap, and is cut
//! there along the minimum error boundary. The last block of a row overlaps the first one, and the
//! last row the first one, so that the picture tiles.
//!
//! Cost: about half a second, and four bytes for each pixel of the view. Not promised: patterns
//! wider than a block, and colours as in another light: only slow differences of the photo's light
//! are taken off.

use std::ops::Range;

use glam::DVec2;
use image::imageops::interpolate_bilinear;
use image::{Rgb, RgbImage, Rgba, RgbaImage};
use rayon::prelude::*;

use super::lattice::Lattice;
use super::register::DisplacementField;
use super::steps;
use crate::plane::{Plane, byte, double, float, narrow, side, whole};

/// Cells of the texture each way, at most.
const MAX_CELLS: usize = 6;
/// Pixels of the texture each way, at most, unless two blocks are more.
const MAX_PIXELS: f64 = 1024.0;
/// Cells each way that a photo has to show for blocks of two cells. Larger blocks keep more of the
/// photo, but need enough of them to choose from.
const CELLS_FOR_LARGE_BLOCKS: f64 = 8.0;
/// The overlap of blocks as a share of a cell. With a third, a block of one cell fits into any
/// photo that shows three cells each way. A much narrower overlap leaves the cut no choice.
const OVERLAP: f64 = 1.0 / 3.0;
/// The largest gain by which uneven light is corrected, either way.
const MAX_GAIN: f32 = 4.0;

/// A picture that tiles.
pub(super) fn quilt(picture: &RgbImage, field: &DisplacementField, lattice: &Lattice) -> RgbaImage {
    let blocks = BlockSizes::new(lattice, f64::from(picture.width().min(picture.height())));
    let source = Unsheared::new(&evenly_lit(picture, lattice), field, &blocks);
    let origins = source.origins();
    let mut texture = QuiltedTexture::empty(blocks);
    for row in 0..blocks.count[1] {
        for column in 0..blocks.count[0] {
            let overlap = texture.overlap_pixels(column, row);
            // Efros and Freeman choose at random among the good ones. Here the best one is taken,
            // and of equally good ones the first, which is nearest to the middle: the same photo
            // gives the same texture.
            let best = origins
                .par_iter()
                .enumerate()
                .min_by_key(|(number, origin)| (overlap_error(&overlap, &source, origin), *number));
            let [left, top] = *best.expect("the middle one, if no other").1;
            texture.place_block(column, row, |x, y| source.at(left + x, top + y).color);
        }
    }
    texture.picture(source.start)
}

/// Sum of squared differences of a block from the pixels that it will overlap.
fn overlap_error(
    overlap: &[([usize; 2], [u8; 3])],
    source: &Unsheared,
    [left, top]: &[usize; 2],
) -> u64 {
    overlap
        .iter()
        .map(|&([x, y], old)| u64::from(squared_distance(old, source.at(left + x, top + y).color)))
        .sum()
}

/// Sizes of blocks, pixels of the texture: columns along a, rows along b.
#[derive(Clone, Copy)]
struct BlockSizes {
    cell: [usize; 2],
    /// From one block to the next: whole cells.
    stride: [usize; 2],
    /// How far a block goes beyond that.
    overlap: [usize; 2],
    /// Number of blocks in the texture.
    count: [usize; 2],
}

impl BlockSizes {
    fn new(lattice: &Lattice, side: f64) -> Self {
        let cells = if side >= CELLS_FOR_LARGE_BLOCKS * lattice.longer() { 2 } else { 1 };
        let lengths = [lattice.a, lattice.b].map(DVec2::length);
        let cell = lengths.map(|length| whole(narrow(length.round())).max(8));
        // Two blocks at least: a single one would have to overlap itself.
        let count = lengths.map(|length| {
            whole(narrow(side.min(MAX_PIXELS) / (length * double(cells))))
                .clamp(2, MAX_CELLS / cells)
        });
        Self {
            cell,
            stride: cell.map(|cell| cells * cell),
            overlap: cell.map(|cell| whole(narrow(OVERLAP * double(cell)))),
            count,
        }
    }

    /// Size of one block with its overlap.
    fn size(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.stride[axis] + self.overlap[axis])
    }

    /// Size of the texture.
    fn texture_size(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.stride[axis] * self.count[axis])
    }
}

/// A photo without slow differences of its light.
fn evenly_lit(picture: &RgbImage, lattice: &Lattice) -> RgbImage {
    let grey = Plane::grey(picture, 1);
    let sigma = (1.5 * narrow(lattice.longer())).max(float(grey.width.min(grey.height)) / 8.0);
    let slow = grey.smoothed(sigma);
    let mean = slow.values.iter().sum::<f32>() / float(slow.values.len());
    // One gain for all three channels, which keeps the colours.
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let gain =
            (mean / slow.at(x as usize, y as usize).max(1.0)).clamp(1.0 / MAX_GAIN, MAX_GAIN);
        Rgb(picture.get_pixel(x, y).0.map(|value| byte(f32::from(value) * gain)))
    })
}

/// A pixel of the photo along its cloth's vectors.
#[derive(Clone, Copy)]
struct SourcePixel {
    color: [u8; 3],
    /// Whether the photo shows that place.
    is_inside: bool,
}

/// A photo resampled along both vectors of its cloth, without shear and displacement.
struct Unsheared {
    width: usize,
    pixels: Vec<SourcePixel>,
    /// The position of its corner, where a cell's corner is at 0.
    start: [i32; 2],
    /// The block in the middle of the photo.
    middle: [usize; 2],
    blocks: BlockSizes,
}

impl Unsheared {
    fn new(picture: &RgbImage, field: &DisplacementField, blocks: &BlockSizes) -> Self {
        let cell = DVec2::from(blocks.cell.map(double));
        let last = DVec2::new(f64::from(picture.width()), f64::from(picture.height())) - 1.0;
        let [centre, corners @ ..] = [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|share| field.cell_coordinates(last * DVec2::from(share)) * cell);
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
        let pixels = (0..width * height)
            .into_par_iter()
            .map(|at| {
                let offset = DVec2::new(double(at % width), double(at / width));
                let place = field.pixel_at((start + offset) / cell);
                let near = place.clamp(DVec2::ZERO, last);
                let color = interpolate_bilinear(picture, narrow(near.x), narrow(near.y))
                    .map_or([0; 3], |Rgb(color)| color);
                SourcePixel { color, is_inside: near == place }
            })
            .collect();
        let middle = [0, 1].map(|axis| whole(narrow(before[axis])) * blocks.cell[axis]);
        Self { width, pixels, start: start.to_array().map(steps), middle, blocks: *blocks }
    }

    fn at(&self, x: usize, y: usize) -> SourcePixel {
        self.pixels[y * self.width + x]
    }

    /// Corners of all blocks that the photo shows entirely, those nearest to its middle first.
    fn origins(&self) -> Vec<[usize; 2]> {
        let [width, height] = self.blocks.size();
        let mut origins = Vec::new();
        for y in (0..=self.pixels.len() / self.width - height).step_by(self.blocks.cell[1]) {
            for x in (0..=self.width - width).step_by(self.blocks.cell[0]) {
                if self.is_block_inside(x, y) {
                    origins.push([x, y]);
                }
            }
        }
        origins.sort_by_key(|origin| {
            [0, 1].map(|axis| origin[axis].abs_diff(self.middle[axis]).pow(2)).iter().sum::<usize>()
        });
        if origins.is_empty() { vec![self.middle] } else { origins }
    }

    /// Whether the photo shows all of a block.
    fn is_block_inside(&self, left: usize, top: usize) -> bool {
        let [width, height] = self.blocks.size();
        (top..top + height).all(|y| (left..left + width).all(|x| self.at(x, y).is_inside))
    }
}

/// The texture while it is made. It is periodic on all sides.
struct QuiltedTexture {
    blocks: BlockSizes,
    pixels: Vec<Option<[u8; 3]>>,
}

impl QuiltedTexture {
    fn empty(blocks: BlockSizes) -> Self {
        Self { blocks, pixels: vec![None; blocks.texture_size().iter().product()] }
    }

    /// The index of a block's pixel.
    fn index(&self, column: usize, row: usize, x: usize, y: usize) -> usize {
        let ([width, height], [across, down]) = (self.blocks.texture_size(), self.blocks.stride);
        (row * down + y) % height * width + (column * across + x) % width
    }

    /// The pixels that are there already where a block will be.
    fn overlap_pixels(&self, column: usize, row: usize) -> Vec<([usize; 2], [u8; 3])> {
        let [width, height] = self.blocks.size();
        let mut pixels = Vec::new();
        for y in 0..height {
            for x in 0..width {
                if let Some(color) = self.pixels[self.index(column, row, x, y)] {
                    pixels.push(([x, y], color));
                }
            }
        }
        pixels
    }

    /// Copies a block up to the cuts through its overlaps.
    fn place_block(&mut self, column: usize, row: usize, color: impl Fn(usize, usize) -> [u8; 3]) {
        let ([width, height], [across, down]) = (self.blocks.size(), self.blocks.overlap);
        let cost = |x: usize, y: usize| {
            let old = self.pixels[self.index(column, row, x, y)];
            old.map_or(0, |old| squared_distance(old, color(x, y)))
        };
        // Every block has a neighbour before it, and the last one of a row or column has the first
        // one after it too, since the texture tiles.
        let [is_last_column, is_last_row] =
            [(column, 0), (row, 1)].map(|(at, axis)| at == self.blocks.count[axis] - 1);
        let horizontal = Cuts {
            before: (column > 0).then(|| min_cost_path(height, across, |y, x| cost(x, y))),
            after: is_last_column
                .then(|| min_cost_path(height, across, |y, x| cost(width - across + x, y))),
            size: width,
            overlap: across,
        };
        let vertical = Cuts {
            before: (row > 0).then(|| min_cost_path(width, down, cost)),
            after: is_last_row
                .then(|| min_cost_path(width, down, |x, y| cost(x, height - down + y))),
            size: height,
            overlap: down,
        };
        for y in 0..height {
            for x in horizontal.inside(y) {
                if vertical.inside(x).contains(&y) {
                    let index = self.index(column, row, x, y);
                    self.pixels[index] = Some(color(x, y));
                }
            }
        }
    }

    /// The picture with a cell's corner in its corner. `start` is the position of the blocks' own
    /// corner relative to a cell's.
    fn picture(&self, start: [i32; 2]) -> RgbaImage {
        let [width, height] = self.blocks.texture_size();
        let [off_x, off_y] = [(start[0], width), (start[1], height)]
            .map(|(start, size)| start.rem_euclid(steps(double(size))).unsigned_abs() as usize);
        RgbaImage::from_fn(side(width), side(height), |x, y| {
            let column = (x as usize + width - off_x) % width;
            let row = (y as usize + height - off_y) % height;
            let [red, green, blue] =
                self.pixels[row * width + column].expect("blocks leave no gap");
            Rgba([red, green, blue, u8::MAX])
        })
    }
}

/// The cuts through a block's overlaps on two opposite sides: the place across the overlap for each
/// place along it.
struct Cuts {
    before: Option<Vec<usize>>,
    after: Option<Vec<usize>>,
    /// Pixels of the block across the cuts.
    size: usize,
    overlap: usize,
}

impl Cuts {
    /// The pixels between both cuts at a place along them.
    fn inside(&self, along: usize) -> Range<usize> {
        let first = self.before.as_ref().map_or(0, |cut| cut[along]);
        let end =
            self.after.as_ref().map_or(self.size, |cut| self.size - self.overlap + cut[along]);
        first..end
    }
}

/// Square of the distance of two colours.
fn squared_distance(a: [u8; 3], b: [u8; 3]) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

/// The minimum error boundary cut of Efros and Freeman 2001, by dynamic programming: the cheapest
/// path along a strip that moves aside by at most one place a step. Gives its place across at each
/// place along.
fn min_cost_path(length: usize, breadth: usize, cost: impl Fn(usize, usize) -> u32) -> Vec<usize> {
    // Least costs from the start to each place.
    let mut sums: Vec<Vec<u64>> = Vec::with_capacity(length);
    for along in 0..length {
        let row = (0..breadth)
            .map(|across| {
                let before = sums
                    .last()
                    .and_then(|sums| sums[within_one(across, breadth)].iter().copied().min());
                before.unwrap_or(0) + u64::from(cost(along, across))
            })
            .collect();
        sums.push(row);
    }
    // Backtracking from the cheapest end.
    let mut path = vec![0; length];
    let mut reach = 0..breadth;
    for (place, sums) in path.iter_mut().zip(&sums).rev() {
        *place = reach.min_by_key(|&across| sums[across]).unwrap_or(0);
        reach = within_one(*place, breadth);
    }
    path
}

/// A place across a strip and its neighbours.
fn within_one(across: usize, breadth: usize) -> Range<usize> {
    across.saturating_sub(1)..(across + 2).min(breadth)
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
        assert_eq!(
            min_cost_path(8, 6, |along, across| if valley[along] == across { 0 } else { 9 }),
            valley
        );
        assert_eq!(min_cost_path(3, 1, |_, _| 5), [0, 0, 0]);
        let cost = |along: usize, across: usize| hash(index32(7 * along + across)) % 100;
        let paths = (0..4_usize.pow(5))
            .map(|code| [0, 1, 2, 3, 4].map(|along| code / 4_usize.pow(along) % 4));
        let allowed = paths.filter(|path| path.windows(2).all(|two| two[0].abs_diff(two[1]) <= 1));
        let of = |path: &[usize]| {
            path.iter().enumerate().map(|(along, across)| cost(along, *across)).sum::<u32>()
        };
        assert_eq!(of(&min_cost_path(5, 4, cost)), allowed.map(|path| of(&path)).min().unwrap());
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
    fn no_seam_is_visible_where_it_tiles() {
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
