//! What each cell of the picture sees: pieces of yarn, front to back, each with a mask of places.
//!
//! In: pieces of a tile, in blocks. Out: [`TileFragments`]. Masks are gathered cell by cell, sorted by depth
//! and taken from the places that are left. Ties go to the piece with the lower number, so the
//! result does not depend on the order of pieces.
//!
//! Two depths serve a piece in a cell, one for its core and one for its rims. Where pieces cut each other within a cell, one of them hides
//! all of the other there.

use glam::Vec2;

use super::blocks::BlockEntry;
use super::masks::{HalfPlanes, Stroke};
use super::pieces::SplatPieces;
use super::screen::Screen;

/// Side of a tile, cells. Larger tiles read more pieces that they do not see. Smaller ones read
/// each piece more often.
pub(super) const SIDE: u32 = 16;
const CELLS: usize = (SIDE * SIDE) as usize;
/// Mean height of a yarn's visible half over its axis, radii.
const MEAN_RISE: f32 = std::f32::consts::FRAC_PI_4;
/// Part of a yarn's width that is its core; the rest are its rims. Where yarns lie side by side at
/// one height, the core of the one hides the rim of the other. A single depth for both would show
/// too many rims, which face away, and make cloth 6 % too dark.
const CORE: f32 = 0.7;
/// Mean heights of the core and of the rims over the axis, radii: means of sqrt(1 - x^2) from 0 to
/// 0.7 and from there to 1.
const CORE_RISE: f32 = 0.911;
const RIM_RISE: f32 = 0.493;

/// A piece of yarn where it is visible in a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment {
    /// The places that it covers, nearer pieces left out.
    pub(super) mask: u64,
    /// First data point of the piece.
    pub(super) piece: u32,
    /// Mean depth of its surface.
    pub(super) depth: f32,
}

/// The fragments of a tile's cells.
#[derive(Debug, Default)]
pub(super) struct TileFragments {
    /// Where each cell's fragments begin. Empty for a tile without any.
    starts: Vec<u32>,
    fragments: Vec<Fragment>,
}

impl TileFragments {
    /// Fragments of the cell in a column and row of the tile.
    pub(super) fn cell(&self, [x, y]: [u32; 2]) -> &[Fragment] {
        let cell = (y * SIDE + x) as usize;
        match self.starts.get(cell..cell + 2) {
            Some(&[start, end]) => &self.fragments[start as usize..end as usize],
            _ => &[],
        }
    }
}

/// A piece in a cell before nearer ones are taken from it.
#[derive(Clone, Copy, Debug)]
struct CellPiece {
    /// Depth in the upper 32 bits, number of the piece in the lower ones. Non-negative floats order
    /// like their bits.
    key: u64,
    mask: u64,
    depth: f32,
}

/// Memory that tiles use one after another.
pub(super) struct TileMemory {
    cells: Vec<Vec<CellPiece>>,
    /// Places that pieces of the tile cover so far.
    covered: [u64; CELLS],
    /// Places that pieces cover which lie in front of all that is still to come.
    hidden: [u64; CELLS],
    blocks: Vec<BlockEntry>,
}

impl TileMemory {
    pub(super) fn new() -> Self {
        Self {
            cells: vec![Vec::new(); CELLS],
            covered: [0; CELLS],
            hidden: [0; CELLS],
            blocks: Vec::new(),
        }
    }

    /// The tile whose first cell is `corner`.
    pub(super) fn tile(
        &mut self,
        (pieces, screen, planes): (&SplatPieces, &Screen, &HalfPlanes),
        corner: [u32; 2],
        blocks: &[BlockEntry],
    ) -> TileFragments {
        if blocks.is_empty() {
            return TileFragments::default();
        }
        self.covered = [0; CELLS];
        self.hidden = [0; CELLS];
        let mut sorted = std::mem::take(&mut self.blocks);
        sorted.clear();
        sorted.extend_from_slice(blocks);
        sorted.sort_unstable_by_key(|block| (block.nearest.to_bits(), block.first));
        let mut farthest = 0.0_f32;
        for block in &sorted {
            // From here on all is behind what was drawn so far, so that what is covered stays so.
            if block.nearest > farthest && farthest > 0.0 {
                self.hidden = self.covered;
                if self.hidden.iter().all(|mask| *mask == u64::MAX) {
                    break;
                }
            }
            pieces.for_each_in_block(block.first, screen, |number, ends, silhouette| {
                farthest = farthest.max(ends[0].z.max(ends[1].z) + silhouette.rise);
                self.draw(
                    planes,
                    corner,
                    number,
                    &screen.stroke(ends, silhouette.half_width),
                    ends.map(|end| end.z),
                    silhouette.rise,
                );
            });
        }
        self.blocks = sorted;
        self.resolve()
    }

    /// Adds a piece to the cells of a tile that it covers.
    fn draw(
        &mut self,
        planes: &HalfPlanes,
        corner: [u32; 2],
        number: u32,
        stroke: &Stroke,
        [start, end]: [f32; 2],
        rise: f32,
    ) {
        let (low, high) = stroke.extent();
        let [columns, rows] = [0, 1].map(|axis| within(low[axis], high[axis], corner[axis]));
        for y in rows {
            for x in columns.clone() {
                let cell = (y * SIDE + x) as usize;
                if self.hidden[cell] == u64::MAX {
                    continue;
                }
                let centre = Vec2::new((corner[0] + x) as f32 + 0.5, (corner[1] + y) as f32 + 0.5);
                let [whole, core] = planes.masks(stroke, CORE, centre);
                let mask = whole & !self.hidden[cell];
                if mask != 0 {
                    self.covered[cell] |= mask;
                    let axis = start + (end - start) * stroke.share(centre);
                    let core = mask & core;
                    for (mask, share) in [(core, CORE_RISE), (mask & !core, RIM_RISE)] {
                        if mask != 0 {
                            let front = (axis - share * rise).max(0.0);
                            let key = u64::from(front.to_bits()) << 32 | u64::from(number);
                            let depth = axis - MEAN_RISE * rise;
                            self.cells[cell].push(CellPiece { key, mask, depth });
                        }
                    }
                }
            }
        }
    }

    /// Sorts the candidates of all cells and takes nearer ones from farther ones.
    fn resolve(&mut self) -> TileFragments {
        let mut tile =
            TileFragments { starts: Vec::with_capacity(CELLS + 1), fragments: Vec::new() };
        for candidates in &mut self.cells {
            tile.starts.push(warpknit_core::ids::index32(tile.fragments.len()));
            candidates.sort_unstable_by_key(|candidate| candidate.key);
            let first = tile.fragments.len();
            let mut left = u64::MAX;
            for candidate in candidates.iter() {
                let mask = candidate.mask & left;
                if mask != 0 {
                    left &= !mask;
                    #[expect(clippy::cast_possible_truncation, reason = "the lower half is meant")]
                    let piece = candidate.key as u32;
                    let own = &mut tile.fragments[first..];
                    match own.iter_mut().find(|fragment| fragment.piece == piece) {
                        Some(core) => core.mask |= mask,
                        None => {
                            tile.fragments.push(Fragment { mask, piece, depth: candidate.depth });
                        }
                    }
                    if left == 0 {
                        break;
                    }
                }
            }
            candidates.clear();
        }
        tile.starts.push(warpknit_core::ids::index32(tile.fragments.len()));
        tile.fragments.shrink_to_fit();
        tile
    }
}

/// Columns or rows of a tile between two places of the picture.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the tile's side"
)]
fn within(low: f32, high: f32, corner: u32) -> std::ops::Range<u32> {
    let side = SIDE as f32;
    let [low, high] = [low, high].map(|at| at - corner as f32);
    // Beyond the tile's end, `low` gives an empty range.
    (low.clamp(0.0, side) as u32)..((high + 1.0).clamp(0.0, side) as u32)
}
