//! `warpknit` knits warp-knit and weft-knit fabric, yarn by yarn, onto a garment from a pattern
//! tool.
//!
//! A garment comes flat and draped, a fabric by its name or its lapping. The result is every yarn
//! as geometry, and a picture that reads as knitted cloth:
//!
//! ```
//! use std::io::Cursor;
//!
//! use warpknit::drape::Cloth;
//! use warpknit::export::{self, Format, WriteOptions};
//! use warpknit::fabric::Fabric;
//! use warpknit::garment::{Garment, ReadOptions};
//! use warpknit::render::{self, Camera, RenderOptions, View, cloth};
//!
//! // A garment: a square whose `vt` is its flat pattern. A file, a download or a zip entry will do as well.
//! let obj = "v 0 0 0\nv 40 0 0\nv 40 40 9\nv 0 40 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
//! let garment = Garment::read_obj(obj.as_bytes(), &ReadOptions::default())?;
//!
//! // A fabric, so coarse that its loops can be seen, laid on the garment.
//! let fabric = Fabric::named("locknit")?.at_densities(0.2, 0.3)?;
//! let cloth = Cloth::cover(&garment, &fabric)?;
//!
//! // Every yarn as a tube, for Blender or a web page.
//! let mut glb = Cursor::new(Vec::new());
//! export::write(Format::Glb, &cloth, &fabric, &WriteOptions::default(), &mut glb)?;
//! assert!(glb.get_ref().starts_with(b"glTF"));
//!
//! // A picture.
//! let scene = cloth::from_cloth(&cloth, &fabric);
//! let options = RenderOptions { width: 80, height: 60, ..RenderOptions::default() };
//! let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, options.aspect());
//! let picture = render::render(&scene, &camera, &options, &|_| ())?;
//! let mut png = Cursor::new(Vec::new());
//! picture.write_to(&mut png, image::ImageFormat::Png)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Where to start:
//!
//! | you have | start with |
//! |---|---|
//! | files of a garment | [`pipeline::read_garment`], [`pipeline::drape`] for files and pictures in one go |
//! | arrays or a byte stream | [`garment::Garment::from_arrays`], [`garment::Garment::read_obj`] |
//! | a lapping | [`fabric::Fabric::with_chains`], [`fabric::Fabric::parse`] |
//! | a fabric whose numbers you want | [`pipeline::RealCloth`], [`knit::numbers`] |
//! | a need for yarns in memory | [`drape::run`] hands over blocks of them |
//! | a need for files | [`export::write`] |
//! | a need for pictures | [`render::render`], [`render::Painter`] |
//! | a photo of a yarn or of a cloth | [`photo::yarn`], [`photo::capture`] |
//!
//! The stages are crates and modules of their own, re-exported here: [`garment`], [`fabric`],
//! [`knit`], [`locate`], [`map`], [`yarn`], [`edges`] and [`drape`] from `warpknit-core`, and [`render`],
//! [`export`], [`photo`] and [`chart`]. This crate adds [`pipeline`], which assembles whole runs,
//! [`folder`] and [`report`]. The cargo feature `cli` adds the command, `gpu` pictures by a
//! graphics card, and `view` the window. Lengths are millimetres and angles radians throughout,
//! unless a name says otherwise.

pub mod folder;
pub mod pipeline;
pub mod report;
pub mod system;

/// The version of this package and of the command.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

pub use warpknit_chart as chart;
pub use warpknit_core::{
    drape, edges, fabric, garment, ids, knit, locate, map, number, tile, yarn,
};
pub use warpknit_export as export;
pub use warpknit_photo as photo;
pub use warpknit_render as render;
