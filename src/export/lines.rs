//! Centre lines of a block's strands, for the formats that hold curves.

use glam::Vec3;

use crate::drape::Block;
use crate::drape::strands::Strand;
use crate::yarn::line;

/// Points of a strand's centre line with St segments a stitch.
pub(super) fn count(strand: &Strand, st: u32) -> u32 {
    (strand.pieces.end - strand.pieces.start) * st + 1
}

/// Calls `take` with each strand of a block and its centre line, mm.
pub(super) fn each(block: &Block, st: u32, mut take: impl FnMut(&Strand, &[Vec3])) {
    let mut line = Vec::new();
    for strand in &block.strands.strands {
        let (start, end) = (strand.points.start as usize, strand.points.end as usize);
        let stitches = block.strands.pieces_of(strand).map(|piece| piece.start as usize - start..piece.end as usize - start);
        line.clear();
        line::add(&block.draped.positions[start..end], stitches, st, &mut line);
        take(strand, &line);
    }
}
