//! A fabric as maps: its repeat knitted, measured and drawn without light.
//!
//! In: a fabric and the resolution of its maps. Out: [`MappedFabric`]. Yarns are those of a swatch,
//! with the same radius, colours and textures. Sizes are refused before the repeat is relaxed.

use super::RunError;
use super::clock::{Clock, Message, Task};
use super::numbers::RealCloth;
use super::textures::{Textures, scene};
use super::warnings::measured_warnings;
use crate::fabric::Fabric;
use crate::knit::{Pattern, clearance, links, run_in};
use crate::render::fabric_maps::FabricMaps;
use crate::render::scene::Shape;

/// A fabric with its maps and its numbers.
#[derive(Debug)]
pub struct MappedFabric {
    /// The maps of a repeat.
    pub maps: FabricMaps,
    /// The fabric and its measurements, as `swatch` prints them.
    pub real: RealCloth,
}

/// Knits, measures and draws one repeat of a fabric at about `dpi` pixels per inch. `name` is the
/// fabric's in messages.
///
/// # Errors
/// [`RunError::Unmappable`] where the maps would be too large or too small; those of run-ins and of
/// textures.
///
/// ```
/// use warpknit::fabric::Fabric;
/// use warpknit::pipeline::{Clock, fabric_maps};
/// let tricot = Fabric::named("tricot")?;
/// let mapped = fabric_maps(&tricot, "tricot", 300.0, &mut Clock::start(&()))?;
/// assert_eq!(mapped.maps.front.alpha.dimensions(), mapped.maps.back.alpha.dimensions());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fabric_maps(
    fabric: &Fabric,
    name: &str,
    dpi: f64,
    clock: &mut Clock<'_>,
) -> Result<MappedFabric, RunError> {
    let unmappable = |source| RunError::Unmappable { fabric: name.to_owned(), source };
    FabricMaps::pixels_at(fabric, dpi).map_err(unmappable)?;
    let textures = Textures::read(None, fabric)?;
    clock.begin(Task::Relax, 0.0);
    let listener = clock.listener();
    let pattern = Pattern::with_progress(fabric, &mut |done| listener.progress(done));
    run_in::check(fabric, &pattern)?;
    let near = clearance::measure(fabric, &pattern, fabric.radius());
    let links = links::measure(fabric, &pattern);
    for warning in measured_warnings(fabric, &pattern, fabric.radius(), &near, &links) {
        listener.say(Message::Warning(&warning));
    }
    clock.begin(Task::Render, 0.0);
    let bars = scene(Shape::Tube, fabric, fabric.radius(), &textures);
    let maps = FabricMaps::draw(fabric, &pattern, &bars, dpi, &|done| listener.progress(done))
        .map_err(unmappable)?;
    clock.stop();
    Ok(MappedFabric { maps, real: RealCloth::from_pattern(fabric, &pattern, near) })
}
