//! Checks of a run: limits before the work, and losses after it.
//!
//! In: the settings of a run, its cloth, or its totals. Out: an error, a warning or a note.

use std::path::PathBuf;

use super::RunError;
use super::estimates::float;
use super::job::Source;
use super::settings::{EdgeFinish, LoupeChoice, Placement, Settings, Wanted};
use super::targets::check_distinct;
use crate::drape::strands::Losses;
use crate::drape::{Cloth, DrapeOptions, Totals};
use crate::export::{ExportError, Format, html};
use crate::garment::Garment;
use crate::garment::stretch::triangles;
use crate::map::Mapping;
use crate::map::relaxed::StrainCounts;
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
    check_placement(settings.placement)?;
    let picture = &settings.picture;
    let has_loupe = matches!(picture.loupe, LoupeChoice::At(_));
    let has_hems = picture.edges == Some(EdgeFinish::Hemmed);
    check_distinct(
        source.inputs.iter().map(PathBuf::as_path),
        outputs.iter().map(|(path, _)| path.as_path()),
    )?;
    if !outputs.iter().any(|(_, format)| *format == Format::Png) {
        return match picture.turntable {
            Some(_) => Err(RunError::TurntableWithoutPicture),
            None if has_loupe => Err(RunError::LoupeWithoutPicture),
            None if has_hems => Err(RunError::HemsWithoutPicture),
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

/// Refuses sweeps with a mapping that stretches yarns as if they were rubber.
///
/// # Errors
/// [`RunError::SweepsUnrelaxed`].
pub fn check_placement(placement: Placement) -> Result<(), RunError> {
    match placement.mapping {
        Mapping::Smooth | Mapping::Frame if placement.sweeps == Some(true) => {
            Err(RunError::SweepsUnrelaxed)
        }
        Mapping::Smooth | Mapping::Frame | Mapping::Relaxed => Ok(()),
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

/// Refuses a page of more stitches than a browser shows, before they are knitted.
pub(super) fn check_pages(outputs: &[Wanted], stitches: u64) -> Result<(), ExportError> {
    match outputs.iter().find(|(_, format)| *format == Format::Html) {
        Some((path, _)) if stitches > html::MOST_STITCHES => Err(ExportError::PageTooLarge {
            path: Some(path.clone()),
            count: stitches,
            what: "stitches",
            most: html::MOST_STITCHES,
        }),
        _ => Ok(()),
    }
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

/// The note on how yarns keep their lengths, where the fabric's repeat can't be solved for strains: by
/// sweeps alone, or not at all.
#[must_use]
pub fn lengths_note(cloth: &Cloth<'_>, options: &DrapeOptions) -> Option<String> {
    if options.mapping != Mapping::Relaxed
        || cloth.strain().is_some_and(|table| !table.is_flat_only())
    {
        return None;
    }
    Some(if cloth.keeps_lengths(options) {
        "this fabric's repeat is too large to be solved for the garment's strains: yarns keep their \
         lengths by being moved on the garment alone, where each has room"
            .to_owned()
    } else {
        let why = if cloth.strain().is_none() {
            "this fabric's repeat can't be solved for the garment's strains"
        } else {
            "this fabric's repeat is too large to be solved for the garment's strains, and yarns \
             are not moved apart on it (--sweeps on)"
        };
        format!("{why}, so yarns stretch with the garment as if they were rubber")
    })
}

/// Share of the points that may be locked without a warning. Cut edges and seams of most garments have
/// some.
const FEW_LOCKED: f64 = 0.01;
/// Largest stretch of a panel below which bends have locked it. Loops of all built-in fabrics follow as
/// much as this; a larger one would call cloth bent that was stretched.
const LITTLE_STRETCH: f64 = 1.05;

/// The warning about cloth that is strained further than its loops can follow. `strain` has the counts
/// of each panel.
#[must_use]
pub fn locked_warning(strain: &[StrainCounts], garment: &Garment) -> Option<String> {
    let share =
        |counts: &StrainCounts| float(counts.locked as u64) / float(counts.points.max(1) as u64);
    let mut all = StrainCounts::default();
    strain.iter().for_each(|counts| all += *counts);
    if share(&all) <= FEW_LOCKED {
        return None;
    }
    let most = (0..strain.len()).max_by_key(|&panel| strain[panel].locked)?;
    let largest = triangles(std::slice::from_ref(&garment.panels[most])).into_iter();
    let largest = largest.map(|triangle| triangle.largest).fold(1.0, f64::max);
    let (how, remedy) = if largest < LITTLE_STRETCH {
        ("bent sharply".to_owned(), "smooth the draped mesh")
    } else {
        let stretched = format!("stretched in places to {largest:.2} times its length");
        (stretched, "take a pattern that fits the body with less stretch")
    };
    Some(format!(
        "the garment strains {:.0} % of the cloth further than its loops can follow: most on panel \
         {most}, {:.0} % of it, which is {how}; yarns there stretch like rubber and may cut each \
         other; {remedy}, or take a fabric that gives more",
        100.0 * share(&all),
        100.0 * share(&strain[most]),
    ))
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;

    #[test]
    fn cloth_that_is_locked_is_said_to_be_stretched_or_bent() {
        let of = |stretch: f64| {
            let flat = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)].map(DVec2::from);
            let draped = flat.map(|place| DVec3::new(stretch * place.x, place.y, 0.0));
            Garment::from_arrays(&flat, &draped, &[[0, 1, 2], [0, 2, 3]]).unwrap()
        };
        let locked = |locked: usize| [StrainCounts { points: 100, locked, ..Default::default() }];
        assert_eq!(locked_warning(&locked(1), &of(1.3)), None);
        let stretched = locked_warning(&locked(20), &of(1.3)).unwrap();
        assert!(stretched.contains("20 % of it, which is stretched in places to 1.30 times"));
        let bent = locked_warning(&locked(20), &of(1.0)).unwrap();
        assert!(bent.contains("bent sharply") && bent.contains("smooth the draped mesh"), "{bent}");
    }
}
