//! Folders of files that `yarn` and `capture` fill from a photo.
//!
//! In: the results of the photo crate. Out: files in an [`crate::export::OutputFolder`]. The folder
//! appears under its name only when it is complete.

pub mod captured;
pub mod recognised;
pub mod yarn_maps;
