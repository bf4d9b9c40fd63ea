//! `warpknit fabrics`: the built-in fabrics.

use std::fmt::Write as _;

use anyhow::Result;
use warpknit::fabric::{Fabric, FabricError, builtin};

use super::args::Fabrics;
use super::print;

/// Lists the fabrics, a line each with the name first, or prints one as the TOML that `--fabric` takes.
pub(crate) fn fabrics(arguments: &Fabrics) -> Result<()> {
    match &arguments.name {
        Some(name) => print(builtin::text(name).ok_or_else(|| FabricError::Unknown(name.clone()))?),
        None => {
            let mut list = String::new();
            for name in builtin::names() {
                let fabric = Fabric::named(name)?;
                let bars: Vec<_> = fabric.bars.iter().map(|bar| bar.chain.to_string()).collect();
                writeln!(list, "{name:10} {:28} {}", bars.join(" + "), fabric.about)?;
            }
            print(&list)
        }
    }
}
