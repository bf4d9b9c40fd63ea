//! Tube vertices: positions, normals, texture coordinates, triangles.

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::DVec3;
use warpknit::yarn::tube::{Section, Tubes};

use super::cpu::CpuTime;
use super::inputs::{Points, points};

/// St and Sr of the source paper's table and one more.
const SECTIONS: [(u32, u32); 3] = [(10, 5), (10, 13), (25, 5)];

/// All yarns' tubes, each in memory of its own if `held`, or one after the other in the same; gives
/// the number of vertices.
fn tubes(points: &Points, section: &Section, held: bool) -> usize {
    let mut all = Tubes::default();
    let (mut flat, normals) = (Vec::new(), vec![DVec3::Z; points.yarn]);
    let stitches = points.yarn / points.stitch;
    let mut vertices = 0;
    if held {
        all.reserve(
            points.points.len() / points.stitch,
            points.points.len() / points.yarn,
            section,
        );
    }
    for yarn in points.points.chunks(points.yarn) {
        flat.clear();
        flat.extend(yarn.iter().map(|p| DVec3::from(p.map(f64::from))));
        // The last stitch has no next one whose first point it shares.
        let pieces = (0..stitches)
            .map(|s| s * points.stitch..((s + 1) * points.stitch + 1).min(points.yarn));
        if !held {
            all.clear();
        }
        let before = all.positions.len();
        all.add(&flat, &normals, pieces, section);
        vertices += std::hint::black_box(&all).positions.len() - before;
    }
    vertices
}

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    for (name, held) in [("tubes streamed", false), ("tubes held", true)] {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        for (st, sr) in SECTIONS {
            let points = std::cell::LazyCell::new(|| points("26180"));
            let section =
                Section { st, sr, radius: 0.4, flatten: 1.0, caps: false, texture_per_mm: 1.0 };
            let vertices = points.points.len() / points.stitch * st as usize * (sr as usize + 1);
            group.throughput(Throughput::Elements(vertices as u64));
            group.bench_function(BenchmarkId::new("26180", format!("{st}x{sr}")), |bench| {
                bench.iter(|| tubes(&points, &section, held));
            });
        }
        group.finish();
    }
}
