//! The text of `docs/gallery.md`: a section for each built-in fabric, and our numbers beside those
//! of mills.
//!
//! In: the library's fabrics. Out: Markdown. A test compares it with the file.

use std::fmt::Write as _;

use warpknit::fabric::{Fabric, Structure, builtin};
use warpknit::knit::numbers::{self, Numbers};
use warpknit::knit::{Pattern, clearance};

const HEAD: &str = "# Gallery

The built-in fabrics. Each has a picture of its technical face, one of its technical back, and one
of a T-shirt of it, whose stitches are as small as they are in cloth. The numbers are for the
densities and yarns of its TOML file. One command makes this page and its pictures:

    cargo run --release --example gallery

- **Run-in** is the yarn of a rack of 480 courses.
- **Thickness** is the distance from the lowest to the highest yarn surface.
- **Cover factor** is the share of the area that yarns hide.
- **Porosity** is the share of the volume that no fibre fills.
- **Clearance** is the least distance between yarns. 1 is touch.

The formulas are in [method.md](method.md#numbers-of-cloth).
";

/// The fabric that is shown as tubes and as ribbons.
pub(crate) const COMPARED: &str = "jersey";
/// The texture in `meshes/yarns/` that both use.
pub(crate) const TEXTURE: &str = "spun";

/// What stands in the place of a side in the name of a garment's picture.
pub(crate) const WORN: &str = "worn";

/// The file of one side's picture.
pub(crate) fn picture_name(fabric: &str, side: &str) -> String {
    format!("{fabric}_{side}.png")
}

/// The whole page.
pub(crate) fn text() -> String {
    let mut page = HEAD.to_owned();
    for name in builtin::names() {
        section(&mut page, &Fabric::named(name).expect("built-in fabrics are there"));
    }
    shapes(&mut page);
    sources(&mut page);
    page
}

/// The section that compares tubes and ribbons.
fn shapes(page: &mut String) {
    line(
        page,
        format_args!(
            "\n## Tubes and ribbons\n\n\
             A {COMPARED} with the yarn of `meshes/yarns/{TEXTURE}`. As tubes, its yarns are round \
             and the picture goes around them.\n\
             As ribbons (`--shape ribbon`), they are flat and their fuzz stands off the edges.\n\n\
             | | face | back |\n|---|---|---|"
        ),
    );
    for name in ["tubes", "ribbons"] {
        let [front, back] = ["front", "back"]
            .map(|side| format!("![{name}, {side}](gallery/{})", picture_name(name, side)));
        line(page, format_args!("| {name} | {front} | {back} |"));
    }
}

/// The marks of a yarn system: guides of a bar, courses of a feeder.
fn threading(fabric: &Fabric, system: usize) -> String {
    match &fabric.structure {
        Structure::Warp(knit) => knit.bars[system].threading.to_string(),
        Structure::Weft(knit) => knit.feeders[system].courses.to_string(),
        Structure::Laid(_) => "I".to_owned(),
    }
}

/// The section of a fabric.
fn section(page: &mut String, fabric: &Fabric) {
    let pattern = Pattern::new(fabric);
    let numbers = numbers::measure(fabric, &pattern);
    let clearance = clearance::measure(fabric, &pattern, fabric.radius());
    let name = &fabric.name;
    let pictures = ["front", "back", WORN]
        .map(|side| format!("![{name}, {side}](gallery/{})", picture_name(name, side)));
    line(
        page,
        format_args!("\n## {name}\n\n{}.\n\n{}\n", capitalised(&fabric.about), pictures.join(" ")),
    );
    line(
        page,
        format_args!(
            "| bar | lapping | threading | yarn | diameter mm | run-in mm/rack | g/m² |\n\
             |---|---|---|---|---|---|---|"
        ),
    );
    for (at, yarn) in fabric.yarns().enumerate() {
        let run_in = numbers.run_in[at].map_or("-".to_owned(), |run_in| format!("{run_in:.0}"));
        let (number, diameter, mass) = (at + 1, yarn.diameter(), numbers.bar_mass[at]);
        line(
            page,
            format_args!(
                "| {number} | `{}` | `{}` | {} | {diameter:.3} | {run_in} | {mass:.1} |",
                fabric.lapping(at),
                threading(fabric, at),
                yarn.count
            ),
        );
    }
    let Numbers { mass, thickness, cover, .. } = numbers;
    let porosity = numbers.porosity.expect("built-in fabrics are drawn with their own yarns");
    line(
        page,
        format_args!(
            "\n| per cm | g/m² | thickness mm | cover factor | porosity | clearance |\n\
             |---|---|---|---|---|---|"
        ),
    );
    line(
        page,
        format_args!(
            "| {} x {} | {mass:.1} | {thickness:.2} | {cover:.2} | {porosity:.2} | {:.2} |",
            fabric.wales_per_cm, fabric.courses_per_cm, clearance.min_over_2r
        ),
    );
}

/// What mills report, and what we compute.
fn sources(page: &mut String) {
    let fabric = Fabric::named("locknit")
        .and_then(|locknit| locknit.at_densities(15.0, 22.0))
        .expect("densities in range");
    let fabric = Fabric { enlargement: 1.0, ..fabric };
    let numbers = numbers::measure(&fabric, &Pattern::new(&fabric));
    let ratio =
        numbers.run_in[0].zip(numbers.run_in[1]).map_or(f64::NAN, |(front, back)| front / back);
    line(
        page,
        format_args!(
            "\n## Compared with mills\n\n\
             A locknit of 44 dtex, finished at 15 wales and 22 courses per cm:\n"
        ),
    );
    line(page, format_args!("| | mills report | here |\n|---|---|---|"));
    line(page, format_args!("| mass, g/m² | 80 to 110 | {:.1} |", numbers.mass));
    line(page, format_args!("| run-in, front over back bar | 1.24 to 1.35 | {ratio:.2} |"));
}

/// A text with its first letter in upper case.
fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}

/// Adds a line.
fn line(page: &mut String, text: std::fmt::Arguments<'_>) {
    writeln!(page, "{text}").expect("a string takes any text");
}
