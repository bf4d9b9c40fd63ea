//! Checks of a run: limits before the work, and losses after it.
//!
//! In: the settings of a run, its cloth, or its totals. Out: an error, a warning or a note.

use std::path::PathBuf;

use super::RunError;
use super::job::Source;
use super::settings::{LoupeChoice, Placement, Settings, Wanted};
use super::targets::check_distinct;
use crate::drape::strands::Losses;
use crate::drape::{Cloth, Totals};
use crate::export::Format;
use crate::map::Mapping;
use crate::system::available_memory_gb;
use crate::tile::Tile;

/// The most stitches of a run. With more, 32 bits could no longer number the data points. Any garment
/// at its true gauge has far fewer.
pub const MOST_STITCHES: u64 = 200_000_000;

/// Refuses settings that can't be met, before the repeat is relaxed. `is_moving` says whether pictures
/// are those of a sequence.
pub(super) fn check_settings(
    settings: &Settings,
    source: &Source,
    outputs: &[Wanted],
    is_moving: bool,
) -> Result<(), RunError> {
    let picture = &settings.picture;
    let has_loupe = matches!(picture.loupe, LoupeChoice::At(_));
    check_distinct(
        source.inputs.iter().map(PathBuf::as_path),
        outputs.iter().map(|(path, _)| path.as_path()),
    )?;
    if !outputs.iter().any(|(_, format)| *format == Format::Png) {
        return match picture.turntable {
            Some(_) => Err(RunError::TurntableWithoutPicture),
            None if has_loupe => Err(RunError::LoupeWithoutPicture),
            None => Ok(()),
        };
    }
    if has_loupe && (is_moving || picture.turntable.is_some()) {
        return Err(RunError::LoupeOfMany);
    }
    if picture.eye.is_some_and(|(eye, target)| eye == target) {
        return Err(RunError::NoDirection);
    }
    let rows = picture.size.1;
    match settings.tile.map(Tile::numbers) {
        Some([number, of]) if of > rows => Err(RunError::TooManyTiles { number, of, rows }),
        _ => Ok(()),
    }
}

/// Refuses more stitches than can be numbered.
///
/// # Errors
/// [`RunError::TooManyStitches`].
pub fn check_stitches(stitches: u64) -> Result<(), RunError> {
    if stitches > MOST_STITCHES {
        return Err(RunError::TooManyStitches { stitches, most: MOST_STITCHES });
    }
    Ok(())
}

/// Refuses cloth that needs more memory than is free, before the work rather than in the middle of
/// it. The need is an estimate, in GB.
///
/// # Errors
/// [`RunError::NoMemory`].
pub fn check_memory(
    what: &'static str,
    stitches: u64,
    needed: f64,
    remedy: &'static str,
) -> Result<(), RunError> {
    match available_memory_gb() {
        Some(free) if needed > free => {
            Err(RunError::NoMemory { what, stitches, needed, free, remedy })
        }
        // Where the system doesn't give the free memory, the work is tried.
        _ => Ok(()),
    }
}

/// Refuses cloth without a single yarn.
///
/// # Errors
/// [`RunError::NoYarn`].
pub fn check_laid(totals: &Totals) -> Result<(), RunError> {
    if totals.strands == 0 { Err(RunError::NoYarn) } else { Ok(()) }
}

/// The warning about data points that were lost in defects of the mesh, if there are any.
#[must_use]
pub fn loss_warning(totals: &Totals) -> Option<String> {
    let Losses { in_defects, .. } = totals.losses;
    (in_defects > 0).then(|| {
        format!(
            "{in_defects} data points of stitches that are kept lie in triangles that can't be \
             knitted and are lost"
        )
    })
}

/// The note that yarns stretch with the garment although their lengths were to be kept, if the
/// fabric's repeat can't be solved for strains.
#[must_use]
pub fn unstrained_note(cloth: &Cloth<'_>, placement: Placement) -> Option<String> {
    if placement.mapping != Mapping::Relaxed || cloth.keeps_lengths(&placement.into()) {
        return None;
    }
    let why = if cloth.strain().is_none() {
        "this fabric's repeat can't be solved for the garment's strains"
    } else {
        "this fabric's repeat is too large to be solved for the garment's strains, and yarns are \
         not moved apart on it (--sweeps on)"
    };
    Some(format!("{why}, so yarns stretch with the garment as if they were rubber"))
}
