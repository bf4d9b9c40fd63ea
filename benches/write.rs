//! What files of tubes cost to write, for each vertex: `cargo bench --bench write`.
//!
//! 26180 stitches of tricot on our own skirt, St 10, Sr 5: the tubes are made beforehand, the files go to a temporary folder. `write` is CPU time
//! on one thread, the system's share of it too; `write, two threads` is time on the clock. `bytes` writes as much as the `.glb` out of
//! memory and nothing else: what no writer can be faster than here.

use std::path::Path;
use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use rayon::{ThreadPool, ThreadPoolBuilder};
use warpknit::drape::{self, Block, Cloth, Options};
use warpknit::export::glb::GlbWriter;
use warpknit::export::obj::ObjWriter;
use warpknit::export::ply::PlyWriter;
use warpknit::export::{Output, Sink};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, Panel, ReadOptions, read};
use warpknit::yarn::tube::Section;

/// The size of the source paper's skirt.
const STITCHES: f64 = 26180.0;
/// Blocks that are handed over at once, as [`drape::run`] does on two threads.
const WINDOW: usize = 8;
/// Bytes that a `.glb` holds for each vertex: its own, and its share of the triangles.
const GLB_BYTES: usize = 52;

fn skirt() -> Garment {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let read = read(&meshes.join("skirt_flat.obj"), Some(&meshes.join("skirt_draped.obj")), &ReadOptions::default());
    read.expect("a shipped garment")
}

fn tricot_for(garment: &Garment) -> Fabric {
    let fabric = Fabric::named("tricot").expect("built in");
    let area: f64 = garment.panels.iter().map(Panel::area).sum();
    let times = (2.0 * area / (fabric.wale_spacing() * fabric.course_spacing()) / STITCHES).sqrt();
    let (wales, courses) = (fabric.wales_per_cm / times, fabric.courses_per_cm / times);
    fabric.at_densities(wales, courses).expect("positive")
}

fn tubes(cloth: &Cloth<'_>, section: Section) -> Vec<Block> {
    let mut held = Vec::new();
    let mut hold = |blocks: &[Block]| -> Result<(), std::convert::Infallible> {
        held.extend_from_slice(blocks);
        Ok(())
    };
    let Ok(_totals) = drape::run(cloth, &Options { surface: Some(section), ..Options::default() }, &mut |_, _| {}, &mut hold);
    held
}

/// Writes all blocks; the file is there until the result is dropped.
fn write_all(mut sink: Box<dyn Sink>, blocks: &[Block]) -> Output {
    blocks.chunks(WINDOW).try_for_each(|window| sink.take(window)).expect("room on the disk");
    sink.finish().expect("room on the disk")
}

/// CPU time of this process; time on the clock where the system doesn't say.
fn cpu_time() -> Duration {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Duration::new(u64::try_from(time.tv_sec).unwrap_or(0), u32::try_from(time.tv_nsec).unwrap_or(0))
    }
    #[cfg(not(unix))]
    {
        static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        START.get_or_init(Instant::now).elapsed()
    }
}

fn clock_time() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}

/// Times `write` on some threads. What it gives back, a file that is to vanish, is dropped off the clock.
fn time<T: Send>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    threads: &ThreadPool,
    now: fn() -> Duration,
    write: impl Fn() -> T + Sync,
) {
    group.bench_function(name, |bench| {
        bench.iter_custom(|runs| {
            (0..runs)
                .map(|_| {
                    threads.install(|| {
                        let start = now();
                        let written = write();
                        let taken = now() - start;
                        drop(written);
                        taken
                    })
                })
                .sum()
        });
    });
}

fn writers(criterion: &mut Criterion) {
    let garment = skirt();
    let fabric = tricot_for(&garment);
    let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
    let section = Section { st: 10, sr: 5, radius: fabric.radius(), flatten: 1.0, caps: false, texture_per_mm: 1.0 };
    let blocks = tubes(&cloth, section);
    let vertices: usize = blocks.iter().map(|block| block.tubes.positions.len()).sum();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let bytes = vec![7; 1 << 20];

    for (name, count, now) in [("write", 1, cpu_time as fn() -> Duration), ("write, two threads", 2, clock_time)] {
        let threads = ThreadPoolBuilder::new().num_threads(count).build().expect("some threads");
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10).throughput(Throughput::Elements(vertices as u64));
        time(&mut group, "bytes", &threads, now, || {
            let mut output = Output::create(&at("bytes")).expect("a new file");
            let pieces = || (0..vertices * GLB_BYTES / bytes.len()).map(|_| &bytes);
            output
                .write_with(|file| pieces().try_for_each(|piece| std::io::Write::write_all(file, piece)))
                .expect("room on the disk");
            output
        });
        time(&mut group, "glb", &threads, now, || {
            write_all(Box::new(GlbWriter::create(&at("skirt.glb"), &fabric, blocks.len()).expect("a new file")), &blocks)
        });
        time(&mut group, "obj", &threads, now, || {
            write_all(Box::new(ObjWriter::create(&at("skirt.obj")).expect("a new file")), &blocks)
        });
        time(&mut group, "ply", &threads, now, || {
            write_all(Box::new(PlyWriter::create(&at("skirt.ply"), &fabric, &section).expect("a new file")), &blocks)
        });
        group.finish();
    }
}

criterion_group!(benches, writers);
criterion_main!(benches);
