//! What the arguments choose: the fabric, its densities and its yarns' radius, how the garment is
//! read and how yarns are laid on it.

use std::path::Path;

use anyhow::{Context, Result, bail};
use warpknit::drape;
use warpknit::fabric::{Fabric, FabricError};
use warpknit::garment::{Garment, ReadOptions};
use warpknit::ids::index32;

use super::args::{Chains, Laying, Reading, Shared};
use super::tell;

/// The most stitches that a garment is given unasked. A picture of 1600 x 1200 shows no more of
/// them one by one.
const PICTURED_STITCHES: f64 = 12_000.0;
/// The most that a picture takes for each stitch, GB: measured 1.7 kB where a million are traced
/// piece by piece. Far ones take a quarter of it, but how far they are is not known before they are
/// knitted.
pub(super) const PICTURE_GB: f64 = 1.7e-6;

impl Laying {
    /// What the library takes; surfaces are for those who write them.
    pub(super) fn options(&self) -> drape::Options {
        drape::Options { mapping: self.mapping.into(), edge: self.edge.into(), surface: None }
    }
}

impl Reading {
    /// What the library takes.
    pub(super) fn options(&self) -> ReadOptions {
        ReadOptions {
            unit: self.unit,
            uv_scale: self.uv_scale,
            grain: self.grain.to_radians(),
            turn: self.turn,
        }
    }
}

/// Turns the panels whose layout in the fabric says so.
pub(super) fn turn_grains(garment: &mut Garment, fabric: &Fabric) {
    for layout in &fabric.panels {
        garment.turn_grain(layout.panel, layout.grain_degrees.to_radians());
    }
}

/// The built-in fabric of a name, or the one in a file.
pub(super) fn named_fabric(name: &str) -> Result<Fabric> {
    if Path::new(name).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        Fabric::read(Path::new(name)).map_err(|error| in_file(name, error))
    } else {
        Ok(Fabric::named(name)?)
    }
}

impl Chains {
    /// The fabric with these bars, if there are any.
    pub(super) fn on(&self, fabric: Fabric) -> Result<Fabric> {
        if self.lapping.is_empty() {
            Ok(fabric)
        } else {
            Ok(fabric.with_chains(&self.lapping, &self.threading)?)
        }
    }

    /// What messages call the fabric: as it was asked for, or by its chains.
    pub(super) fn label<'a>(&self, asked: &'a str, fabric: &'a Fabric) -> &'a str {
        if self.lapping.is_empty() { asked } else { &fabric.name }
    }
}

/// The fabric that was named, at the densities that were given.
pub(super) fn fabric(shared: &Shared) -> Result<Fabric> {
    let fabric = shared.chains.on(named_fabric(&shared.fabric)?)?;
    let name = shared.chains.label(&shared.fabric, &fabric);
    for warning in fabric.warnings() {
        tell(shared.running.quiet, &format!("warning: {name}: {warning}"));
    }
    match (shared.wales_per_cm, shared.courses_per_cm) {
        (None, None) => Ok(fabric),
        (wales, courses) => {
            // One density alone scales the other, so that loops keep their shape.
            let aspect = fabric.courses_per_cm / fabric.wales_per_cm;
            let wales =
                wales.or(courses.map(|courses| courses / aspect)).unwrap_or(fabric.wales_per_cm);
            Ok(fabric.at_densities(wales, courses.unwrap_or(wales * aspect))?)
        }
    }
}

/// An error in a fabric file, with its name and line in front.
fn in_file(name: &str, error: FabricError) -> anyhow::Error {
    let place = match &error.place {
        Some(place) => format!("{name}:{}", place.line),
        None => name.to_owned(),
    };
    anyhow::Error::new(error).context(place)
}

/// The fabric for `area` mm² of garment, enlarged where nobody chose densities and its loops would
/// be too many and too small to see.
pub(super) fn pictured(
    fabric: &Fabric,
    area: f64,
    shared: &Shared,
) -> Result<(Fabric, Option<String>)> {
    if shared.wales_per_cm.is_some() || shared.courses_per_cm.is_some() {
        Ok((fabric.clone(), None))
    } else {
        enlarged(fabric, area)
    }
}

/// The same whoever chose densities; and what was done, in words.
pub(super) fn enlarged(fabric: &Fabric, area: f64) -> Result<(Fabric, Option<String>)> {
    let bars = f64::from(index32(fabric.yarn_systems()));
    let stitches = bars * area / (fabric.wale_spacing() * fabric.course_spacing());
    if stitches <= PICTURED_STITCHES {
        return Ok((fabric.clone(), None));
    }
    let times = (stitches / PICTURED_STITCHES).sqrt();
    let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
    let note = format!(
        "{stitches:.0} stitches at true gauge would be too small to see, so the cloth is drawn {times:.1} times enlarged; \
         --wales-per-cm {wales} --courses-per-cm {courses} knits it at true gauge (a picture then takes up to {:.0} GB)",
        stitches * PICTURE_GB
    );
    let enlarged = fabric.clone().at_densities(wales / times, courses / times);
    Ok((enlarged.context("the garment is too large for any density: check --unit")?, Some(note)))
}

/// The radius that was chosen, if the fabric has room for it, or else the fabric's.
pub(super) fn drawn_radius(fabric: &Fabric, chosen: Option<f64>) -> Result<f64> {
    let wale_spacing = fabric.wale_spacing();
    if let Some(radius) = chosen.filter(|radius| *radius > wale_spacing) {
        bail!(
            "a radius of {radius} mm is over the wale spacing of {wale_spacing:.3} mm: yarns would fill each other's place"
        );
    }
    Ok(chosen.unwrap_or(fabric.radius()))
}
