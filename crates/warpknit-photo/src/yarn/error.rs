//! Errors of reading the pictures of a yarn.

use std::fmt::Display;
use std::io;
use std::path::PathBuf;

use super::develop::DevelopError;

/// A message of several lines as one line.
fn one_line(message: impl Display) -> String {
    message.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Why a yarn's pictures can't be used. Each error names the file and a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhotoError {
    /// The file system refused.
    #[error("{}: can't be read ({reason})", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: io::Error,
    },
    /// Bytes that no decoder takes.
    #[error(
        "{}: is no image that can be read ({}): save it as PNG or JPEG",
        .path.display(), one_line(.reason)
    )]
    NotAnImage {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        reason: image::ImageError,
    },
    /// A file that ends before its picture does. JPEG decoders would fill the rest with grey.
    #[error("{}: ends in the middle of its picture: copy it again", .path.display())]
    CutShort {
        /// The file.
        path: PathBuf,
    },
    /// A folder without the one picture that is needed.
    #[error(
        "{}: has no base_color.png: name the folder that holds a yarn's maps, or one image file",
        .path.display()
    )]
    NoBaseColor {
        /// The folder.
        path: PathBuf,
    },
    /// Fewer pixels than a map takes.
    #[error(
        "{}: {width} x {height} pixels are too few: at least {least} are needed each way",
        .path.display()
    )]
    TooSmall {
        /// The file.
        path: PathBuf,
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The limit.
        least: u32,
    },
    /// More pixels than a graphics card takes.
    #[error(
        "{}: {width} x {height} pixels are too many: make it {most} or fewer each way",
        .path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The limit.
        most: u32,
    },
    /// A photo that is too small or too large to be developed.
    #[error("{}: {reason}", .path.display())]
    Photo {
        /// The file.
        path: PathBuf,
        /// Its size, and what is wrong with it.
        reason: DevelopError,
    },
    /// yarn.toml is no TOML, or has a size that is no number.
    #[error(
        "{}: can't be understood ({}): its keys are width_mm, length_mm and width_in_yarns, \
         all numbers",
        .path.display(), one_line(.reason.message())
    )]
    Toml {
        /// The file.
        path: PathBuf,
        /// Where and why.
        reason: Box<toml::de::Error>,
    },
    /// A size that no yarn has.
    #[error("{}: {key} = {value}: it must be over 0 and at most {most}", .path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// The key.
        key: &'static str,
        /// What it says.
        value: f64,
        /// The limit.
        most: f64,
    },
}
