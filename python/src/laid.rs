//! The yarns of a cloth as flat arrays.
//!
//! In: blocks as `warpknit::drape::run` delivers them, whose memory is used again. Out: [`LaidArrays`], a
//! row a point and a row a strand, as numpy takes them. Cost: 88 bytes a point.

use glam::DVec3;
use warpknit::drape::strands::Strand;
use warpknit::drape::{Block, Cloth, DrapeOptions, Totals, run};
use warpknit::ids::index32;
use warpknit::map::relaxed::StrainCounts;

use crate::work::{Stopped, Watch};

/// The arrays of all yarns.
#[derive(Default)]
pub(crate) struct LaidArrays {
    /// A row a point, mm: on the body.
    pub(crate) points: Vec<f64>,
    /// Unit normals of the cloth under each point.
    pub(crate) normals: Vec<f64>,
    /// On the panel: across the wales, along them, and out of the technical face.
    pub(crate) flat: Vec<f64>,
    pub(crate) course: Vec<i32>,
    pub(crate) wale: Vec<i32>,
    /// Where the points of each strand begin, and at the end where the last one's end.
    pub(crate) offsets: Vec<i64>,
    /// A row a strand.
    pub(crate) yarn: Vec<i32>,
    pub(crate) panel: Vec<i32>,
    pub(crate) bar: Vec<i32>,
    /// The first point of each stitch, counted from the strand's first.
    pub(crate) stitches: Vec<u32>,
    /// Where the stitches of each strand begin in `stitches`.
    pub(crate) first_stitches: Vec<usize>,
    /// How many points of each panel lie where the cloth is strained too far.
    pub(crate) strain: Vec<StrainCounts>,
}

/// Knits and maps a cloth, and gathers its yarns.
///
/// # Errors
/// [`Stopped`] between blocks, if they are unwanted.
pub(crate) fn lay(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    watch: &Watch,
) -> Result<(LaidArrays, Totals), Stopped> {
    let strain = vec![StrainCounts::default(); cloth.garment().panels.len()];
    let mut laid =
        LaidArrays { offsets: vec![0], first_stitches: vec![0], strain, ..LaidArrays::default() };
    let totals =
        run(cloth, options, &mut |stage, share| watch.reach(stage, share), &mut |blocks| {
            watch.check_wanted()?;
            blocks.iter().for_each(|block| laid.add(block));
            Ok(())
        })?;
    Ok((laid, totals))
}

impl LaidArrays {
    fn add(&mut self, block: &Block) {
        if block.origin == DVec3::ZERO {
            self.points.extend_from_slice(bytemuck::cast_slice(&block.draped.positions));
        } else {
            let places = block.draped.positions.iter();
            self.points.extend(places.flat_map(|place| (*place + block.origin).to_array()));
        }
        self.normals.extend_from_slice(bytemuck::cast_slice(&block.draped.normals));
        self.flat.extend_from_slice(bytemuck::cast_slice(&block.strands.flat));
        self.strain[block.panel] += block.strain;
        for strand in &block.strands.strands {
            self.add_strand(block, strand);
        }
    }

    fn add_strand(&mut self, block: &Block, strand: &Strand) {
        for at in strand.range() {
            let tag = block.tag_near(at);
            self.course.push(tag.course);
            self.wale.push(tag.wale);
        }
        self.offsets.push(index64(self.course.len()));
        self.yarn.push(index(strand.yarn.0 as usize));
        self.panel.push(index(block.panel));
        self.bar.push(index(block.bar));
        let pieces = block.strands.pieces_of(strand);
        self.stitches.extend(pieces.map(|piece| index32(piece.start)));
        self.first_stitches.push(self.stitches.len());
    }
}

/// A number of things, of which there are far fewer than two thousand million.
fn index(number: usize) -> i32 {
    i32::try_from(number).unwrap_or(i32::MAX)
}

/// A number of things in memory.
pub(crate) fn index64(number: usize) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}
