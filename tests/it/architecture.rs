//! ARCHITECTURE.md tells the truth: every source file has its row, and every row its file.

use std::collections::BTreeSet;
use std::path::Path;

fn files(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        if entry.is_dir() {
            files(&entry, found);
        } else {
            found.insert(entry.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/"));
        }
    }
}

#[test]
fn every_file_is_listed_and_every_listed_file_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let rows = text.lines().filter_map(|line| {
        line.strip_prefix("| `")?.split_once('`').map(|(file, _)| file.to_owned())
    });
    let mut listed: BTreeSet<_> =
        rows.filter(|file| file.starts_with("src/") || file.starts_with("shaders/")).collect();
    let mut there = BTreeSet::new();
    files(&root.join("src"), &mut there);
    if root.join("shaders").is_dir() {
        files(&root.join("shaders"), &mut there);
    }
    // A row that names a folder stands for the data files right in it, of which there must be some;
    // code has a row a file.
    for folder in listed.iter().filter(|row| row.ends_with('/')).cloned().collect::<Vec<_>>() {
        let is_data = |file: &String| {
            file.strip_prefix(&folder)
                .is_some_and(|name| name.ends_with(".toml") && !name.contains('/'))
        };
        let before = there.len();
        there.retain(|file| !is_data(file));
        assert!(there.len() < before, "{folder} is in ARCHITECTURE.md and has no data files");
        listed.remove(&folder);
    }
    assert_eq!(
        there.difference(&listed).collect::<Vec<_>>(),
        Vec::<&String>::new(),
        "in the tree, not in ARCHITECTURE.md"
    );
    assert_eq!(
        listed.difference(&there).collect::<Vec<_>>(),
        Vec::<&String>::new(),
        "in ARCHITECTURE.md, not in the tree"
    );
}

#[test]
fn every_file_format_has_a_page_and_a_row_in_the_tables() {
    let refused =
        warpknit::export::Format::from_path(Path::new("cloth.unknown")).unwrap_err().to_string();
    let endings: Vec<&str> =
        refused.split("known are ").nth(1).unwrap().split_whitespace().collect();
    assert!(endings.len() > 10, "{refused}");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| {
        std::fs::read_to_string(root.join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
    };
    for ending in endings {
        let page = format!("formats/{}.md", ending.trim_start_matches('.'));
        assert!(read(&format!("docs/{page}")).starts_with(&format!("# {ending}\n")), "{page}");
        assert!(
            read("README.md").contains(&format!("| [`{ending}`](docs/{page}) |")),
            "{ending} in README.md"
        );
        assert!(
            read("docs/formats.md").contains(&format!("| [`{ending}`]({page}) |")),
            "{ending} in docs/formats.md"
        );
    }
}
