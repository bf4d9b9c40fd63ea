//! Folders of files that `yarn` and `capture` fill from a photo, and `tile` from a fabric.
//!
//! In: the results of the photo crate, and maps of a fabric. Out: files in an [`crate::export::OutputFolder`]. The folder
//! appears under its name only when it is complete.

pub mod captured;
pub mod fabric_maps;
pub mod recognised;
pub mod yarn_maps;
