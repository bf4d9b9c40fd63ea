//! The nodes of a `.glb`: one for each bar of each panel, with a mesh or with a node for each of its
//! yarns below it.
//!
//! In: blocks in order, and their mesh parts. Out: nodes and meshes in the file's JSON.

use glam::Vec3;
use gltf_json as json;
use json::{Index, Root};

use super::ClothInfo;
use super::glb_block::{METRES_PER_MM, bounds};
use super::glb_grid::Grid;
use super::glb_options::{GlbOptions, Nodes, Precision};
use warpknit_core::drape::Block;
use warpknit_core::ids::YarnId;

/// The nodes so far, and what new ones need.
#[derive(Debug)]
pub(super) struct NodeTree {
    options: GlbOptions,
    /// Nodes of panels' bars.
    bars: Vec<Index<json::Node>>,
    /// The grid of the last block that was given one.
    grid: Option<BarGrid>,
    /// The node of the last block's bar.
    current: Option<BarNode>,
    /// Where coordinates count from, m.
    origin: Vec3,
    /// Lowest and highest corner of each draped panel, m.
    panels: Vec<[Vec3; 2]>,
    /// Radius of the thinnest yarn, m.
    radius: f32,
}

/// A panel's bar and its grid. Blocks that agree in these and follow each other share a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BarGrid {
    panel: usize,
    bar: usize,
    /// `None` where coordinates are floats.
    pub(super) grid: Option<Grid>,
}

/// The node of a panel's bar.
#[derive(Clone, Copy, Debug)]
struct BarNode {
    bar_grid: BarGrid,
    node: Index<json::Node>,
}

impl NodeTree {
    pub(super) fn new(cloth: &ClothInfo<'_>) -> Self {
        let panels = cloth.panels.iter().map(|panel| {
            let draped: Vec<_> =
                panel.draped.iter().map(|place| (*place / 1000.0).as_vec3()).collect();
            bounds(&draped)
        });
        let radii = cloth.strands.iter().map(|style| style.radius_f32() * METRES_PER_MM);
        Self {
            options: cloth.glb,
            bars: Vec::new(),
            grid: None,
            current: None,
            origin: Vec3::ZERO,
            panels: panels.collect(),
            radius: radii.fold(f32::INFINITY, f32::min),
        }
    }

    /// The grid of a block, whose bounds are `own`: a new one where its panel or its bar is new, or
    /// where the last grid doesn't hold them. Blocks are given theirs in order.
    pub(super) fn grid_of(&mut self, block: &Block, own: [Vec3; 2]) -> BarGrid {
        let (panel, bar) = (block.panel, block.bar);
        let is_own = |bar_grid: &BarGrid| {
            (bar_grid.panel, bar_grid.bar) == (panel, bar)
                && bar_grid.grid.as_ref().is_none_or(|grid| grid.holds(own))
        };
        if let Some(bar_grid) = self.grid.filter(is_own) {
            return bar_grid;
        }
        let grid = match self.options.precision {
            Precision::Quantised => Grid::around(self.panels.get(panel), own, self.radius),
            Precision::F32 => None,
        };
        let bar_grid = BarGrid { panel, bar, grid };
        self.grid = Some(bar_grid);
        bar_grid
    }

    /// The node of a block's panel and bar, with that grid.
    pub(super) fn bar_of(
        &mut self,
        root: &mut Root,
        block: &Block,
        bar_grid: BarGrid,
    ) -> Index<json::Node> {
        if let Some(current) = self.current.filter(|current| current.bar_grid == bar_grid) {
            return current.node;
        }
        let BarGrid { panel, bar, grid } = bar_grid;
        let name = Some(format!("panel {panel} bar {}", bar + 1));
        self.origin = (block.origin / 1000.0).as_vec3();
        let node = root.push(json::Node {
            name,
            translation: grid.map(|grid| grid.low.to_array()),
            scale: grid.map(|grid| [grid.step; 3]),
            ..json::Node::default()
        });
        self.bars.push(node);
        self.current = Some(BarNode { bar_grid, node });
        node
    }

    /// Adds a mesh part: to the mesh of its bar's node, or as that of a yarn's node below it.
    pub(super) fn add(
        &self,
        root: &mut Root,
        bar: Index<json::Node>,
        yarn: YarnId,
        part: json::mesh::Primitive,
    ) {
        match self.options.nodes {
            Nodes::Bar => add_to_bar(root, bar, part),
            Nodes::Yarn => add_yarn(root, bar, yarn, part),
        }
    }

    /// The nodes of the scene: those of the bars, or one above them that carries all to a garment far from
    /// the origin. Its place is exact, and a sum with that of a bar would be rounded.
    pub(super) fn top(&mut self, root: &mut Root) -> Vec<Index<json::Node>> {
        let bars = std::mem::take(&mut self.bars);
        if self.origin == Vec3::ZERO {
            return bars;
        }
        vec![root.push(json::Node {
            name: Some("garment".to_owned()),
            translation: Some(self.origin.to_array()),
            children: Some(bars),
            ..json::Node::default()
        })]
    }
}

/// Adds a part to the mesh of a bar's node.
fn add_to_bar(root: &mut Root, bar: Index<json::Node>, part: json::mesh::Primitive) {
    let name = root.nodes[bar.value()].name.clone();
    let mesh = match root.nodes[bar.value()].mesh {
        Some(mesh) => mesh,
        None => root.push(mesh_of(name)),
    };
    root.nodes[bar.value()].mesh = Some(mesh);
    root.meshes[mesh.value()].primitives.push(part);
}

/// Adds a yarn's mesh, and its node below that of its bar.
fn add_yarn(root: &mut Root, bar: Index<json::Node>, yarn: YarnId, part: json::mesh::Primitive) {
    let name = Some(format!("yarn {}", yarn.0));
    let mut mesh = mesh_of(name.clone());
    mesh.primitives.push(part);
    let mesh = root.push(mesh);
    let node = root.push(json::Node { name, mesh: Some(mesh), ..json::Node::default() });
    root.nodes[bar.value()].children.get_or_insert_default().push(node);
}

/// A mesh without parts.
fn mesh_of(name: Option<String>) -> json::Mesh {
    json::Mesh {
        name,
        primitives: Vec::new(),
        weights: None,
        extensions: None,
        extras: json::Extras::default(),
    }
}
