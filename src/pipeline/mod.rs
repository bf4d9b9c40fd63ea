//! One whole run, from a fabric and a garment to files. The command, the window and the gallery use
//! it.
//!
//! ```text
//!   Settings ─▶ densities ─▶ Job ─▶ fibres, textures ─▶ writers ─┐
//!                                                     └▶ scene ──┴▶ lay ─▶ camera, pictures ─▶ summary ─▶ files
//! ```
//!
//! In: a garment or the size of a swatch, a [`crate::fabric::Fabric`], [`Settings`]. Out: files,
//! all of them or none, and [`Done`]. A [`Listener`] receives progress and messages. Nothing here
//! prints.

mod camera;
mod clock;
mod densities;
mod drawn;
mod edges;
mod environment;
mod error;
mod estimates;
mod fabric_maps;
mod fibres;
mod job;
mod limits;
mod loupe;
mod make;
mod messages;
mod motion;
mod notes;
mod numbers;
mod pictures;
mod reading;
mod run;
mod sequence;
mod set;
mod settings;
mod setup;
mod strain_cache;
mod stretch;
mod summary;
mod targets;
mod textures;
mod views;
mod warnings;
mod writers;

pub use clock::{Clock, Listener, Message, Task};
pub use densities::{drawn_radius, turn_panels};
pub use edges::{add_thread_look, add_threads, edges_of, has_finished_edges};
pub use environment::{EnvironmentFileError, read_environment};
pub use error::RunError;
pub use fabric_maps::{MappedFabric, fabric_maps};
pub use job::Source;
pub use limits::MOST_STITCHES;
pub use limits::{
    check_laid, check_memory, check_placement, check_stitches, lengths_note, locked_warning,
    loss_warning,
};
pub use motion::{Motion, Sequence};
pub use numbers::RealCloth;
pub use pictures::options;
pub use reading::{read_frames, read_garment};
pub use run::{drape, spread, swatch};
pub use set::{Staged, set};
pub use settings::{
    Body, Densities, EdgeFinish, Enlarge, LoupeChoice, PictureSettings, Placement, Settings, Wanted,
};
pub use strain_cache::{StrainCache, cache_folder};
pub use stretch::{BENDINGS, FREE_PULLS, FreeWidth, STRETCHES, Stretch, Stretched};
pub use summary::{Done, Laid};
pub use targets::{check_distinct, numbered};
pub use textures::{Textures, scene};
pub use views::{InView, draped_points, extent};
pub use warnings::cloth_warnings;
