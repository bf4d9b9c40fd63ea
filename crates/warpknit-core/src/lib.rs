//! The core of `warpknit`: from a fabric's lapping and a garment's meshes to draped yarns, as
//! arrays.
//!
//! In: OBJ text and a fabric. Out: blocks of yarns ([`drape::Block`]), which other crates draw or
//! write to files. The stages, in the order in which data flow through them:
//!
//! 1. [`garment`] reads a flat and a draped mesh and pairs them, panel by panel.
//! 2. [`fabric`] holds what a designer names: bars, lapping, yarns, densities.
//! 3. [`knit`] turns a bar's lapping into the data points of its yarns, on the flat panel.
//! 4. [`locate`] finds the flat triangle that holds each data point.
//! 5. [`map`] carries the points to the draped triangles.
//! 6. [`yarn`] draws curves through the points and tubes around the curves.
//!
//! [`drape`] runs stages 3 to 6 block by block, so that memory does not grow with the fabric.
//! [`tile`] cuts a large cloth into parts for several machines.
//! Lengths are millimetres and angles radians throughout, unless a name says otherwise.

mod counted;
mod cursor;
pub mod drape;
pub mod edges;
pub mod fabric;
pub mod garment;
pub mod ids;
pub mod knit;
pub mod locate;
pub mod map;
pub mod number;
mod spatial_hash;
pub mod tile;
pub mod yarn;
