//! An array as a `.glb` holds it.

use gltf_json as json;
use json::accessor::{ComponentType, Type};
use json::mesh::Semantic;

use super::meshopt;

/// Numbers of a block's vertices or triangles.
#[derive(Clone, Debug)]
pub(super) struct GlbArray<'a> {
    /// What the numbers are of a vertex. `None`: the corners of triangles.
    pub(super) semantic: Option<Semantic>,
    pub(super) kind: Type,
    pub(super) component: ComponentType,
    /// Bytes of an element, with those that fill it up.
    pub(super) size: usize,
    pub(super) bytes: &'a [u8],
}

impl<'a> GlbArray<'a> {
    /// An array of vertices.
    pub(super) fn of_vertices<T: bytemuck::NoUninit>(
        semantic: Semantic,
        values: &'a [T],
        kind: Type,
        component: ComponentType,
    ) -> Self {
        let bytes = bytemuck::cast_slice(values);
        Self { semantic: Some(semantic), kind, component, size: size_of::<T>(), bytes }
    }

    /// The corners of triangles.
    pub(super) fn of_corners<T: bytemuck::NoUninit>(
        corners: &'a [[T; 3]],
        component: ComponentType,
    ) -> Self
    where
        [T; 3]: bytemuck::NoUninit,
    {
        let bytes = bytemuck::cast_slice(corners);
        Self { semantic: None, kind: Type::Scalar, component, size: size_of::<T>(), bytes }
    }

    pub(super) fn count(&self) -> usize {
        self.bytes.len() / self.size
    }

    /// The array compressed, which readers undo: triangles where it is of corners, and else vertices.
    pub(super) fn compressed(&self) -> Vec<u8> {
        if self.semantic.is_some() {
            return meshopt::attributes(self.bytes, self.size);
        }
        if self.component == ComponentType::U16 {
            let triangles: &[[u16; 3]] = bytemuck::cast_slice(self.bytes);
            return meshopt::triangles(triangles.iter().map(|corners| corners.map(u32::from)));
        }
        let triangles: &[[u32; 3]] = bytemuck::cast_slice(self.bytes);
        meshopt::triangles(triangles.iter().copied())
    }
}
