//! A block's tubes as the arrays that a `.glb` holds of them, in metres.
//!
//! In: a block. Out: a [`PreparedBlock`], whose memory is kept for the next block. Yarns with a
//! texture keep the vertices of their tubes; of others the first and the last vertex of a ring are
//! one. Indices count from the first vertex of each mesh part, and have 16 bits where those suffice.

use std::ops::Range;

use glam::{Vec2, Vec3};
use gltf_json as json;
use json::accessor::{ComponentType, Type};
use json::mesh::Semantic;

use super::glb_array::GlbArray;
use super::glb_grid::{Grid, quantised_normal};
use super::glb_options::{GlbOptions, Nodes, Precision};
use super::texture::TextureSet;
use warpknit_core::drape::Block;
use warpknit_core::ids::{YarnId, index32};
use warpknit_core::yarn::tube::Tubes;

pub(super) const METRES_PER_MM: f32 = 1e-3;

/// Those of a block's arrays that differ from its tubes'.
#[derive(Debug, Default)]
pub(super) struct PreparedBlock {
    /// m.
    positions: Vec<Vec3>,
    /// The same on the grid, if there is one.
    places: Vec<[u16; 4]>,
    /// Unit normals.
    normals: Vec<Vec3>,
    /// The same in 8 bits a coordinate, where files have them so; then `normals` is empty.
    short_normals: Vec<[i8; 4]>,
    /// Counted in repeats of the bar's texture; empty where it has none.
    uvs: Vec<Vec2>,
    /// The number of each of the tubes' vertices among the positions.
    numbers: Vec<u32>,
    /// Counted from the first vertex of each part.
    triangles: Vec<[u32; 3]>,
    /// The same where they fit; then `triangles` is empty.
    short_triangles: Vec<[u16; 3]>,
    pub(super) parts: Vec<PartRange>,
    /// Each of [`PreparedBlock::arrays`] compressed, where files have them so.
    pub(super) compressed: Vec<Vec<u8>>,
}

/// The range of a mesh part in a block's arrays: that of a yarn, or the whole block.
#[derive(Debug)]
pub(super) struct PartRange {
    /// The first yarn of it.
    pub(super) yarn: YarnId,
    pub(super) vertices: Range<usize>,
    pub(super) triangles: Range<usize>,
    /// Bounds, m.
    pub(super) low: Vec3,
    pub(super) high: Vec3,
}

impl PreparedBlock {
    /// Takes the arrays of a block.
    pub(super) fn fill(&mut self, block: &Block, textures: &TextureSet, options: GlbOptions) {
        let tubes = &block.tubes;
        self.uvs.clear();
        let is_textured = textures.texture_of(block.bar).is_some();
        if is_textured {
            let repeats = Vec2::new(1.0, textures.repeats_per_mm(block.bar));
            self.uvs.extend(tubes.uvs.iter().map(|uv| *uv * repeats));
        }
        // Without texture coordinates the vertices along a tube's seam are pairs of equals.
        let is_quantised = options.precision == Precision::Quantised;
        let joins = is_quantised && !is_textured;
        let strands: Vec<_> = block.strands.strands.iter().zip(&tubes.strands).collect();
        let is_one = |a: YarnId, b: YarnId| options.nodes == Nodes::Bar || a == b;
        self.clear();
        // A yarn's strands follow each other, and so do their vertices and triangles.
        for strands in strands.chunk_by(|(a, _), (b, _)| is_one(a.yarn, b.yarn)) {
            let ((strand, (first, first_triangles)), (_, (last, last_triangles))) =
                (strands[0], strands[strands.len() - 1]);
            let triangles = first_triangles.start as usize..last_triangles.end as usize;
            let start = self.positions.len();
            self.add_vertices(block, first.start..last.end, joins);
            let vertices = start..self.positions.len();
            let [low, high] = bounds(&self.positions[vertices.clone()]);
            self.parts.push(PartRange { yarn: strand.yarn, vertices, triangles, low, high });
        }
        if is_quantised {
            self.short_normals.extend(self.normals.drain(..).map(quantised_normal));
        }
        self.fill_triangles(&tubes.triangles);
    }

    /// Puts positions on the grid, if there is one, and compresses the arrays if that is wanted.
    pub(super) fn encode(&mut self, grid: Option<&Grid>, options: GlbOptions) {
        self.places.clear();
        if let Some(grid) = grid {
            self.places.extend(self.positions.iter().map(|position| grid.place(*position)));
        }
        self.compressed = if options.is_compressed {
            self.arrays().iter().map(GlbArray::compressed).collect()
        } else {
            Vec::new()
        };
    }

    /// The arrays in the order in which they lie in the file. The corners of triangles are the last.
    pub(super) fn arrays(&self) -> Vec<GlbArray<'_>> {
        use ComponentType::{F32, I8, U16, U32};
        let mut arrays = vec![
            if self.places.is_empty() {
                GlbArray::of_vertices(Semantic::Positions, &self.positions, Type::Vec3, F32)
            } else {
                GlbArray::of_vertices(Semantic::Positions, &self.places, Type::Vec3, U16)
            },
            if self.normals.is_empty() {
                GlbArray::of_vertices(Semantic::Normals, &self.short_normals, Type::Vec3, I8)
            } else {
                GlbArray::of_vertices(Semantic::Normals, &self.normals, Type::Vec3, F32)
            },
        ];
        if !self.uvs.is_empty() {
            let uvs = Semantic::TexCoords(0);
            arrays.push(GlbArray::of_vertices(uvs, &self.uvs, Type::Vec2, F32));
        }
        arrays.push(if self.triangles.is_empty() {
            GlbArray::of_corners(&self.short_triangles, U16)
        } else {
            GlbArray::of_corners(&self.triangles, U32)
        });
        arrays
    }

    pub(super) fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Lowest and highest corner of all parts, m.
    pub(super) fn bounds(&self) -> [Vec3; 2] {
        let nowhere = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        self.parts
            .iter()
            .fold(nowhere, |[low, high], part| [low.min(part.low), high.max(part.high)])
    }

    /// Forgets everything but keeps the memory.
    fn clear(&mut self) {
        self.positions.clear();
        self.normals.clear();
        self.short_normals.clear();
        self.numbers.clear();
        self.parts.clear();
    }

    /// Takes some vertices, and joins equal ones of a ring if that is wanted.
    fn add_vertices(&mut self, block: &Block, vertices: Range<u32>, joins: bool) {
        let (start, end) = (vertices.start as usize, vertices.end as usize);
        if !joins {
            return self.copy_vertices(block, start..end);
        }
        let Tubes { positions, normals, .. } = &block.tubes;
        let is_same = |a: usize, b: usize| positions[a] == positions[b] && normals[a] == normals[b];
        let (mut first, mut sides) = (start, 0);
        while first < end {
            // The first vertex comes again where its ring ends: after as many as in the last ring.
            let mut others = first + 1..end;
            let again = Some(first + sides)
                .filter(|&again| others.contains(&again) && is_same(first, again))
                .or_else(|| others.find(|&other| is_same(first, other)));
            let number = index32(self.positions.len());
            self.copy_vertices(block, first..again.unwrap_or(end));
            let Some(again) = again else { break };
            self.numbers.push(number);
            (first, sides) = (again + 1, again - first);
        }
    }

    /// Takes some vertices as they are.
    fn copy_vertices(&mut self, block: &Block, vertices: Range<usize>) {
        let number = index32(self.positions.len());
        self.numbers.extend(number..number + index32(vertices.len()));
        let positions = &block.tubes.positions[vertices.clone()];
        self.positions.extend(positions.iter().map(|place| *place * METRES_PER_MM));
        self.normals.extend_from_slice(&block.tubes.normals[vertices]);
    }

    /// Counts the corners of a block's triangles from the first vertex of each part.
    fn fill_triangles(&mut self, triangles: &[[u32; 3]]) {
        self.triangles.clear();
        self.short_triangles.clear();
        // The greatest number of 16 bits ends a strip in some readers, so it is no vertex.
        let is_short = self.parts.iter().all(|part| part.vertices.len() <= usize::from(u16::MAX));
        let numbers = &self.numbers;
        for part in &self.parts {
            let first = index32(part.vertices.start);
            let own = triangles[part.triangles.clone()]
                .iter()
                .map(|corners| corners.map(|corner| numbers[corner as usize] - first));
            if is_short {
                #[expect(clippy::cast_possible_truncation, reason = "no yarn has more vertices")]
                self.short_triangles.extend(own.map(|corners| corners.map(|corner| corner as u16)));
            } else {
                self.triangles.extend(own);
            }
        }
    }
}

/// Lowest and highest corner of some positions.
pub(super) fn bounds(positions: &[Vec3]) -> [Vec3; 2] {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for position in positions {
        low = low.min(*position);
        high = high.max(*position);
    }
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_ends_of_a_ring_are_one_vertex() {
        // Rings of three, three and four vertices, closed, and one that is open.
        let mut block = Block::default();
        let mut expected = Vec::new();
        let (mut next, mut x) = (0, 0.0);
        for (sides, is_closed) in [(3, true), (3, true), (4, true), (2, false)] {
            let first = next;
            for _ in 0..sides {
                (next, x) = (next + 1, x + 1.0);
                block.tubes.positions.push(Vec3::splat(x));
                expected.push(next - 1);
            }
            if is_closed {
                block.tubes.positions.push(Vec3::splat(x - sides as f32 + 1.0));
                expected.push(first);
            }
        }
        block.tubes.normals = vec![Vec3::X; block.tubes.positions.len()];
        let all = 0..index32(block.tubes.positions.len());
        let mut joined = PreparedBlock::default();
        joined.add_vertices(&block, all.clone(), true);
        assert_eq!(joined.numbers, expected);
        assert_eq!((joined.positions.len(), joined.normals.len()), (next as usize, next as usize));
        let mut whole = PreparedBlock::default();
        whole.add_vertices(&block, all.clone(), false);
        assert_eq!(whole.numbers, all.collect::<Vec<_>>());
    }
}
