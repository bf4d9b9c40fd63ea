//! Tubes as Wavefront OBJ: one object a strand, with texture coordinates and normals, mm, to four
//! decimals, and a material a bar ([`super::mtl`]).
//!
//! Where a bar's yarns wear a picture, the second texture coordinate counts its repeats, downward,
//! since OBJ's pictures begin at the bottom; else it is millimetres of yarn.

use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::buffer::{Buffer, Conveyor};
use super::digits::{add_line, decimal, thrice, word};
use super::texture::Wardrobe;
use super::{ExportError, Output, Sink, mtl};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;

/// Writes tubes as text.
#[derive(Debug)]
pub struct ObjWriter {
    output: Output,
    /// Materials and pictures.
    companions: Vec<Output>,
    wardrobe: Arc<Wardrobe>,
    /// Vertices written so far.
    vertices: u64,
    conveyor: Conveyor,
}

impl ObjWriter {
    /// Starts the file, and writes what comes with it: a material for each of the fabric's bars,
    /// with the pictures that the wardrobe has for it.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(
        target: &Path,
        fabric: &Fabric,
        wardrobe: Arc<Wardrobe>,
    ) -> Result<Self, ExportError> {
        let companions = mtl::write(target, fabric, &wardrobe)?;
        let mut output = Output::create(target)?;
        output.write_with(|file| {
            write!(file, "# yarns by warpknit, mm\n{}", mtl::reference(target))
        })?;
        Ok(Self { output, companions, wardrobe, vertices: 0, conveyor: Conveyor::default() })
    }
}

impl Sink for ObjWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { output, vertices, conveyor, wardrobe, .. } = self;
        let number = |block| {
            let first = *vertices;
            *vertices += block_vertices(block);
            (block, first)
        };
        let numbered: Vec<_> = blocks.iter().map(number).collect();
        conveyor.carry(
            &numbered,
            |(block, first), text| objects(block, *first, wardrobe, text),
            |text| output.write_with(|file| file.write_all(text)),
        )
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        let Self { output, companions, .. } = *self;
        Ok(std::iter::once(output.seal()?).chain(companions).collect())
    }
}

fn block_vertices(block: &Block) -> u64 {
    block.tubes.positions.len() as u64
}

/// The objects of a block whose first vertex is the file's `first`, counted from 0.
fn objects(block: &Block, first: u64, wardrobe: &Wardrobe, text: &mut Buffer) {
    let along = wardrobe.worn_by(block.bar).map_or(1.0, |_| -wardrobe.per_mm(block.bar));
    for (strand, tube) in block.strands.strands.iter().zip(&block.tubes.strands) {
        let (panel, bar, yarn) = (block.panel, block.bar + 1, strand.yarn.0);
        write!(text, "o panel{panel}_bar{bar}_yarn{yarn}\nusemtl bar_{bar}\n")
            .expect("memory takes all text");
        object(block, tube, first, along, text);
    }
}

fn object(
    block: &Block,
    (vertices, triangles): &(Range<u32>, Range<u32>),
    first: u64,
    along: f32,
    text: &mut Buffer,
) {
    let tubes = &block.tubes;
    let vertices = vertices.start as usize..vertices.end as usize;
    for &Vec3 { x, y, z } in &tubes.positions[vertices.clone()] {
        line(text, "v", [x, y, z]);
    }
    for &Vec2 { x, y } in &tubes.uvs[vertices.clone()] {
        line(text, "vt", [x, along * y]);
    }
    for &Vec3 { x, y, z } in &tubes.normals[vertices] {
        line(text, "vn", [x, y, z]);
    }
    for triangle in &tubes.triangles[triangles.start as usize..triangles.end as usize] {
        face(text, triangle.map(|vertex| u64::from(vertex) + first + 1));
    }
}

/// A line of numbers behind its keyword.
fn line<const N: usize>(text: &mut Buffer, keyword: &str, numbers: [f32; N]) {
    add_line(text, |line| {
        let mut at = keyword.bytes().fold(0, |at, letter| word(line, at, u64::from(letter), 1));
        for number in numbers {
            at = word(line, at, u64::from(b' '), 1);
            at = decimal(line, at, number);
        }
        word(line, at, u64::from(b'\n'), 1)
    });
}

/// A triangle whose positions, texture coordinates and normals have the same numbers.
fn face(text: &mut Buffer, corners: [u64; 3]) {
    add_line(text, |line| {
        let at = word(line, 0, u64::from(b'f'), 1);
        let at = corners.into_iter().fold(at, |at, corner| thrice(line, at, corner, *b" //"));
        word(line, at, u64::from(b'\n'), 1)
    });
}
