//! The gallery, the README and the sources' numbers: what documents say is what the program
//! computes.

use std::path::{Path, PathBuf};

use warpknit::fabric::{Fabric, builtin};
use warpknit::knit::{Pattern, numbers};

#[path = "../../examples/gallery/page.rs"]
mod page;

/// What all pictures may take together.
const MOST_BYTES: u64 = 6_000_000;

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")
}

#[test]
fn the_page_is_up_to_date() {
    let written = std::fs::read_to_string(docs().join("gallery.md")).unwrap();
    for (line, (written, computed)) in (1..).zip(written.lines().zip(page::text().lines())) {
        assert_eq!(
            written, computed,
            "docs/gallery.md:{line} is old: cargo run --release --example gallery"
        );
    }
    assert_eq!(written.lines().count(), page::text().lines().count());
}

#[test]
fn every_fabric_has_both_its_pictures_and_they_are_small() {
    let mut bytes = 0;
    for (name, side) in builtin::names()
        .chain(["tubes", "ribbons"])
        .flat_map(|name| [(name, "front"), (name, "back")])
    {
        let path = docs().join("gallery").join(page::picture_name(name, side));
        assert_eq!(
            image::image_dimensions(&path)
                .unwrap_or_else(|error| panic!("{}: {error}", path.display())),
            (320, 240)
        );
        bytes += path.metadata().unwrap().len();
    }
    assert!(bytes < MOST_BYTES, "{bytes} bytes");
}

#[test]
fn the_readme_has_a_line_for_every_fabric() {
    let readme = std::fs::read_to_string(docs().join("../README.md")).unwrap();
    for name in builtin::names() {
        let about = Fabric::named(name).unwrap().about;
        assert!(
            readme
                .lines()
                .any(|line| line == format!("| [`{name}`](docs/gallery.md#{name}) | {about} |")),
            "{name}"
        );
    }
}

#[test]
fn a_locknit_weighs_and_runs_in_as_mills_report() {
    let fabric = Fabric::named("locknit").unwrap().at_densities(15.0, 22.0).unwrap();
    let fabric = Fabric { enlargement: 1.0, ..fabric };
    assert!((fabric.yarn(0).count.tex() - 4.4).abs() < 1e-12);
    let numbers = numbers::measure(&fabric, &Pattern::new(&fabric));
    assert!((80.0..=110.0).contains(&numbers.mass), "{} g/m²", numbers.mass);
    let ratio = numbers.run_in[0].unwrap() / numbers.run_in[1].unwrap();
    assert!((1.24..=1.35).contains(&ratio), "run-in {ratio} : 1");
}
