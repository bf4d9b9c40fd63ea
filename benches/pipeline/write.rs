//! Benchmarks of writing tubes to files, and curves to a `.usdc`, for each vertex of the tubes.
//!
//! 26180 stitches of tricot on the shipped skirt. The tubes are made beforehand; the files go to a
//! temporary folder; the system's share of the CPU time counts too. `bytes` hands as many bytes as
//! the `.glb` has from memory to a file, which is a lower bound for every writer.

use std::path::Path;

use criterion::{BatchSize, Criterion, Throughput};
use warpknit::drape::{self, Block, Cloth, DrapeOptions};
use warpknit::export::{ClothInfo, Expected, FileWriter, Format, Output};
use warpknit::yarn::tube::Section;

use super::cpu::CpuTime;
use super::inputs::{area, section, skirt, tricot_for};

/// Blocks that a writer gets at once, as from [`drape::run`] with two threads.
const WINDOW: usize = 2;
/// Bytes of a `.glb` for each vertex of the tubes, its share of the triangles included.
const GLB_BYTES: usize = 20;

/// The tubes of a cloth, in blocks.
fn tubes(cloth: &Cloth<'_>, section: Section) -> Vec<Block> {
    let mut held = Vec::new();
    let mut hold = |blocks: &[Block]| -> Result<(), std::convert::Infallible> {
        held.extend_from_slice(blocks);
        Ok(())
    };
    let Ok(_totals) = drape::run(
        cloth,
        &DrapeOptions { surface: Some(section), sweeps: Some(false), ..DrapeOptions::default() },
        &mut |_, _| {},
        &mut hold,
    );
    held
}

/// Writes all blocks; the file is there until the result is dropped, which is off the clock.
fn write_all(path: &Path, cloth: &ClothInfo<'_>, blocks: &[Block]) -> Vec<Output> {
    let format = Format::from_path(path).expect("a known ending");
    let mut writer = FileWriter::create(path, format, cloth).expect("a new file");
    blocks.chunks(WINDOW).try_for_each(|window| writer.take(window)).expect("room on the disk");
    writer.finish().expect("room on the disk")
}

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let fabric = tricot_for(area(&garment), 26_180.0);
    let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
    let section = section(&fabric);
    let blocks = tubes(&cloth, section);
    let vertices: usize = blocks.iter().map(|block| block.tubes.positions.len()).sum();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let bytes = vec![7; 1 << 20];
    let expected = Some(Expected { blocks: blocks.len(), yarns: cloth.yarns() });
    let info = ClothInfo { expected, ..ClothInfo::from_fabric(&fabric, section) };

    let mut group = criterion.benchmark_group("write");
    group.sample_size(10).throughput(Throughput::Elements(vertices as u64));
    let writers: [(&str, &dyn Fn() -> Vec<Output>); 5] = [
        ("bytes", &|| {
            let mut output = Output::create(&at("bytes")).expect("a new file");
            let pieces = || (0..vertices * GLB_BYTES / bytes.len()).map(|_| &bytes);
            output
                .write_with(|file| {
                    pieces().try_for_each(|piece| std::io::Write::write_all(file, piece))
                })
                .expect("room on the disk");
            vec![output.seal().expect("room on the disk")]
        }),
        ("glb", &|| write_all(&at("skirt.glb"), &info, &blocks)),
        ("obj", &|| write_all(&at("skirt.obj"), &info, &blocks)),
        ("ply", &|| write_all(&at("skirt.ply"), &info, &blocks)),
        ("usdc", &|| write_all(&at("skirt.usdc"), &info, &blocks)),
    ];
    for (name, write) in writers {
        group.bench_function(name, |bench| {
            bench.iter_batched(|| (), |()| write(), BatchSize::PerIteration);
        });
    }
    group.finish();
}
