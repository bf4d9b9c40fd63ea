//! Folders of files that `yarn` and `capture` fill from a photo.
//!
//! In: what the photo crate found. Out: files in an [`crate::export::OutputFolder`], which is seen
//! only when whole.

pub mod captured;
pub mod yarn_maps;
