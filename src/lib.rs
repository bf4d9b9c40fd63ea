//! `warpknit` knits warp-knit fabric, yarn by yarn, onto a garment from a pattern tool.

pub mod folder;
pub mod pipeline;
pub mod report;
pub mod system;

pub use warpknit_chart as chart;
pub use warpknit_core::{drape, fabric, garment, ids, knit, locate, map, number, tile, yarn};
pub use warpknit_export as export;
pub use warpknit_photo as photo;
pub use warpknit_render as render;
