//! Centre lines of a block's strands, for the formats that hold curves.

use glam::{DVec3, Vec3};

use warpknit_core::drape::Block;
use warpknit_core::drape::strands::Strand;
use warpknit_core::yarn::line;

/// Points of a strand's centre line with St segments a stitch.
pub(super) fn count(strand: &Strand, st: u32) -> u32 {
    (strand.pieces.end - strand.pieces.start) * st + 1
}

/// Points of all centre lines of a block.
pub(super) fn count_all(block: &Block, st: u32) -> u64 {
    block.strands.strands.iter().map(|strand| u64::from(count(strand, st))).sum()
}

/// Calls `take` with the centre line of each strand of a block, mm.
pub(super) fn each(block: &Block, st: u32, mut take: impl FnMut(&[Vec3])) {
    let mut line = Vec::new();
    for strand in &block.strands.strands {
        line.clear();
        line::add(
            &block.draped.positions[strand.range()],
            block.strands.pieces_of(strand),
            st,
            &mut line,
        );
        line.iter_mut().for_each(|point| *point = in_file(block, *point));
        take(&line);
    }
}

/// A draped place of a block in the axes of the garment's file, mm.
#[inline]
pub(super) fn in_file(block: &Block, place: Vec3) -> Vec3 {
    // Most garments are near, and their places stay as they are, to the bit.
    if block.origin == DVec3::ZERO { place } else { (place.as_dvec3() + block.origin).as_vec3() }
}
