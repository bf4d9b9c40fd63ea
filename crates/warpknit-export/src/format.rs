//! The formats of files, and the endings that ask for them.

use std::path::Path;

use super::ExportError;

/// What a file's ending asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A picture.
    Png,
    /// Binary glTF 2.0: tubes.
    Glb,
    /// Wavefront OBJ: tubes.
    Obj,
    /// Wavefront OBJ: centre lines. No ending asks for it: it shares that of [`Format::Obj`].
    ObjLines,
    /// Binary PLY: tubes.
    Ply,
    /// A web page: centre lines, of which it makes tubes.
    Html,
    /// USD text: curves.
    Usda,
    /// USD crate: the same in binary form.
    Usdc,
    /// Binary Curve Collection: centre lines.
    Bcc,
    /// Mitsuba's curves, as text.
    Curves,
    /// Abaqus input: beams.
    Inp,
    /// Arrays for numpy.
    Npz,
    /// Data points.
    Csv,
    /// The run's report.
    Json,
}

/// What endings ask for.
const ENDINGS: [(&str, Format); 13] = [
    (".png", Format::Png),
    (".glb", Format::Glb),
    (".obj", Format::Obj),
    (".ply", Format::Ply),
    (".html", Format::Html),
    (".usda", Format::Usda),
    (".usdc", Format::Usdc),
    (".bcc", Format::Bcc),
    (".curves.txt", Format::Curves),
    (".inp", Format::Inp),
    (".npz", Format::Npz),
    (".csv", Format::Csv),
    (".json", Format::Json),
];

/// All endings, in a line.
pub(super) fn endings() -> String {
    ENDINGS.map(|(ending, _)| ending).join(" ")
}

impl Format {
    /// The format of a path, by its ending in any case.
    ///
    /// # Errors
    /// [`ExportError::UnknownEnding`].
    ///
    /// ```
    /// use std::path::Path;
    /// use warpknit_export::Format;
    /// assert_eq!(Format::from_path(Path::new("out/Skirt.Curves.TXT"))?, Format::Curves);
    /// # Ok::<(), warpknit_export::ExportError>(())
    /// ```
    pub fn from_path(path: &Path) -> Result<Self, ExportError> {
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default()
            .to_ascii_lowercase();
        // A name is more than its ending.
        let known = ENDINGS
            .iter()
            .find(|(ending, _)| name.strip_suffix(ending).is_some_and(|stem| !stem.is_empty()));
        known.map(|(_, format)| *format).ok_or_else(|| ExportError::UnknownEnding(path.to_owned()))
    }

    /// The ending that asks for it.
    #[must_use]
    pub fn ending(self) -> &'static str {
        let asked = if self == Self::ObjLines { Self::Obj } else { self };
        ENDINGS.iter().find(|(_, format)| *format == asked).map_or("", |(ending, _)| ending)
    }

    /// Whether it holds tubes, and so needs blocks with surfaces.
    #[must_use]
    pub fn holds_tubes(self) -> bool {
        matches!(self, Self::Glb | Self::Obj | Self::Ply)
    }

    /// Whether it holds all frames of a drape sequence.
    #[must_use]
    pub fn holds_sequences(self) -> bool {
        matches!(self, Self::Usda | Self::Usdc)
    }

    /// Whether it holds pictures of yarns.
    #[must_use]
    pub fn holds_textures(self) -> bool {
        matches!(self, Self::Glb | Self::Obj)
    }
}
