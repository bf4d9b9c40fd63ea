//! Benchmarks of location, and of location with mapping: from a shuffled mesh to the triangle and
//! the draped position of every point; and of the parts of a drape that do the same.
//!
//! `WARPKNIT_DRAPE_INPUTS=FOLDER` also writes the skirt's panels and the points of these drapes for
//! another program, in the files that PEER_INPUTS names.

use std::convert::Infallible;
use std::path::Path;
use std::time::Duration;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput};
use glam::{DVec2, DVec3};
use warpknit::drape::evenness::Evenness;
use warpknit::drape::strands::Edge;
use warpknit::drape::{self, Block, Cloth, DrapeOptions, Stage};
use warpknit::garment::{Garment, Panel};
use warpknit::locate::{Locator, SurfacePoint};
use warpknit::map::{Draped, Mapping, map_into};

use super::cpu::{CpuTime, now};
use super::inputs::{Points, area, panel, points, skirt, tricot_for};

/// Points of a block. A block's data fit the processor's cache, like the blocks of a run.
const BLOCK: usize = 4096;
/// Combinations of meshes and points.
const PAIRS: [(&str, &str); 5] =
    [("20k", "3500"), ("20k", "26180"), ("200k", "26180"), ("20k", "1m"), ("200k", "1m")];

/// Buffers that are reused from block to block.
#[derive(Default)]
struct Memory {
    flat: Vec<DVec3>,
    located: Vec<Option<SurfacePoint>>,
    on_panel: Vec<SurfacePoint>,
    draped: Draped,
}

impl Memory {
    fn locate(&mut self, locator: &Locator<'_>, block: &[[f32; 3]]) {
        self.flat.clear();
        self.flat.extend(block.iter().map(|p| DVec3::from(p.map(f64::from))));
        locator.locate_into(&self.flat, &mut self.located);
    }

    fn map(&mut self, panel: &Panel, mapping: Mapping) {
        self.on_panel.clear();
        self.on_panel.extend(self.located.iter().flatten());
        assert_eq!(self.on_panel.len(), self.flat.len(), "all points lie on the panel");
        map_into(panel, &self.flat, &self.on_panel, mapping, &mut self.draped);
        std::hint::black_box(&self.draped);
    }
}

/// Orders the panel's triangles, builds the locator, and locates all points block by block. `then`
/// is called with each block.
fn locate(
    mut panel: Panel,
    points: &Points,
    memory: &mut Memory,
    then: impl Fn(&mut Memory, &Panel),
) -> Panel {
    panel.order_along_curve();
    let locator = Locator::new(&panel);
    for block in points.points.chunks(BLOCK) {
        memory.locate(&locator, block);
        then(std::hint::black_box(memory), &panel);
    }
    drop(locator);
    panel
}

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    build(criterion);
    for (name, mapping) in [
        ("locate", None),
        ("locate and map smooth", Some(Mapping::Smooth)),
        ("locate and map frame", Some(Mapping::Frame)),
    ] {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        for (mesh, size) in PAIRS {
            let id = BenchmarkId::new(mesh, size);
            // Inputs are made only for the benchmarks that the filter selects.
            let (panel, points) = (
                std::cell::LazyCell::new(|| panel(mesh)),
                std::cell::LazyCell::new(|| points(size)),
            );
            group.bench_function(id, |bench| {
                let mut memory = Memory::default();
                let then = |memory: &mut Memory, panel: &Panel| {
                    if let Some(mapping) = mapping {
                        memory.map(panel, mapping);
                    }
                };
                let routine = |panel| locate(panel, &points, &mut memory, then);
                bench.iter_batched(|| panel.clone(), routine, BatchSize::PerIteration);
            });
        }
        group.finish();
    }
    stages(criterion);
}

/// The map without a table of strains, so that nothing is solved or swept.
const SMOOTH: DrapeOptions = DrapeOptions {
    mapping: Mapping::Smooth,
    edge: Edge::Clip,
    sweeps: None,
    evenness: Evenness::Regular,
    surface: None,
};
/// Stitches of the skirt in the drapes whose stages are timed.
const STITCHES: [(&str, f64); 3] = [("26180", 26_180.0), ("262k", 262e3), ("1m", 1e6)];

/// Benchmarks of the parts of a drape from flat points to located strands, and on to the body, with
/// the search structures. All points count that are located, also those off the panel.
fn stages(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    for (name, timed) in [
        ("drape, locate stage", [Stage::Locate].as_slice()),
        ("drape, locate and map stages", &[Stage::Locate, Stage::Map]),
    ] {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        for (size, stitches) in STITCHES {
            let fabric = tricot_for(area(&garment), stitches);
            let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
            group.bench_function(BenchmarkId::from_parameter(size), |bench| {
                bench.iter_custom(|runs| (0..runs).map(|_| time_of(&cloth, timed)).sum());
            });
            write_inputs(&garment, &cloth, size);
        }
        group.finish();
    }
}

/// CPU time of building the search structures and of some parts of laying a drape's yarns. It runs
/// on a thread of the pool, so that no other thread waits for work at the cost of CPU time.
fn time_of(cloth: &Cloth<'_>, parts: &[Stage]) -> Duration {
    rayon::join(|| time_of_parts(cloth, parts), || ()).0
}

fn time_of_parts(cloth: &Cloth<'_>, parts: &[Stage]) -> Duration {
    let (mut index, mut lay) = (Duration::ZERO, Duration::ZERO);
    let (mut start, mut current) = (now(), Stage::Deliver);
    let mut begin = |stage| {
        let end = now();
        match current {
            Stage::Index => index += end - start,
            Stage::Lay => lay += end - start,
            _ => {}
        }
        (start, current) = (end, stage);
    };
    let deliver = &mut |_: &[Block]| Ok::<_, Infallible>(());
    let Ok(totals) = drape::run(cloth, &SMOOTH, &mut |stage, _| begin(stage), deliver);
    begin(Stage::Deliver);
    let shares = totals.laying.shares().into_iter().filter(|(part, _)| parts.contains(part));
    index + lay.mul_f64(shares.map(|(_, share)| share).sum())
}

/// Writes the panels, side by side, and the flat points of a drape, if a folder is named for them.
fn write_inputs(garment: &Garment, cloth: &Cloth<'_>, size: &str) {
    let Some(folder) = std::env::var_os("WARPKNIT_DRAPE_INPUTS") else { return };
    let (mut vertices, mut faces, mut shifts) = (Vec::new(), Vec::new(), Vec::new());
    let mut right = 0.0;
    for panel in &garment.panels {
        let [low, high] = panel.bounds();
        shifts.push(DVec2::new(right - low.x, 0.0));
        // Points off a panel must not lie on the next one.
        right += high.x - low.x + 1e3;
        let first = u32::try_from(vertices.len()).expect("some thousand vertices");
        vertices
            .extend(panel.uv.iter().map(|p| (p + shifts[shifts.len() - 1]).as_vec2().to_array()));
        faces.extend(panel.triangles.iter().map(|corners| corners.map(|v| first + v)));
    }
    let mut points: Vec<[f32; 3]> = Vec::new();
    let mut take = |blocks: &[Block]| {
        for block in blocks {
            let shift = shifts[block.panel].extend(0.0);
            points.extend(block.knitted.points.iter().map(|p| (p + shift).as_vec3().to_array()));
        }
        Ok::<_, Infallible>(())
    };
    let Ok(_totals) = drape::run(cloth, &SMOOTH, &mut |_, _| (), &mut take);
    let write = |name: String, bytes: Vec<u8>| {
        std::fs::write(Path::new(&folder).join(name), bytes).expect("a folder for inputs");
    };
    let floats = |numbers: &[f32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    write("mesh_skirt_v.bin".to_owned(), floats(vertices.as_flattened()));
    let corners = faces.as_flattened().iter().flat_map(|v| v.to_le_bytes());
    write("mesh_skirt_f.bin".to_owned(), corners.collect());
    write(format!("points_skirt_{size}.bin"), floats(points.as_flattened()));
}

/// Benchmarks of the work before the first point: ordering the triangles, and building the locator.
fn build(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("build");
    for mesh in ["2k", "20k", "200k"] {
        let panel = std::cell::LazyCell::new(|| panel(mesh));
        group.throughput(Throughput::Elements(panel.triangles.len() as u64));
        group.bench_function(mesh, |bench| {
            let routine = |mut panel: Panel| {
                panel.order_along_curve();
                std::hint::black_box(Locator::new(&panel));
                panel
            };
            bench.iter_batched(|| panel.clone(), routine, BatchSize::PerIteration);
        });
    }
    group.finish();
}
