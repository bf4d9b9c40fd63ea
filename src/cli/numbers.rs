//! The table of a fabric's numbers that `warpknit swatch` prints.
//!
//! In: the measurements of the real cloth. Out: text.

use std::fmt::Write as _;

use warpknit::fabric::Machine;
use warpknit::knit::strain::pull::BENDING;
use warpknit::pipeline::{FreeWidth, RealCloth, Stretched};

/// One line for each number, with its name first, then one line for each bar.
pub(super) fn table(real: &RealCloth) -> String {
    let RealCloth { fabric, numbers, clearance } = real;
    let machine = fabric.machine().map(|machine| ("machine", machine_text(&machine)));
    let mut rows = vec![
        ("fabric", fabric.name.clone()),
        ("wales", format!("{:.2} /cm, W {:.3} mm", fabric.wales_per_cm, fabric.wale_spacing())),
        (
            "courses",
            format!("{:.2} /cm, C {:.3} mm", fabric.courses_per_cm, fabric.course_spacing()),
        ),
    ];
    rows.extend(machine);
    rows.extend([
        ("mass", format!("{:.1} g/m²", numbers.mass)),
        ("yarn length", format!("{:.0} m/m²", numbers.yarn_length)),
        ("thickness", format!("{:.3} mm", numbers.thickness)),
        ("cover factor", format!("{:.3}", numbers.cover)),
        ("porosity", numbers.porosity.map_or("-".to_owned(), |porosity| format!("{porosity:.3}"))),
        (
            "clearance",
            format!(
                "{:.2} of touching, {} pairs nearer",
                clearance.min_over_2r, clearance.pairs_below_1
            ),
        ),
    ]);
    if fabric.weft_knit().is_some() {
        // 1 m/m² is 1/1000 mm/mm². A loop of a plain weft knit takes one wale times one course.
        let length = numbers.yarn_length / 1000.0 * fabric.wale_spacing() * fabric.course_spacing();
        rows.push(("loop length", format!("{length:.2} mm")));
    }
    if fabric.radius() < fabric.true_radius() {
        let (drawn, thick) = (2.0 * fabric.radius(), 2.0 * fabric.true_radius());
        rows.push((
            "note",
            format!(
                "thickness and cover factor are those of yarns of {drawn:.3} mm, not \
                     {thick:.3} mm: loops have no more room"
            ),
        ));
    }
    let mut table = String::new();
    for (name, value) in rows {
        line(&mut table, format_args!("{name:12}  {value}"));
    }
    line(
        &mut table,
        format_args!(
            "\nbar  {:>10}  {:>11}  {:>14}  {:>7}  {:>6}  lapping",
            "yarn", "diameter mm", "run-in mm/rack", "ratio", "g/m²"
        ),
    );
    for (at, yarn) in fabric.yarns().enumerate() {
        let (count, diameter, mass) =
            (yarn.count.to_string(), yarn.diameter(), numbers.bar_mass[at]);
        let run_in = numbers.run_in[at].map_or("-".to_owned(), |run_in| format!("{run_in:.0}"));
        let ratio = numbers.run_in[at]
            .zip(numbers.run_in[0])
            .map_or("-".to_owned(), |(own, first)| format!("{:.3}", own / first));
        let (number, lapping) = (at + 1, fabric.lapping(at));
        line(
            &mut table,
            format_args!(
                "{number:<3}  {count:>10}  {diameter:>11.3}  {run_in:>14}  {ratio:>7}  {mass:>6.1}  {lapping}"
            ),
        );
    }
    for (number, (yarn, relaxed)) in (1..).zip(fabric.yarns().zip(&numbers.relaxed_run_in)) {
        if let (Some(draft), Some(relaxed)) = (yarn.draft, relaxed) {
            line(
                &mut table,
                format_args!(
                    "bar {number} lies stretched to {draft} times its length: {relaxed:.0} mm a rack \
                     relaxed"
                ),
            );
        }
    }
    table
}

/// How a swatch is pulled: a line, and a table of its free width.
pub(super) fn stretched(stretched: &Stretched) -> String {
    let Stretched { strain, is_locked, free } = stretched;
    let locked = if *is_locked { ", where its yarn would have to stretch" } else { "" };
    let mut table = format!(
        "\npulled to {:.3} along the courses and {:.3} along the wales{locked}; the numbers above \
         are those of flat cloth\n",
        strain.courses, strain.wales
    );
    let Some(last) = free.last() else { return table };
    line(&mut table, format_args!("\ncourses  wales  wales, half as stiff  wales, twice as stiff"));
    for FreeWidth { courses, wales: [soft, assumed, stiff] } in free {
        line(&mut table, format_args!("{courses:<7.2}  {assumed:.3}  {soft:<20.3}  {stiff:.3}"));
    }
    line(
        &mut table,
        format_args!(
            "\nassumed bending: a bend whose chord changes by a radius takes as much energy as two \
             yarns\npressed together by {:.1} % of touching. At the last pull half of it gives \
             {:+.1} % of the width,\nand twice of it {:+.1} %.",
            100.0 * BENDING,
            100.0 * (last.wales[0] - last.wales[1]),
            100.0 * (last.wales[2] - last.wales[1])
        ),
    );
    table
}

/// The densities on the machine, and what finishing takes.
pub(super) fn machine_text(machine: &Machine) -> String {
    format!(
        "gauge {:.1} ({:.2} wales/cm), {:.2} courses/cm; finishing takes {:.1} % of the width and \
         {:.1} % of the length, and leaves the run-in",
        machine.gauge,
        machine.wales_per_cm,
        machine.courses_per_cm,
        100.0 * machine.width_shrink,
        100.0 * machine.length_shrink
    )
}

/// Adds a line to the table.
fn line(table: &mut String, text: std::fmt::Arguments<'_>) {
    writeln!(table, "{text}").expect("a string takes any text");
}
