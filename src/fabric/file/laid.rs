//! The tables of laid cloth: its strands, each with the path of its yarn.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{Limits, Source, YarnTable, unplaced};
use crate::fabric::bar::{Bar, BarKind};
use crate::fabric::error::{FabricError, Fault};
use crate::fabric::{MAX_PATH, Path};

const ACROSS: Limits = (-100.0, 100.0, "cells");
const DEPTH: Limits = (-1000.0, 1000.0, "mm");
/// Points nearer to each other than this are one.
const APART: f64 = 1e-9;

/// A `[[strands]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StrandTable {
    runs: Runs,
    path: Spanned<Vec<[Spanned<f64>; 3]>>,
    yarn: YarnTable,
}

/// Where a strand goes on.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Runs {
    Along,
    Across,
}

impl StrandTable {
    /// The strand, and the path of its yarn.
    pub(super) fn into_bar(self, number: usize, source: Source<'_>) -> Result<(Bar, Path), FabricError> {
        let refuse = |why| Fault::Path { number, why }.at(source.0, self.path.span());
        let places = self.path.get_ref();
        if !(2..=MAX_PATH).contains(&places.len()) {
            return Err(refuse("has too few or too many points: 2 to 1000 are taken"));
        }
        let mut path = Path::with_capacity(places.len());
        for [x, y, z] in places {
            let place = |name: &str, number: &Spanned<f64>, limits| source.number(name, number, limits);
            let what = format!("strand {number}: path");
            path.push(DVec3::new(place(&what, x, ACROSS)?, place(&what, y, ACROSS)?, place(&what, z, DEPTH)?));
        }
        let (kind, period) = match self.runs {
            Runs::Along => (BarKind::LaidAlong, DVec3::Y),
            Runs::Across => (BarKind::LaidAcross, DVec3::X),
        };
        let next = path.iter().copied().skip(1).chain([path[0] + period]);
        if path.iter().zip(next).any(|(point, next)| point.distance(next) < APART) {
            return Err(refuse(
                "has two points in a row in one place; it goes on into the next cell, so the last is not the first again",
            ));
        }
        Ok((Bar::laid(kind, self.yarn.into_yarn(&format!("strand {number}"), source)?), path))
    }

    pub(super) fn of(bar: &Bar, path: &Path) -> Self {
        let runs = if bar.kind == BarKind::LaidAcross { Runs::Across } else { Runs::Along };
        let path = path.iter().map(|point| point.to_array().map(unplaced)).collect();
        Self { runs, path: unplaced(path), yarn: YarnTable::from(&bar.yarn) }
    }
}
