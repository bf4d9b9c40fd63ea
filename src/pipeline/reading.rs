//! A garment as a run needs it: read, with all cloth counted that can't be knitted.
//!
//! In: the garment's files. Out: the garment, whose summary has what lies under other cloth too.

use std::path::Path;

use crate::garment::{Frames, Garment, GarmentError, ReadOptions, read};
use crate::locate::covered::count_covered;

/// Reads a garment: `flat` and `draped`, or one file whose `vt` are the flat pattern.
///
/// # Errors
/// Those of [`read`] and of [`count_covered`].
pub fn read_garment(
    flat: &Path,
    draped: Option<&Path>,
    options: &ReadOptions,
) -> Result<Garment, GarmentError> {
    let mut garment = read(flat, draped, options)?;
    count_covered(&mut garment, flat, options.allow_loss)?;
    Ok(garment)
}

/// Reads a garment with its first drape, and prepares for further frames, as [`Frames::read`] does.
///
/// # Errors
/// Those of [`Frames::read`] and of [`count_covered`].
pub fn read_frames(
    flat: &Path,
    first: Option<&Path>,
    options: &ReadOptions,
) -> Result<(Garment, Frames), GarmentError> {
    let (mut garment, frames) = Frames::read(flat, first, options)?;
    count_covered(&mut garment, flat, options.allow_loss)?;
    Ok((garment, frames))
}
