//! Laid cloth: paths of yarns as a fabric file gives them, at any density, on a panel; and yarns as
//! their fibres.

use std::path::Path;

use glam::DVec3;
use warpknit::drape::{self, Block, Cloth, DrapeOptions, fibres};
use warpknit::export::StrandStyle;
use warpknit::fabric::Fabric;
use warpknit::knit::{Pattern, numbers};
use warpknit::render;
use warpknit::render::cloth;
use warpknit::render::{Camera, View};

/// A weave of straight warps under straight wefts, 1.25 x 1 mm a cell.
pub(crate) const GRID: &str = r##"name = "grid"
kind = "laid"
wales_per_cm = 8
courses_per_cm = 10
[[strands]]
runs = "along"
path = [[0.5, 0.0, -0.2], [0.5, 0.5, -0.2]]
yarn = { count = "20 tex", density = 1.5, packing = 0.6, color = "#c8b090", twist = 500 }
[[strands]]
runs = "across"
path = [[0.0, 0.25, 0.2], [0.5, 0.25, 0.2]]
yarn = { count = "20 tex", density = 1.5, packing = 0.6, color = "#907050", twist = -500 }
"##;

fn blocks(fabric: &Fabric, wales: u32, courses: u32) -> Vec<Block> {
    let panel = drape::swatch_panel(fabric, wales, courses);
    let mut all = Vec::new();
    let mut keep = |blocks: &[Block]| -> Result<(), std::convert::Infallible> {
        all.extend(blocks.to_vec());
        Ok(())
    };
    let Ok(_) = drape::run(
        &Cloth::swatch(&panel, fabric, wales, courses),
        &DrapeOptions::default(),
        &mut |_, _| {},
        &mut keep,
    );
    all
}

#[test]
fn straight_strands_are_as_long_and_as_heavy_as_the_cloth() {
    let fabric = Fabric::parse(GRID).unwrap();
    let numbers = numbers::measure(&fabric, &Pattern::new(&fabric));
    // A warp every 1.25 mm and a weft every mm: 800 and 1000 m in a m².
    assert!((numbers.yarn_length - 1800.0).abs() < 1e-6, "{numbers:?}");
    assert!((numbers.mass - 1.8 * 20.0).abs() < 1e-6 && numbers.run_in == [None, None]);
    let diameter = fabric.yarn(0).diameter();
    assert!((numbers.thickness - 0.4 - diameter).abs() < 1e-9);
}

#[test]
fn strands_lie_where_their_paths_say_at_any_density() {
    let fabric = Fabric::parse(GRID).unwrap();
    for times in [1.0, 4.0] {
        let fabric = fabric.clone().at_densities(8.0 / times, 10.0 / times).unwrap();
        assert!((fabric.radius() / fabric.true_radius() - times).abs() < 1e-12);
        let blocks = blocks(&fabric, 5, 4);
        let strands: usize = blocks.iter().map(|block| block.strands.strands.len()).sum();
        assert_eq!(strands, 5 + 4);
        for block in &blocks {
            let depth = if block.bar == 0 { -0.2 } else { 0.2 };
            assert!(
                block.draped.positions.iter().all(|point| (point.z - depth * times).abs() < 1e-6),
                "{times}"
            );
            for strand in &block.strands.strands {
                let points = &block.draped.positions[strand.range()];
                let beside = |point: &DVec3| if block.bar == 0 { point.x } else { point.y };
                assert!(
                    points.iter().all(|point| (beside(point) - beside(&points[0])).abs() < 1e-9)
                );
            }
        }
    }
}

#[test]
fn fibres_take_their_yarns_place() {
    let fabric = Fabric::parse(GRID).unwrap();
    let bundles = fibres::bundles(&fabric, fabric.radius(), 0.01);
    assert!(bundles[0].slope > 0.0 && bundles[1].slope < 0.0, "S and Z");
    for style in StrandStyle::from_bundles(&fabric, &bundles) {
        assert!((style.radius / 0.01 - 1.0).abs() < 0.01, "{}", style.radius);
    }
    for block in blocks(&fabric, 3, 3) {
        let bundle = &bundles[block.bar];
        let spun = fibres::block(&block, bundle, None);
        assert_eq!(spun.strands.strands.len(), block.strands.strands.len() * bundle.count as usize);
        assert_eq!(spun.strands.sources.len(), spun.draped.positions.len());
        for (yarn, fibres) in
            block.strands.strands.iter().zip(spun.strands.strands.chunks(bundle.count as usize))
        {
            let points = &block.draped.positions[yarn.range()];
            let off = |point: DVec3| {
                let off = point - points[0];
                let along = (points[points.len() - 1] - points[0]).normalize();
                (off - along * off.dot(along)).length()
            };
            for fibre in fibres {
                assert_eq!(fibre.yarn, yarn.yarn);
                assert!(
                    spun.draped.positions[fibre.range()]
                        .iter()
                        .all(|&point| off(point) < bundle.radius + 1e-6)
                );
            }
        }
    }
}

#[test]
fn fibres_are_drawn_where_the_camera_is_near_and_nowhere_else() {
    let fabric = Fabric::parse(GRID).unwrap();
    let mut scene = cloth::swatch(&fabric, 12, 12);
    let bundles = fibres::bundles(&fabric, fabric.radius(), 0.0045);
    // A sewing thread has no bundle, and stays whole.
    let thread = scene.positions[..8].to_vec();
    scene.looks.push(scene.looks[0]);
    let look = u16::try_from(scene.looks.len() - 1).unwrap();
    scene.push_strand(thread.iter().copied(), look);
    let size = [300, 300];
    let camera =
        |zoom: f64| Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, zoom, 1.0);
    assert!(
        render::fibres::scene(
            &scene,
            &bundles,
            render::fibres::MIN_YARN_PIXELS,
            &camera(1.0),
            size
        )
        .is_none()
    );
    let near = render::fibres::scene(
        &scene,
        &bundles,
        render::fibres::MIN_YARN_PIXELS,
        &camera(14.0),
        size,
    )
    .unwrap();
    let (yarns, fibres): (Vec<_>, Vec<_>) =
        near.strands.iter().partition(|strand| usize::from(strand.look) < scene.looks.len());
    assert!(
        !yarns.is_empty() && fibres.len() > 20 * scene.strands.len(),
        "{} {}",
        yarns.len(),
        fibres.len()
    );
    // All of it is there, and no fibre is thinner than half a pixel.
    let length = |strands: &[&warpknit::render::scene::SceneStrand]| -> f32 {
        let of = |strand: &&warpknit::render::scene::SceneStrand| -> f32 {
            let points = &near.positions[strand.points.start as usize..strand.points.end as usize];
            points.windows(2).map(|ends| ends[0].distance(ends[1])).sum()
        };
        strands.iter().map(of).sum()
    };
    assert!(length(&fibres) > length(&yarns));
    let threads: Vec<_> = yarns.iter().filter(|strand| strand.look == look).collect();
    assert_eq!(threads.len(), 1);
    let points = threads[0].points.clone();
    assert_eq!(near.positions[points.start as usize..points.end as usize], thread);
    let pixel = camera(14.0).pixel_size(camera(14.0).eye().z, size[1]);
    assert!(
        near.looks[scene.looks.len()..]
            .iter()
            .all(|look| f64::from(2.0 * look.radius) > 0.8 * pixel)
    );
}

fn run(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command.current_dir(folder).args(arguments).output().unwrap()
}

#[test]
fn the_commands_take_laid_cloth_and_fibres() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("grid.toml"), GRID).unwrap();
    let shown = run(folder, &["inspect", "--fabric", "grid.toml", "-o", "grid.svg"]);
    let text = String::from_utf8_lossy(&shown.stdout);
    assert!(
        shown.status.success()
            && text.contains("strand 2: across")
            && !text.contains("threads on a needle"),
        "{text}"
    );
    assert!(std::fs::read_to_string(folder.join("grid.svg")).unwrap().contains("strand-1-under"));

    let swatch = ["swatch", "--fabric", "grid.toml", "--wales", "2", "--courses", "2"];
    let fibres = ["--fibres", "on", "--fibre-radius", "0.02"];
    let outputs = [
        "-o",
        "f.usda",
        "-o",
        "f.bcc",
        "-o",
        "f.curves.txt",
        "-o",
        "f.glb",
        "-o",
        "f.png",
        "--size",
        "120x120",
    ];
    let output = run(folder, &[&swatch[..], &fibres, &outputs].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let curves = std::fs::read_to_string(folder.join("f.curves.txt")).unwrap();
    let bundle = &fibres::bundles(
        &Fabric::parse(GRID).unwrap(),
        Fabric::parse(GRID).unwrap().radius(),
        0.02,
    )[0];
    let strands = curves.split("\n\n").filter(|strand| !strand.trim().is_empty()).count();
    assert_eq!(strands, 4 * bundle.count as usize);
    // The same seed, the same bytes.
    std::fs::rename(folder.join("f.usda"), folder.join("first.usda")).unwrap();
    assert!(
        run(folder, &[&swatch[..], &fibres, &["-o", "f.usda", "--threads", "1"]].concat())
            .status
            .success()
    );
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(read("first.usda") == read("f.usda"));

    let refused = run(folder, &[&swatch[..], &fibres, &["-o", "f.csv"]].concat());
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(
        !refused.status.success()
            && message.contains("f.csv: data points are of yarns")
            && message.lines().count() == 1,
        "{message}"
    );
    assert!(!folder.join("f.csv").exists());
}
