//! Licences and sources of all dependencies, against deny.toml, without a network: the part of
//! `cargo deny check` that always runs.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde::Deserialize;
use spdx::{Expression, ParseMode};

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
}

#[derive(Deserialize)]
struct Deny {
    licenses: Licences,
    sources: Sources,
}

#[derive(Deserialize)]
struct Licences {
    allow: Vec<String>,
    #[serde(default)]
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Sources {
    allow_registry: Vec<String>,
}

/// All packages of Cargo.lock, for every system, as far as they are on this machine; else those of
/// this system.
fn packages() -> Vec<Package> {
    let metadata = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO"));
        command
            .args(["metadata", "--offline", "--locked", "--all-features", "--format-version", "1"])
            .args(more);
        command.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap()
    };
    let mut output = metadata(&[]);
    if !output.status.success() {
        eprintln!("skipped: packages for other systems, which were never downloaded here");
        output = metadata(&["--filter-platform", &host()]);
    }
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice::<Metadata>(&output.stdout).unwrap().packages
}

fn host() -> String {
    let rustc = Path::new(env!("CARGO")).with_file_name("rustc");
    let output = Command::new(rustc).arg("-vV").output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().find_map(|line| line.strip_prefix("host: ")).unwrap().to_owned()
}

/// What is wrong with a package, if anything.
fn refusal(package: &Package, deny: &Deny) -> Option<String> {
    let Package { name, version, license, source } = package;
    let exceptions = deny.licenses.exceptions.iter().filter(|exception| exception.name == *name);
    let allowed: Vec<&String> = deny
        .licenses
        .allow
        .iter()
        .chain(exceptions.flat_map(|exception| &exception.allow))
        .collect();
    let Some(license) = license else { return Some(format!("{name} {version} names no licence")) };
    let expression = match Expression::parse_mode(license, ParseMode::LAX) {
        Ok(expression) => expression,
        Err(why) => {
            return Some(format!("{name} {version}: {license:?} can't be read ({})", why.reason));
        }
    };
    // `X WITH exception` is more than X allows, and is not in the list.
    let is_allowed =
        |wanted: &spdx::LicenseReq| allowed.iter().any(|allowed| **allowed == wanted.to_string());
    if !expression.evaluate(is_allowed) {
        return Some(format!("{name} {version} is under {license}, which deny.toml doesn't allow"));
    }
    let known = source.as_ref().is_none_or(|source| {
        source.strip_prefix("registry+").is_some_and(|registry| {
            deny.sources.allow_registry.iter().any(|known| known == registry)
        })
    });
    (!known)
        .then(|| format!("{name} {version} comes from {}", source.as_deref().unwrap_or_default()))
}

fn deny() -> Deny {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("deny.toml");
    toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn every_dependency_is_under_a_licence_that_is_allowed() {
    let (packages, deny) = (packages(), deny());
    assert!(packages.len() > 100, "{} packages are not all", packages.len());
    let refused: Vec<_> = packages.iter().filter_map(|package| refusal(package, &deny)).collect();
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    // An exception for a crate that is gone would be forgotten.
    let names: BTreeMap<_, _> = packages.iter().map(|package| (&package.name, ())).collect();
    assert!(deny.licenses.exceptions.iter().all(|exception| names.contains_key(&exception.name)));
}

#[test]
fn what_is_not_allowed_is_found() {
    let deny = deny();
    let of = |license: Option<&str>, source: Option<&str>| {
        let [license, source] = [license, source].map(|text| text.map(str::to_owned));
        refusal(
            &Package { name: "some".to_owned(), version: "1.0.0".to_owned(), license, source },
            &deny,
        )
    };
    let index = deny.sources.allow_registry.iter().map(|url| format!("registry+{url}")).next();
    for license in ["MIT/Apache-2.0", "GPL-3.0-only OR Zlib", "(MIT OR Apache-2.0) AND Unicode-3.0"]
    {
        assert_eq!(of(Some(license), index.as_deref()), None);
    }
    for license in [
        "GPL-3.0-only",
        "MIT AND GPL-2.0-or-later",
        "OFL-1.1",
        "Apache-2.0 WITH LLVM-exception",
        "none of your business",
    ] {
        assert!(of(Some(license), None).is_some(), "{license}");
    }
    assert!(of(None, None).is_some());
    assert!(of(Some("MIT"), Some("git+https://example.com/x")).is_some());
}
