//! Table 2 of Liu, Kyosev and Jiang 2022: the time for all data points on the flat ("plane")
//! fabric, and on the draped ("curved") one.
//!
//! In: the shipped garments, or the user's own. Out: a table and a plot. The paper names a mesh
//! fabric, a tricot fabric, a tube and a skirt; the last two are taken to be of tricot.

use anyhow::Result;
use warpknit::drape::{Cloth, Stage};
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;
use warpknit::ids::index32;
use warpknit::knit::Pattern;

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::brute;
use super::garments::{Garments, Shipped, fitted};
use super::measure::{FLAT_YARN, Moment, Sample, Times, measured_parts, time_stages};
use super::plot::{Plot, Series};
use super::table::{BESIDE, Column, TIMES, Table, TableCell, beside, times};

/// A line of the paper's table; times in ms.
struct PublishedLine {
    cloth: &'static str,
    fabric: &'static str,
    garment: Shipped,
    stitches: u32,
    plane: f64,
    curved: f64,
}

const LINES: [PublishedLine; 4] = [
    PublishedLine {
        cloth: "mesh",
        fabric: "hex-net-3",
        garment: Shipped::Pinch,
        stitches: 576,
        plane: 41.46,
        curved: 58.35,
    },
    PublishedLine {
        cloth: "tricot",
        fabric: DEFAULT_FABRIC,
        garment: Shipped::Pinch,
        stitches: 3500,
        plane: 201.45,
        curved: 209.46,
    },
    PublishedLine {
        cloth: "tube",
        fabric: DEFAULT_FABRIC,
        garment: Shipped::Tube,
        stitches: 8480,
        plane: 496.52,
        curved: 521.08,
    },
    PublishedLine {
        cloth: "skirt",
        fabric: DEFAULT_FABRIC,
        garment: Shipped::Skirt,
        stitches: 26_180,
        plane: 1208.39,
        curved: 1375.15,
    },
];

/// The parts of the work that are measured separately.
struct Parts {
    /// Relaxation of one repeat.
    relaxed: Times,
    /// All data points on the flat fabric.
    plane: Times,
    /// Location and mapping onto the garment.
    mapped: Times,
    /// `plane` and `mapped`, run by run.
    curved: Times,
    /// `plane` with relaxation and the plan of all yarns.
    whole_plane: Times,
    /// `curved` with them.
    whole_curved: Times,
}

/// The column with the ratio of a part's time to that of `plane`.
const OVER_PLANE: Column = ("over_plane", "over\nplane");
/// The columns that `--brute` adds at the right.
const BRUTE: [Column; 2] = [("brute_ms", "all triangles\nin turn, ms"), ("brute_times", "times")];

/// Measures the table, on the user's garment if there is one.
pub(super) fn plane_curved(
    arguments: &Bench,
    garments: &Garments,
    progress: &mut dyn FnMut(f64),
) -> Result<Table> {
    let mut table = Table::new(
        "plane-curved",
        "Table 2: coordinates on the plane fabric and on the curved one",
        &[
            "relax: one repeat in balance. plane: all data points on the flat fabric. curved: plane, \
             location and mapping (smooth; --only mapping compares all). plane and curved are the \
             plane_ms and curved_ms of a report.",
            "relax + plane, relax + curved: the same with the relaxation and with laying out the \
             yarns; these stand beside what was published. Ratios are of CPU time.",
            "published: Liu, Kyosev, Jiang 2022, Table 2, C# on an i7-9750H. The paper's meshes \
             are not public; these are our own.",
        ],
        [("cloth", "cloth"), ("fabric", "fabric"), ("stitches", "stitches"), ("part", "part")],
    );
    table.add_columns(TIMES.into_iter().chain([OVER_PLANE]).chain(BESIDE));
    if arguments.brute {
        table.add_columns(BRUTE);
        table.notes.push(
            "all triangles in turn: the paper's own location run here, with as many threads, once \
             and not several times."
                .to_owned(),
        );
    }
    let series = [
        Series::ours("plane, here"),
        Series::ours("curved, here"),
        Series::ours("all triangles, here"),
        Series::published("plane, published"),
        Series::published("curved, published"),
    ];
    let mut plot = Plot::new("Table 2: plane and curved", "stitches", "time, ms", series);
    for (at, line) in LINES.iter().enumerate() {
        progress(at as f64 / LINES.len() as f64);
        let (own, garment) = garments.get(line.garment)?;
        let (cloth, fabric) = if garments.are_own() {
            (own.as_str(), DEFAULT_FABRIC)
        } else {
            (line.cloth, line.fabric)
        };
        // Published times hold for the paper's garments only.
        let published = (!garments.are_own()).then_some((line.plane, line.curved));
        let (fabric, stitches) =
            fitted(&Fabric::named(fabric)?, &garment, f64::from(line.stitches))?;
        let parts = measure(arguments.runs, &garment, &fabric)?;
        let brute = if arguments.brute {
            Some(brute::located_and_mapped(&Cloth::cover(&garment, &fabric)?))
        } else {
            None
        };
        push(&mut table, [cloth, &fabric.name], stitches, &parts, published, brute);
        plot.push_known(
            f64::from(index32(stitches)),
            [
                Some(parts.whole_plane.wall.median),
                Some(parts.whole_curved.wall.median),
                brute.map(|brute| parts.whole_plane.wall.median + brute.wall),
                published.map(|(plane, _)| plane),
                published.map(|(_, curved)| curved),
            ],
        );
    }
    table.plots.push(plot);
    Ok(table)
}

/// Measures the parts on a garment.
fn measure(runs: u32, garment: &Garment, fabric: &Fabric) -> Result<Parts> {
    let [relaxed, plane, mapped, curved, whole_plane, whole_curved] =
        measured_parts(runs, &mut || {
            let start = Moment::now();
            std::hint::black_box(Pattern::new(fabric));
            let relaxed = start.elapsed();
            // Covering relaxes the repeat again.
            let start = Moment::now();
            let cloth = Cloth::cover(garment, fabric)?;
            let covered = start.elapsed();
            let (staged, _) = time_stages(&cloth, &FLAT_YARN);
            let plane = staged.of_stage(Stage::Knit);
            let mapped = [Stage::Index, Stage::Locate, Stage::Map]
                .into_iter()
                .map(|stage| staged.of_stage(stage));
            let mapped = mapped.fold(Sample::default(), |sum, stage| sum + stage);
            let curved = plane + mapped;
            Ok([relaxed, plane, mapped, curved, covered + plane, covered + curved])
        })?;
    Ok(Parts { relaxed, plane, mapped, curved, whole_plane, whole_curved })
}

/// Adds a row for each part.
fn push(
    table: &mut Table,
    names: [&str; 2],
    stitches: usize,
    parts: &Parts,
    published: Option<(f64, f64)>,
    brute: Option<Sample>,
) {
    // The linear search replaces location and mapping only; the flat fabric takes the same time.
    let with = |plane: &Times| {
        brute.map(|brute| (plane.wall.median + brute.wall, plane.for_ratio() + brute.for_ratio()))
    };
    let alone = brute.map(|brute| (brute.wall, brute.for_ratio()));
    let Parts { relaxed, plane, mapped, curved, whole_plane, whole_curved } = parts;
    let rows = [
        ("relax", relaxed, None, None),
        ("plane", plane, None, None),
        ("location and mapping", mapped, None, alone),
        ("curved", curved, None, with(plane)),
        ("relax + plane", whole_plane, published.map(|(plane, _)| plane), None),
        ("relax + curved", whole_curved, published.map(|(_, curved)| curved), with(whole_plane)),
    ];
    for (part, taken, published, by_brute) in rows {
        let labels = [
            TableCell::text(names[0]),
            TableCell::text(names[1]),
            TableCell::Count(stitches),
            TableCell::text(part),
        ];
        let over_plane = TableCell::Number(taken.for_ratio() / plane.for_ratio(), 2);
        let row = labels
            .into_iter()
            .chain(times(taken))
            .chain([over_plane])
            .chain(beside(published, taken.for_ratio()));
        let last = [
            TableCell::known(by_brute.map(|(wall, _)| wall), 2),
            TableCell::times(by_brute.map(|(_, ms)| ms / taken.for_ratio())),
        ];
        table.push(row.chain(last.into_iter().filter(|_| brute.is_some())));
    }
}
