//! Yarns as curves, frames and surfaces.

pub mod curve;
pub mod faces;
pub mod frame;
pub mod nurbs;
pub mod tube;
mod walk;
