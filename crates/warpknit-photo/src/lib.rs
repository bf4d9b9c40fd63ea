//! Photos as sources: a photo of a yarn becomes maps that tile, a photo of a cloth becomes the
//! yarns of its repeat.
//!
//! In: pictures. Out: data. Nothing is written here: the `warpknit` package puts the results into
//! files. [`yarn`] reads and makes the maps that yarns are drawn with, [`capture`] finds the yarns
//! of a cloth.

pub mod capture;
mod fourier;
mod plane;
pub mod recognise;
pub mod yarn;
