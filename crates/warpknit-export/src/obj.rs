//! Tubes as Wavefront OBJ (Alias|Wavefront, "Advanced Visualizer Manual", appendix B1, "Object
//! Files (.obj)", version 3.0): one object a strand, with texture coordinates and normals, mm, to
//! four decimals, and a material a bar ([`super::mtl`]).
//!
//! The second texture coordinate is millimetres of yarn. Where a bar has a texture it counts
//! repeats of that, downward, since OBJ's pictures begin at the bottom.

use std::fmt::Write as _;
use std::io::{Seek, Write};
use std::ops::Range;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::buffer::{Buffer, BufferPool};
use super::digits::{add_line, decimal, thrice, word};
use super::lines::in_file;
use super::texture::TextureSet;
use super::{Axes, ClothInfo, Destination, ExportError, FileUnit, Sink, mtl};
use warpknit_core::drape::Block;

/// Writes tubes as text.
#[derive(Debug)]
pub struct ObjWriter<W> {
    target: Destination<W>,
    textures: Arc<TextureSet>,
    axes: Axes,
    /// Vertices written so far.
    vertices: u64,
    buffers: BufferPool,
}

impl<W: Write + Seek + Send> ObjWriter<W> {
    /// Starts the file. Its materials and pictures are files of their own: [`mtl::companions`].
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(mut target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        target.write(mtl::obj_beginning(target.path()).as_bytes())?;
        let textures = Arc::clone(&cloth.textures);
        Ok(Self { target, textures, axes: cloth.axes, vertices: 0, buffers: BufferPool::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for ObjWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, vertices, buffers, textures, axes } = self;
        // Vertex numbers run through the file, so each block is given its first one before blocks
        // are written in parallel.
        let mut numbered = Vec::with_capacity(blocks.len());
        for block in blocks {
            numbered.push((block, *vertices));
            *vertices += block.tubes.positions.len() as u64;
        }
        buffers.write_each(
            &numbered,
            |(block, first), text| add_objects(block, *first, textures, *axes, text),
            |text| target.write(text),
        )
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        self.target.finish()
    }
}

/// The objects of a block whose first vertex has this number, counted from 0.
fn add_objects(block: &Block, first: u64, textures: &TextureSet, axes: Axes, text: &mut Buffer) {
    // Downward where there is a picture, since the format's pictures begin at the bottom.
    let along = textures.texture_of(block.bar).map_or(1.0, |_| -textures.repeats_per_mm(block.bar));
    for (strand, tube) in block.strands.strands.iter().zip(&block.tubes.strands) {
        let (panel, bar, yarn) = (block.panel, block.bar + 1, strand.yarn.0);
        write!(text, "o panel{panel}_bar{bar}_yarn{yarn}\nusemtl bar_{bar}\n")
            .expect("memory takes all text");
        add_object(block, tube, first, along, axes, text);
    }
}

/// A strand's vertices and faces; `along` scales the texture coordinate along the yarn.
fn add_object(
    block: &Block,
    (vertices, triangles): &(Range<u32>, Range<u32>),
    first: u64,
    along: f32,
    axes: Axes,
    text: &mut Buffer,
) {
    let tubes = &block.tubes;
    let vertices = vertices.start as usize..vertices.end as usize;
    for position in &tubes.positions[vertices.clone()] {
        add_place(text, in_file(block, *position), axes);
    }
    for &Vec2 { x, y } in &tubes.uvs[vertices.clone()] {
        add_numbers(text, "vt", [x, along * y]);
    }
    for normal in &tubes.normals[vertices] {
        let Vec3 { x, y, z } = axes.direction(*normal);
        add_numbers(text, "vn", [x, y, z]);
    }
    for triangle in &tubes.triangles[triangles.start as usize..triangles.end as usize] {
        // The format counts from 1, through the whole file.
        add_triangle(text, triangle.map(|vertex| u64::from(vertex) + first + 1));
    }
}

/// A vertex's place, mm, as the file has it.
pub(super) fn add_place(text: &mut Buffer, place: Vec3, axes: Axes) {
    let Vec3 { x, y, z } = axes.place(place);
    if axes.unit == FileUnit::Mm {
        add_numbers(text, "v", [x, y, z]);
    } else {
        let decimals = axes.unit.decimals();
        writeln!(text, "v {x:.decimals$} {y:.decimals$} {z:.decimals$}")
            .expect("memory takes all text");
    }
}

/// A line of numbers behind their keyword.
fn add_numbers<const N: usize>(text: &mut Buffer, keyword: &str, numbers: [f32; N]) {
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
fn add_triangle(text: &mut Buffer, corners: [u64; 3]) {
    add_line(text, |line| {
        let at = word(line, 0, u64::from(b'f'), 1);
        let at = corners.into_iter().fold(at, |at, corner| thrice(line, at, corner, *b" //"));
        word(line, at, u64::from(b'\n'), 1)
    });
}
