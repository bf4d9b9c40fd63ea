//! Yarns as curves, frames and surfaces.

pub mod curve;
