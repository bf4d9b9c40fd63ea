//! ARCHITECTURE.md tells the truth, and each file says in its header what it is.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All files below a folder, without what is built.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_string_lossy().into_owned();
        if entry.is_dir() && name != "target" && !name.starts_with('.') {
            files(&entry, found);
        } else if entry.is_file() {
            found.push(entry);
        }
    }
}

/// All of our files with these endings.
fn sources(endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for folder in ["src", "crates", "shaders", "tests", "benches", "examples", "fuzz"] {
        files(&root().join(folder), &mut found);
    }
    found.retain(|path| {
        path.extension().is_some_and(|ending| endings.iter().any(|wanted| ending == *wanted))
    });
    assert!(found.len() > 5, "{endings:?}");
    found
}

/// The paths in backticks of ARCHITECTURE.md.
fn named_paths(text: &str) -> Vec<&str> {
    let known = ["crates/", "src/", "tests/", "examples/", "docs/", "fuzz", "benches", "shaders"];
    let is_path = |word: &&str| known.iter().any(|start| word.starts_with(start));
    text.split('`').skip(1).step_by(2).filter(is_path).collect()
}

#[test]
fn every_source_file_has_a_header() {
    for path in sources(&["rs"]) {
        assert!(read(&path).starts_with("//! "), "{} has no header", path.display());
    }
    for path in sources(&["wgsl"]) {
        assert!(read(&path).starts_with("// "), "{} has no header", path.display());
    }
}

#[test]
fn every_path_in_the_architecture_is_there_and_every_room_is_in_it() {
    let text = read(&root().join("ARCHITECTURE.md"));
    assert!(text.split_whitespace().count() <= 1300, "ARCHITECTURE.md is one page");
    let named = named_paths(&text);
    for path in named.iter().filter(|path| !path.contains('*')) {
        assert!(root().join(path).exists(), "{path} is in ARCHITECTURE.md and not in the tree");
    }
    // A room is a crate, or a folder of code right below the source of one.
    let mut rooms = BTreeSet::new();
    for path in sources(&["rs"]) {
        let path = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        let parts: Vec<&str> = path.split('/').collect();
        match parts.as_slice() {
            ["crates", crate_name, "src", room, _, ..] => {
                rooms.insert(format!("crates/{crate_name}/src/{room}"));
            }
            ["crates", crate_name, ..] => _ = rooms.insert(format!("crates/{crate_name}")),
            ["src", room, _, ..] => _ = rooms.insert(format!("src/{room}")),
            _ => {}
        }
    }
    rooms.remove("crates/warpknit-chart/src/garment");
    let is_named = |room: &String| named.iter().any(|path| path.starts_with(room.as_str()));
    let missing: Vec<_> = rooms.iter().filter(|room| !is_named(room)).collect();
    assert_eq!(missing, Vec::<&String>::new(), "not in ARCHITECTURE.md");
}

/// The first names after each `prefix` in a line of code, as in `crate::name` and `crate::{a, b::c}`.
fn names_after(code: &str, prefix: &str) -> Vec<String> {
    let mut names = Vec::new();
    for rest in code.split(prefix).skip(1) {
        let word = |text: &str| -> String {
            text.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect()
        };
        let Some(group) = rest.strip_prefix('{') else {
            names.push(word(rest));
            continue;
        };
        // The names of a group's own level; those of groups inside it belong to their own first name.
        let (mut depth, mut start) = (1, true);
        for (at, letter) in group.char_indices() {
            match letter {
                '{' => depth += 1,
                '}' if depth == 1 => break,
                '}' => depth -= 1,
                ',' if depth == 1 => start = true,
                _ if start && letter.is_alphabetic() => {
                    names.push(word(&group[at..]));
                    start = false;
                }
                _ => {}
            }
        }
    }
    names
}

/// The rooms of a folder: its modules, each with its siblings that it imports. `root` says whether
/// the folder is a crate's root, whose modules are also named by `crate::`.
fn imports(folder: &Path, root: bool) -> BTreeMap<String, BTreeSet<String>> {
    let mut found = Vec::new();
    files(folder, &mut found);
    let mut rooms: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in found.iter().filter(|path| path.extension().is_some_and(|ending| ending == "rs")) {
        let inside = path.strip_prefix(folder).unwrap();
        let first = inside.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
        let room = first.trim_end_matches(".rs").to_owned();
        // `super::` once for each folder between, and once more from a file that is no mod.rs.
        let depth = inside.components().count() - 1;
        let ups = if inside.ends_with("mod.rs") { depth } else { depth + 1 };
        let text = read(path).replace("\r\n", "\n");
        // Tests may use what they like.
        let code = text.split("#[cfg(test)]\nmod ").next().unwrap();
        let code: String = code
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect::<Vec<_>>()
            .join(" ");
        let own = rooms.entry(room.clone()).or_default();
        own.extend(names_after(&code, &"super::".repeat(ups)));
        if root {
            own.extend(names_after(&code, "crate::"));
        }
        own.remove(&room);
    }
    rooms.retain(|room, _| !["lib", "main", "mod"].contains(&room.as_str()));
    let known: BTreeSet<String> = rooms.keys().cloned().collect();
    rooms.values_mut().for_each(|others| others.retain(|other| known.contains(other)));
    rooms
}

#[test]
fn rooms_do_not_import_each_other_in_a_circle() {
    let crates = ["core", "render", "export", "photo", "chart"]
        .map(|name| root().join("crates").join(format!("warpknit-{name}")).join("src"));
    let inner = ["src/cli", "src/pipeline"].map(|folder| root().join(folder));
    let facade = root().join("src");
    let roots = crates.into_iter().chain([facade]).map(|folder| (folder, true));
    for (source, is_root) in roots.chain(inner.map(|folder| (folder, false))) {
        let mut rooms = imports(&source, is_root);
        assert!(rooms.len() > 1, "{}", source.display());
        // Rooms whose imports are all gone go, until none is left, or those of a circle.
        while let Some(free) =
            rooms.iter().find(|(_, others)| others.is_empty()).map(|(room, _)| room.clone())
        {
            rooms.remove(&free);
            rooms.values_mut().for_each(|others| _ = others.remove(&free));
        }
        assert!(rooms.is_empty(), "{}: a circle among {rooms:?}", source.display());
    }
}

#[test]
fn every_file_format_has_a_page_and_a_row_in_the_tables() {
    let refused =
        warpknit::export::Format::from_path(Path::new("cloth.unknown")).unwrap_err().to_string();
    let endings: Vec<&str> =
        refused.split("known are ").nth(1).unwrap().split_whitespace().collect();
    assert!(endings.len() > 10, "{refused}");
    let text = |path: &str| read(&root().join(path));
    for ending in endings {
        let page = format!("formats/{}.md", ending.trim_start_matches('.'));
        assert!(text(&format!("docs/{page}")).starts_with(&format!("# {ending}\n")), "{page}");
        assert!(
            text("README.md").contains(&format!("| [`{ending}`](docs/{page}) |")),
            "{ending} in README.md"
        );
        assert!(
            text("docs/formats.md").contains(&format!("| [`{ending}`]({page}) |")),
            "{ending} in docs/formats.md"
        );
    }
}
