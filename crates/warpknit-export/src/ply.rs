//! Tubes as binary PLY, little-endian: positions, normals, texture coordinates (s, t) and the bar's
//! colour at each vertex, then all triangles, mm.
//!
//! One pass: the counts in the header are known last, and the head gets room for them, and so are
//! the vertices before which no triangle may stand; but which vertices a tube's triangles join
//! follows from its length ([`faces`]), so that triangles are made at the end and only the tubes'
//! lengths are kept, 4 bytes a strand. Property names are those that Blender, MeshLab and
//! CloudCompare take for what they are.

use std::ops::Range;
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use super::buffer::{Buffer, Conveyor};
use super::patched_header::HeadLast;
use super::{ExportError, Output, Sink};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;
use warpknit_core::yarn::faces;
use warpknit_core::yarn::tube::Section;

/// Strands whose triangles are made at a time by one thread.
const STRANDS: usize = 16;

/// A vertex as it lies in the file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
    texture: Vec2,
    color: [u8; 3],
}

/// A triangle as it lies in the file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed)]
struct Face {
    corners: u8,
    vertices: [u32; 3],
}

/// Writes tubes as PLY.
#[derive(Debug)]
pub struct PlyWriter {
    file: HeadLast,
    /// What tubes the blocks have.
    section: Section,
    /// Each bar's colour, sRGB.
    colors: Vec<[u8; 3]>,
    /// Vertices of each strand.
    strands: Vec<u32>,
    /// Of all of them.
    vertices: u64,
    conveyor: Conveyor,
}

impl PlyWriter {
    /// Starts the file of a fabric's tubes, which all have this section.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric, section: &Section) -> Result<Self, ExportError> {
        let colors = fabric.yarns().map(|yarn| yarn.color.0).collect();
        // Counts are never longer than these.
        let file = HeadLast::create(target, header(u64::MAX, u64::MAX, 0).len())?;
        Ok(Self {
            file,
            section: *section,
            colors,
            strands: Vec::new(),
            vertices: 0,
            conveyor: Conveyor::default(),
        })
    }

    /// Vertices of all strands in turn, numbered through.
    fn numbered(&self) -> Vec<Range<u32>> {
        let mut next = 0_u32;
        let number = |&count: &u32| {
            let first = next;
            next += count;
            first..next
        };
        self.strands.iter().map(number).collect()
    }
}

impl Sink for PlyWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let strands = blocks.iter().flat_map(|block| &block.tubes.strands);
        self.strands.extend(strands.map(|(vertices, _)| vertices.end - vertices.start));
        self.vertices += blocks.iter().map(|block| block.tubes.positions.len() as u64).sum::<u64>();
        if self.vertices > u64::from(u32::MAX) {
            // Said now, not when the disk is full of what can't be numbered.
            return Err(ExportError::TooMany {
                path: self.file.target().to_owned(),
                vertices: self.vertices,
            });
        }
        let Self { file, colors, conveyor, .. } = self;
        conveyor.carry(
            blocks,
            |block, bytes| add_vertices(block, colors[block.bar], bytes),
            |bytes| file.write(bytes),
        )
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        let strands = self.numbered();
        let Self { file, section, conveyor, vertices, .. } = &mut *self;
        let strands: Vec<_> = strands.chunks(STRANDS).collect();
        let count = strands
            .iter()
            .copied()
            .flatten()
            .map(|vertices| faces::count(section, vertices) as u64)
            .sum();
        let add = |strands: &&[Range<u32>], bytes: &mut Buffer| {
            strands.iter().for_each(|vertices| add_faces(section, vertices.clone(), bytes));
        };
        conveyor.carry(&strands, add, |bytes| file.write(bytes))?;
        let padding = file.room() - header(*vertices, count, 0).len();
        let header = header(*vertices, count, padding);
        Ok(vec![self.file.finish(header.as_bytes())?])
    }
}

/// The header, so many characters longer than it would be.
fn header(vertices: u64, faces: u64, padding: usize) -> String {
    format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         comment yarns by warpknit, mm{:padding$}\n\
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

fn add_vertices(block: &Block, color: [u8; 3], bytes: &mut Buffer) {
    let tubes = &block.tubes;
    let vertices = bytemuck::cast_slice_mut::<_, Vertex>(
        bytes.grow(tubes.positions.len() * size_of::<Vertex>()),
    );
    let values = tubes.positions.iter().zip(&tubes.normals).zip(&tubes.uvs);
    for (vertex, ((&position, &normal), &texture)) in vertices.iter_mut().zip(values) {
        *vertex = Vertex { position, normal, texture, color };
    }
}

fn add_faces(section: &Section, vertices: Range<u32>, bytes: &mut Buffer) {
    let count = faces::count(section, &vertices);
    let mut faces =
        bytemuck::cast_slice_mut::<_, Face>(bytes.grow(count * size_of::<Face>())).iter_mut();
    faces::for_each(section, vertices, |vertices| {
        if let Some(face) = faces.next() {
            *face = Face { corners: 3, vertices };
        }
    });
}
