//! Inputs of the benchmarks: a panel draped on a folded cone, the same as in `warpknit bench`, and
//! the data points of loops that cover it.
//!
//! Where the variable PEER_INPUTS names a folder with `mesh_*_v.bin`, `mesh_*_f.bin` and
//! `points_*.bin`, these files are read, so that other programs work on the same inputs
//! (`benches/against_peers.sh`). Otherwise a panel is made, and a tricot is knitted on it.

use std::ops::Range;
use std::path::Path;

use glam::{DVec2, DVec3};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, Panel, ReadOptions, read};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern};
use warpknit::yarn::tube::Section;

#[path = "../../src/cli/bench/panel.rs"]
mod cone;
use cone::{SIZE, draped, shuffled_cone};

/// Names of meshes, with their number of triangles.
pub(crate) const MESHES: [(&str, usize); 3] = [("2k", 2000), ("20k", 20_000), ("200k", 200_000)];
/// Names of sets of points, with about their number of stitches.
pub(crate) const POINTS: [(&str, f64); 4] =
    [("3500", 3500.0), ("26180", 26_180.0), ("262k", 262e3), ("1m", 1e6)];

/// Data points in single precision, as the peers' files hold them, yarn after yarn.
pub(crate) struct Points {
    pub(crate) points: Vec<[f32; 3]>,
    /// The points of each yarn.
    pub(crate) yarns: Vec<Range<usize>>,
    /// Number of points of a stitch.
    pub(crate) stitch: usize,
}

/// The bytes of a file in the folder PEER_INPUTS, if that is set.
fn peer_file(name: &str) -> Option<Vec<u8>> {
    let folder = std::env::var_os("PEER_INPUTS").filter(|folder| !folder.is_empty())?;
    let path = Path::new(&folder).join(name);
    Some(std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

/// Bytes as records of N numbers of four bytes.
fn numbers<const N: usize>(bytes: &[u8]) -> Vec<[[u8; 4]; N]> {
    bytes.as_chunks::<4>().0.as_chunks::<N>().0.to_vec()
}

/// One of [`MESHES`], with its triangles in random order, as in a file.
pub(crate) fn panel(name: &str) -> Panel {
    let files =
        peer_file(&format!("mesh_{name}_v.bin")).zip(peer_file(&format!("mesh_{name}_f.bin")));
    match files {
        Some((vertices, faces)) => draped(
            numbers(&vertices)
                .into_iter()
                .map(|p: [_; 2]| DVec2::from(p.map(|x| f64::from(f32::from_le_bytes(x)))))
                .collect(),
            numbers(&faces).into_iter().map(|face| face.map(u32::from_le_bytes)).collect(),
        ),
        None => shuffled_cone(
            MESHES.iter().find(|(known, _)| *known == name).expect("one of the meshes").1,
        ),
    }
}

/// One of [`POINTS`].
pub(crate) fn points(name: &str) -> Points {
    if let Some((points, size)) =
        peer_file(&format!("points_{name}.bin")).zip(peer_file(&format!("points_{name}.txt")))
    {
        let points: Vec<_> =
            numbers(&points).into_iter().map(|p| p.map(f32::from_le_bytes)).collect();
        let size = String::from_utf8(size).expect("text");
        let wales: usize = size
            .split_whitespace()
            .next()
            .and_then(|wales| wales.parse().ok())
            .expect("wales and courses");
        let yarns = ranges((0..=points.len()).step_by(8 * wales));
        return Points { points, yarns, stitch: 8 };
    }
    let stitches = POINTS.iter().find(|(known, _)| *known == name).expect("one of the sizes").1;
    knitted(&tricot_for(SIZE.x * SIZE.y, stitches))
}

/// The yarns of a fabric that lie completely within the panel.
fn knitted(fabric: &Fabric) -> Points {
    let (pattern, mesh) = (
        Pattern::new(fabric),
        StructureMesh::anchored_at(fabric, DVec2::splat(2.0) * fabric.wale_spacing()),
    );
    let room = SIZE - 4.0 * fabric.wale_spacing();
    let mut knitted = Knitted::default();
    let mut ends = vec![0];
    for bar in 0..fabric.yarn_systems() {
        for guide in pattern.yarns_over(bar, 0.0..room.x) {
            pattern.lay(bar, guide, pattern.steps_along(bar, 0.0..room.y), &mesh, &mut knitted);
            ends.push(knitted.points.len());
        }
    }
    let low = DVec3::new(1.0, 1.0, -1e3);
    let high = (SIZE - 1.0).extend(1e3);
    let points: Vec<_> =
        knitted.points.iter().map(|p| p.clamp(low, high).as_vec3().to_array()).collect();
    // A stitch of tricot has the eight points of its loop and two of its underlap.
    Points { points, yarns: ranges(ends.into_iter()), stitch: 10 }
}

/// The ranges between places and the next ones.
fn ranges(places: impl Iterator<Item = usize> + Clone) -> Vec<Range<usize>> {
    places.clone().zip(places.skip(1)).map(|(start, end)| start..end).collect()
}

/// The shipped skirt.
pub(crate) fn skirt() -> Garment {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let read = read(
        &meshes.join("skirt_flat.obj"),
        Some(&meshes.join("skirt_draped.obj")),
        &ReadOptions::default(),
    );
    read.expect("a shipped garment")
}

/// The area of a garment that takes stitches, mm².
pub(crate) fn area(garment: &Garment) -> f64 {
    garment.panels.iter().map(Panel::area).sum()
}

/// Tricot at densities that give about so many stitches on an area in mm².
pub(crate) fn tricot_for(area: f64, stitches: f64) -> Fabric {
    fabric_for("tricot", area, stitches)
}

/// The same of a built-in fabric, all of whose bars are full.
pub(crate) fn fabric_for(name: &str, area: f64, stitches: f64) -> Fabric {
    let fabric = Fabric::named(name).expect("built in");
    let bars = f64::from(u32::try_from(fabric.yarn_systems()).expect("a few"));
    let times = (bars * area / (fabric.wale_spacing() * fabric.course_spacing()) / stitches).sqrt();
    let (wales, courses) = (fabric.wales_per_cm / times, fabric.courses_per_cm / times);
    fabric.at_densities(wales, courses).expect("positive")
}

/// Tubes with St 10 and Sr 5, the smallest in Table 1 of Liu, Kyosev and Jiang 2022.
pub(crate) fn section(fabric: &Fabric) -> Section {
    Section {
        st: 10,
        sr: 5,
        radius: fabric.radius(),
        flatten: 1.0,
        caps: false,
        texture_per_mm: 1.0,
    }
}
