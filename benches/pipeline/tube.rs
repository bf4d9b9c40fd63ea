//! Benchmarks of tubes: positions, normals, texture coordinates and triangles.

use std::ops::Range;

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::DVec3;
use warpknit::yarn::tube::{Section, Tubes};

use super::cpu::CpuTime;
use super::inputs::{Points, points};

/// St and Sr, from Table 1 of Liu, Kyosev and Jiang 2022.
const SECTIONS: [(u32, u32); 3] = [(10, 5), (10, 13), (25, 5)];

/// Makes the tubes of all yarns and returns the number of vertices. With `held` all tubes stay in
/// memory; otherwise each yarn reuses the memory of the one before it.
fn tubes(points: &Points, section: &Section, held: bool) -> usize {
    let mut all = Tubes::default();
    let longest = points.yarns.iter().map(Range::len).max().unwrap_or(0);
    let (mut flat, normals) = (Vec::with_capacity(longest), vec![DVec3::Z; longest]);
    let mut vertices = 0;
    if held {
        all.reserve(points.points.len() / points.stitch, points.yarns.len(), section);
    }
    for yarn in &points.yarns {
        flat.clear();
        flat.extend(points.points[yarn.clone()].iter().map(|p| DVec3::from(p.map(f64::from))));
        // Each stitch shares the first point of the next one, except the last.
        let starts = (0..yarn.len() - 1).step_by(points.stitch);
        let pieces = starts.map(|start| start..(start + points.stitch + 1).min(yarn.len()));
        if !held {
            all.clear();
        }
        let before = all.positions.len();
        all.add(&flat, &normals[..flat.len()], pieces, section);
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
