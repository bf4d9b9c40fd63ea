//! How a `.glb` holds its meshes: as the user chose.

/// How a `.glb` holds its meshes. The default is 16 bits and a node a bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GlbOptions {
    /// How its numbers are stored.
    pub precision: Precision,
    /// What has a node of its own.
    pub nodes: Nodes,
    /// Whether arrays are compressed, by `EXT_meshopt_compression`.
    pub is_compressed: bool,
}

/// How the numbers of a mesh are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 16 bits a coordinate and 8 a normal's, by `KHR_mesh_quantization`. Where 16 bits would be too
    /// coarse for the yarn, coordinates are floats.
    #[default]
    Quantised,
    /// Floats of 32 bits, for readers without the extension.
    F32,
}

/// What has a node of its own in a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Nodes {
    /// Each bar of each panel.
    #[default]
    Bar,
    /// Each yarn, below the node of its bar.
    Yarn,
}
