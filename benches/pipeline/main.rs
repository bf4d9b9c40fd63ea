//! The cost of each stage in CPU time of one thread: `cargo bench`, or `cargo bench -- locate` for
//! some of them. Each stage is a file; `inputs` makes what they are measured on.

mod clearance;
mod cpu;
mod frames;
mod inputs;
mod knit;
mod locate;
mod rays;
mod read;
mod render;
mod strain;
mod tube;
mod whole;
mod write;

use criterion::{Criterion, criterion_group, criterion_main};

use cpu::CpuTime;

/// Criterion with CPU time and one thread, whatever the machine has: figures of different machines
/// can then be compared.
fn configured() -> Criterion<CpuTime> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("nothing has started threads before");
    Criterion::default().with_measurement(CpuTime)
}

criterion_group! {
    name = benches;
    config = configured();
    targets = read::benches, knit::benches, locate::benches, tube::benches, write::benches,
        whole::benches, frames::benches, strain::benches, clearance::benches, rays::benches,
        render::benches
}
criterion_main!(benches);
