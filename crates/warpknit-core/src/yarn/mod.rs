//! Yarns as curves, tangent frames, fibres and surfaces.
//!
//! In: the points of a strand, mm. Out: curves ([`curve`], [`nurbs`]), frames along them
//! ([`frame`]), centre lines ([`mod@line`]), tubes ([`tube`]), fibres ([`fibres`]) and hairs
//! ([`hairs`]).

pub mod curve;
pub mod faces;
pub mod fibres;
pub mod frame;
pub mod hairs;
mod lanes;
pub mod line;
pub mod nurbs;
mod outline;
pub(crate) mod random;
mod rings;
mod steps;
pub mod tube;
mod walk;
