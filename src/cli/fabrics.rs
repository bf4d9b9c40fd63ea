//! `warpknit fabrics`: the list of built-in fabrics, or one of them as TOML.

use std::fmt::Write as _;

use anyhow::Result;
use warpknit::fabric::{Fabric, Structure, builtin};
use warpknit::pipeline::Densities;

use super::args::{DEFAULT_FABRIC, Fabrics};
use super::choice::named_fabric;
use super::terminal::print;

/// Width of the column of chains, characters. Nets have longer chains: these are cut, and
/// `warpknit fabrics NAME` shows them whole.
const CHAINS: usize = 32;

/// Lists the fabrics, one line each with the name first, or prints one as the TOML that `--fabric`
/// reads. A lapping, counts and run-ins make a fabric of their own, so that what was tried with
/// them becomes a file.
pub(crate) fn fabrics(arguments: &Fabrics) -> Result<()> {
    let Fabrics { name, chains } = arguments;
    if chains.is_given() {
        let asked = name.as_deref().unwrap_or(DEFAULT_FABRIC);
        let (fabric, _) = chains.on(named_fabric(asked)?, Densities::default())?;
        return print(&fabric.to_string());
    }
    match name {
        Some(name) => match builtin::text(name) {
            // The text as it was written, with its comments. A fabric file is parsed and written
            // again, so that its keys and defaults become visible.
            Some(text) => print(text),
            None => print(&named_fabric(name)?.to_string()),
        },
        None => {
            let width = builtin::names().map(str::len).max().unwrap_or(0);
            let mut list = String::new();
            for name in builtin::names() {
                let fabric = Fabric::named(name)?;
                let structure = match &fabric.structure {
                    Structure::Weft(knit) => {
                        format!("weft knit, {} x {}", knit.motif.wales(), knit.motif.courses())
                    }
                    Structure::Warp(_) | Structure::Laid(_) => {
                        let lappings = (0..fabric.yarn_systems()).map(|bar| fabric.lapping(bar));
                        lappings.collect::<Vec<_>>().join(" + ")
                    }
                };
                writeln!(
                    list,
                    "{name:width$}  {:CHAINS$}  {}",
                    shortened(&structure),
                    fabric.about
                )?;
            }
            print(&list)
        }
    }
}

/// The chains, cut to the width of their column. Chains are ASCII.
fn shortened(chains: &str) -> String {
    if chains.len() <= CHAINS { chains.to_owned() } else { format!("{}…", &chains[..CHAINS - 1]) }
}
