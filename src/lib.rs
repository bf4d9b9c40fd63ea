//! `warpknit` knits warp-knit fabric, yarn by yarn, onto a garment from a pattern tool.
//!
//! The stages, in the order in which data flow through them:
//!
//! 1. [`garment`] reads a flat and a draped OBJ and pairs them, panel by panel.
//! 2. [`fabric`] holds what a designer names: bars, lapping, yarns, densities.
//! 3. [`knit`] turns a bar's lapping into the data points of its yarns, on the flat panel.
//! 4. [`locate`] finds the flat triangle that holds each data point.
//! 5. [`map`] carries the points to the draped triangles.
//! 6. [`yarn`] draws curves through the points and tubes around the curves.
//! 7. [`render`] traces a picture of the yarns, [`export`] writes files.
//!
//! [`chart`] draws a fabric's lapping diagram without knitting it.
//! [`capture`] finds the yarns in a photo of a cloth, [`photo`] makes maps of a photo of a yarn.
//! [`drape`] runs stages 3 to 7 block by block, so that memory does not grow with the fabric.
//! Of a large cloth [`tile`] says what is one machine's part.
//! Lengths are millimetres and angles radians throughout, unless a name says otherwise.

pub mod capture;
pub mod chart;
pub mod drape;
pub mod export;
pub mod fabric;
pub mod garment;
pub mod ids;
pub mod knit;
pub mod locate;
pub mod map;
pub mod photo;
mod plane;
pub mod render;
pub mod report;
pub mod scene;
pub mod tile;
pub mod unit;
pub mod yarn;
