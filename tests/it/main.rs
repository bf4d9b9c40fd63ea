//! All integration tests, one module a subject.

#![expect(
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "tests count in small numbers, and a failure there is a message to us and not to a user"
)]

mod aperiodic;
mod architecture;
mod bench;
mod capture;
mod chart;
mod clearance;
mod cli;
mod cloth;
mod config;
mod curves;
mod drape;
mod edges;
mod environment;
mod estimates;
mod evenness;
mod fabric_maps;
mod fabrics;
mod far;
mod feed;
mod files;
mod finish;
mod flip;
mod formats_in;
mod gallery;
mod garment;
mod golden;
mod gpu;
mod hairs;
mod inspect;
mod interlock;
#[cfg(unix)]
mod interruption;
mod knit_photo;
mod laid;
mod lappings;
mod licences;
mod locate;
mod loupe;
mod malformed;
mod map;
#[cfg(target_os = "linux")]
mod memory;
mod nets;
mod page;
mod photo;
mod readback;
mod relax;
mod render;
mod ribbon;
mod seen;
mod sequence;
mod set;
mod sheen;
mod spread;
mod strain;
mod tile;
#[cfg(all(feature = "view", target_os = "linux"))]
mod view;
mod weft;
mod winding;
mod yarn_photo;

/// The folder that stands in for the user's caches in runs of the command.
fn cache_home() -> &'static str {
    concat!(env!("CARGO_TARGET_TMPDIR"), "/cache")
}
