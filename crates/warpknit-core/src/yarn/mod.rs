//! Yarns as curves, frames and surfaces.

pub mod curve;
pub mod faces;
pub mod fibres;
pub mod frame;
pub mod line;
pub mod nurbs;
mod steps;
pub mod tube;
mod walk;
