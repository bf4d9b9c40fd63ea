//! Yarns as curves, frames and surfaces.

pub mod curve;
pub mod frame;
pub mod nurbs;
pub mod tube;
mod walk;
