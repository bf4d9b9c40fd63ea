//! The gallery, the documents' lists and links, and the sources' numbers: what documents say is
//! what the program computes.

use std::path::{Path, PathBuf};

use warpknit::fabric::{Fabric, builtin};
use warpknit::knit::{Pattern, numbers};

#[path = "../../examples/gallery/page.rs"]
mod page;

/// What all pictures may take together.
const MOST_BYTES: u64 = 11_000_000;
/// How long the README may be.
const MOST_WORDS: usize = 1500;

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
fn every_fabric_has_its_pictures_and_they_are_small() {
    let mut bytes = 0;
    for (name, side) in builtin::names()
        .chain(["tubes", "ribbons"])
        .flat_map(|name| [(name, "front"), (name, "back")])
        .chain(builtin::names().map(|name| (name, page::WORN)))
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
fn the_list_of_fabrics_has_a_line_for_every_fabric() {
    let list = std::fs::read_to_string(docs().join("fabric-list.md")).unwrap();
    for name in builtin::names() {
        let about = Fabric::named(name).unwrap().about;
        assert!(
            list.lines().any(|line| line == format!("| [`{name}`](gallery.md#{name}) | {about} |")),
            "{name}"
        );
    }
    assert_eq!(
        list.lines().filter(|line| line.starts_with("| [`")).count(),
        builtin::names().count(),
        "the list has rows of fabrics that are not built in"
    );
}

#[test]
fn the_readme_is_short() {
    let readme = std::fs::read_to_string(docs().join("../README.md")).unwrap();
    let words = readme.split_whitespace().count();
    assert!(words <= MOST_WORDS, "{words} words: a page in docs/ holds what a task needs");
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let root = docs().join("..");
    let folders = ["", "docs", "docs/formats", "examples/wardrobe", "fuzz", "tests/readers"];
    let mut broken = Vec::new();
    for page in folders.iter().flat_map(|folder| pages(&root.join(folder))) {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in links(&text).filter(|link| !link.starts_with("http")) {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.with_file_name(file) };
            if !target.exists() || !(heading.is_empty() || has_heading(&target, heading)) {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert_eq!(broken, Vec::<String>::new());
}

/// The Markdown files of a folder, in the order of their names.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<_> =
        entries.filter(|path| path.extension().is_some_and(|ending| ending == "md")).collect();
    pages.sort();
    pages
}

/// The targets of a page's links and pictures.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(link, _)| link)
}

/// Whether a page has a heading with this anchor, as GitHub names anchors.
fn has_heading(page: &Path, anchor: &str) -> bool {
    std::fs::read_to_string(page).unwrap().lines().any(|line| {
        let heading = line.trim_start_matches('#');
        line.starts_with('#') && named_anchor(heading.trim()) == anchor
    })
}

/// The anchor of a heading: lower case, blanks as dashes, no other punctuation.
fn named_anchor(heading: &str) -> String {
    let lower = heading.to_lowercase().replace(' ', "-");
    lower.chars().filter(|&letter| letter.is_alphanumeric() || "-_".contains(letter)).collect()
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
