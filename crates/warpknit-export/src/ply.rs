//! Tubes as binary PLY, little-endian (Greg Turk, "The PLY Polygon File Format", 1994): positions,
//! normals, texture coordinates (s, t) and the bar's colour at each vertex, then all triangles, mm unless [`Axes`] say otherwise.
//!
//! The file is written in one pass. Its header counts vertices and triangles, which are known last,
//! so it gets room. All vertices stand before all triangles, but triangles need not wait: a tube's
//! triangles follow from its number of vertices ([`faces`]). Only that number is kept, 4 bytes a
//! strand, and the triangles are made at the end. Properties have the names by which Blender,
//! MeshLab and CloudCompare recognise them.

use std::io::{Seek, Write};
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use super::buffer::{Buffer, BufferPool};
use super::lines::in_file;
use super::patched_header::PatchedHeader;
use super::{Axes, ClothInfo, Destination, ExportError, Sink};
use warpknit_core::drape::Block;
use warpknit_core::yarn::faces;
use warpknit_core::yarn::tube::Section;

/// Strands whose triangles are made at a time by one thread.
const STRANDS: usize = 16;

/// A vertex as it lies in the file: packed, since the format knows no padding.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
struct VertexRecord {
    position: Vec3,
    normal: Vec3,
    texture: Vec2,
    color: [u8; 3],
}

/// A triangle as it lies in the file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
struct TriangleRecord {
    corners: u8,
    vertices: [u32; 3],
}

/// Writes tubes as PLY.
#[derive(Debug)]
pub struct PlyWriter<W> {
    file: PatchedHeader<W>,
    /// That of the blocks' tubes.
    section: Section,
    axes: Axes,
    /// Each bar's colour, sRGB.
    colors: Vec<[u8; 3]>,
    /// Vertices of each strand.
    strands: Vec<u32>,
    /// Vertices of all strands.
    vertices: u64,
    buffers: BufferPool,
}

impl<W: Write + Seek + Send> PlyWriter<W> {
    /// Starts the file of tubes, which all have the cloth's section.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        // No count is longer than these.
        let room = header(cloth.axes, u64::MAX, u64::MAX, 0).len();
        Ok(Self {
            file: PatchedHeader::create(target, Some(room))?,
            section: cloth.section,
            axes: cloth.axes,
            colors: cloth.strands.iter().map(|style| style.color.0).collect(),
            strands: Vec::new(),
            vertices: 0,
            buffers: BufferPool::default(),
        })
    }
}

/// The vertices of each strand, numbered through.
fn number_vertices(strands: &[u32]) -> Vec<Range<u32>> {
    let mut numbered = Vec::with_capacity(strands.len());
    let mut next = 0_u32;
    for count in strands {
        numbered.push(next..next + count);
        next += count;
    }
    numbered
}

impl<W: Write + Seek + Send> Sink<W> for PlyWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let strands = blocks.iter().flat_map(|block| &block.tubes.strands);
        self.strands.extend(strands.map(|(vertices, _)| vertices.end - vertices.start));
        self.vertices += blocks.iter().map(|block| block.tubes.positions.len() as u64).sum::<u64>();
        if self.vertices > u64::from(u32::MAX) {
            // Refused now, and not when the disk is full of vertices that can't be numbered.
            return Err(ExportError::TooMany {
                path: self.file.error_path(),
                vertices: self.vertices,
            });
        }
        let Self { file, axes, colors, buffers, .. } = self;
        buffers.write_each(
            blocks,
            |block, bytes| add_vertices(block, *axes, colors[block.bar], bytes),
            |bytes| file.write(bytes),
        )
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        let Self { mut file, section, axes, mut buffers, vertices, strands, .. } = *self;
        let strands = number_vertices(&strands);
        let faces = strands.iter().map(|vertices| faces::count(&section, vertices) as u64).sum();
        let strands: Vec<_> = strands.chunks(STRANDS).collect();
        buffers.write_each(
            &strands,
            |strands, bytes| {
                strands.iter().for_each(|vertices| add_faces(&section, vertices.clone(), bytes));
            },
            |bytes| file.write(bytes),
        )?;
        // A comment takes up what the counts leave of the room, so the body stays where it is.
        let padding = file.room() - header(axes, vertices, faces, 0).len();
        file.finish(header(axes, vertices, faces, padding).as_bytes())
    }
}

/// The header, lengthened by that many spaces in its comment.
fn header(axes: Axes, vertices: u64, faces: u64, padding: usize) -> String {
    let unit = axes.unit.name();
    format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         comment yarns by warpknit, {unit}{:padding$}\n\
         element vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property float s\nproperty float t\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {faces}\n\
         property list uchar uint vertex_indices\n\
         end_header\n",
        ""
    )
}

/// The vertices of a block.
fn add_vertices(block: &Block, axes: Axes, color: [u8; 3], bytes: &mut Buffer) {
    let tubes = &block.tubes;
    let vertices = bytemuck::cast_slice_mut::<_, VertexRecord>(
        bytes.grow(tubes.positions.len() * size_of::<VertexRecord>()),
    );
    let values = tubes.positions.iter().zip(&tubes.normals).zip(&tubes.uvs);
    for (vertex, ((&position, &normal), &texture)) in vertices.iter_mut().zip(values) {
        let position = axes.place(in_file(block, position));
        let normal = axes.direction(normal);
        *vertex = VertexRecord { position, normal, texture, color };
    }
}

/// The triangles of a tube with these vertices.
fn add_faces(section: &Section, vertices: Range<u32>, bytes: &mut Buffer) {
    let count = faces::count(section, &vertices);
    let mut faces = bytemuck::cast_slice_mut::<_, TriangleRecord>(
        bytes.grow(count * size_of::<TriangleRecord>()),
    )
    .iter_mut();
    faces::for_each(section, vertices, |vertices| {
        if let Some(face) = faces.next() {
            *face = TriangleRecord { corners: 3, vertices };
        }
    });
}
