//! Errors of a run. Each variant carries the values and limits that its message names.

use std::path::PathBuf;

use glam::DVec2;

use super::estimates::size_text;
use crate::drape::LayoutError;
use crate::export::{ExportError, Format};
use crate::fabric::FabricError;
use crate::garment::GarmentError;
use crate::knit::run_in::RunInError;
use crate::photo::yarn::PhotoError;
use crate::render::GpuError;
use crate::render::fabric_maps::FabricMapsError;

/// An error that ends a run. Each message is one line and says what to do. Its flags are those of the
/// command.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// An error in a fabric or in its densities.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// A run-in that can't be knitted.
    #[error(transparent)]
    RunIn(#[from] RunInError),
    /// An error in a file of a garment or of one of its frames.
    #[error(transparent)]
    Garment(#[from] GarmentError),
    /// A file that can't be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The graphics card.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// An error in the maps that were chosen for all yarns.
    #[error(transparent)]
    Maps(#[from] PhotoError),
    /// An error in the maps that the fabric names for one bar.
    #[error("the yarn of bar {bar}")]
    MapsOfBar {
        /// Number of the bar, from 1.
        bar: usize,
        /// The error in its maps.
        source: PhotoError,
    },
    /// A fabric that can't be laid out on this garment.
    #[error("{fabric}")]
    Layout {
        /// The fabric's name as the user gave it.
        fabric: String,
        /// The reason.
        source: LayoutError,
    },
    /// A fabric whose repeat can't be drawn as maps.
    #[error("{fabric}")]
    Unmappable {
        /// The fabric's name as the user gave it.
        fabric: String,
        /// The reason.
        source: FabricMapsError,
    },
    /// An enlargement that no fabric can have.
    #[error("--enlarge {times}")]
    Enlarged {
        /// The chosen enlargement.
        times: f64,
        /// The density that was tried.
        source: FabricError,
    },
    /// A garment so large that its enlarged fabric would be outside the limits of densities.
    #[error("the garment is too large for any density: check --unit")]
    TooLargeGarment {
        /// The density that was tried.
        source: FabricError,
    },
    /// Bodies that don't match the frames they stand in.
    #[error(
        "--body names {bodies} meshes and there are {frames} drapes: give one mesh, or one for each drape"
    )]
    Bodies {
        /// Meshes of bodies.
        bodies: usize,
        /// Drapes of the garment.
        frames: usize,
    },
    /// A fabric that can't be pulled.
    #[error(
        "{fabric}: --stretch solves the repeat of a relaxed knit, and this fabric's can't be solved, \
         or is too large"
    )]
    CantStretch {
        /// The fabric's name.
        fabric: String,
    },
    /// Yarns thicker than the space between two wales.
    #[error(
        "a radius of {radius} mm is over the wale spacing of {wale_spacing:.3} mm: yarns would fill \
         each other's place"
    )]
    TooThick {
        /// The radius that was chosen, mm.
        radius: f64,
        /// The largest radius that fits, mm.
        wale_spacing: f64,
    },
    /// More stitches than [`super::MOST_STITCHES`].
    #[error(
        "{stitches} stitches are over the limit of {most}: lower --wales-per-cm and --courses-per-cm"
    )]
    TooManyStitches {
        /// How many there would be.
        stitches: u64,
        /// How many there may be.
        most: u64,
    },
    /// Cloth that needs more memory than is free.
    #[error(
        "{what} of {stitches} stitches takes about {} of memory and {} are free: {remedy}",
        size_text(.needed * 1e9), size_text(.free * 1e9)
    )]
    NoMemory {
        /// What takes the memory.
        what: &'static str,
        /// The number of stitches.
        stitches: u64,
        /// The memory that they need, GB.
        needed: f64,
        /// The free memory, GB.
        free: f64,
        /// What to do.
        remedy: &'static str,
    },
    /// A turntable without a picture.
    #[error(
        "--turntable turns pictures, and none is asked for: name one, such as -o all-around.png"
    )]
    TurntableWithoutPicture,
    /// A loupe without a picture.
    #[error(
        "--loupe is a part of a picture, and none is asked for: name one, such as -o cloth.png"
    )]
    LoupeWithoutPicture,
    /// A loupe in pictures that move.
    #[error("--loupe X,Y is for one picture, and these are many: leave it out")]
    LoupeOfMany,
    /// Hems without a picture.
    #[error(
        "--edges hemmed is for pictures, and none is asked for: name one, such as -o cloth.png"
    )]
    HemsWithoutPicture,
    /// A loupe at a place without cloth.
    #[error(
        "--loupe {},{}: the picture shows no cloth there; choose a place on the garment, in shares \
         of the picture's width and height from its top left corner", at.x, at.y
    )]
    LoupeOffCloth {
        /// The place, as shares of the picture's width and height.
        at: DVec2,
    },
    /// A camera at the point that it looks at.
    #[error("--eye and --look-at are the same point: there is no direction to look in")]
    NoDirection,
    /// A tile of a picture with fewer rows than tiles.
    #[error(
        "--tile {number}/{of}: a picture of {rows} rows can't be cut into {of} parts; raise --size, \
         or ask for fewer"
    )]
    TooManyTiles {
        /// The tile, from 1.
        number: u32,
        /// How many tiles there would be.
        of: u32,
        /// Rows of the picture.
        rows: u32,
    },
    /// Sweeps were asked for with a mapping that has none.
    #[error(
        "--sweeps on goes with --mapping relaxed, which keeps the lengths of yarns: leave out one of \
         --sweeps and --mapping"
    )]
    SweepsUnrelaxed,
    /// No yarn on the garment.
    #[error(
        "no yarn lies on the garment: its panels are smaller than a stitch; check --unit, or raise \
         --wales-per-cm and --courses-per-cm"
    )]
    NoYarn,
    /// An output that would overwrite an input or another output.
    #[error(
        "{}: this file is an input or another output; name another one with -o", path.display()
    )]
    NotDistinct {
        /// The file.
        path: PathBuf,
    },
    /// Fibres were asked for together with ribbons.
    #[error("--shape ribbon has no fibres: leave out one of --shape and --fibres")]
    RibbonsOfFibres,
    /// Fibres were asked for in a file of data points.
    #[error(
        "{}: data points are of yarns and not of fibres: leave out --fibres, or write .usda, .bcc, \
         .curves.txt or .glb",
        path.display()
    )]
    DataPointsOfFibres {
        /// The file.
        path: PathBuf,
    },
    /// More fibres than a file holds.
    #[error(
        "{}: the fibres of {stitches} stitches take about {points:.1e} points, and the file holds \
         {most:.1e} at most: raise --fibre-radius, or write a swatch",
        path.display()
    )]
    TooManyFibres {
        /// The file.
        path: PathBuf,
        /// Stitches of the cloth.
        stitches: u64,
        /// Points of their fibres.
        points: f64,
        /// The most points that the file can hold.
        most: f64,
    },
    /// A turntable or a tile was asked for together with a drape sequence.
    #[error("--turntable and --tile are for one drape, and these are {frames} frames")]
    NotOfSequence {
        /// Frames of the sequence.
        frames: usize,
    },
    /// Fibres were asked for in a file of all frames.
    #[error(
        "a {} or .usdc of a drape sequence holds yarns and not fibres: leave out --fibres, or drape the \
         frames one by one",
        Format::Usda.ending()
    )]
    FibresOfSequence,
}
