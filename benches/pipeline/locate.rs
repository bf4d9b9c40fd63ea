//! Benchmarks of location, and of location with mapping: from a shuffled mesh to the triangle and
//! the draped position of every point.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput};
use glam::DVec3;
use warpknit::garment::Panel;
use warpknit::locate::{Locator, SurfacePoint};
use warpknit::map::{Draped, Mapping, map_into};

use super::cpu::CpuTime;
use super::inputs::{Points, panel, points};

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
