//! Values of flags: choices by name, and parsers of numbers, sizes and paths.
//!
//! In: the text of a flag. Out: the value, or a message that says what is allowed. clap prints it
//! with the flag's name.

use std::path::PathBuf;
use std::str::FromStr;

use clap::ValueEnum;
use glam::{DVec2, DVec3};
use warpknit::chart;
use warpknit::drape::strands::Edge;
use warpknit::export::glb::{Nodes, Precision};
use warpknit::export::{FileUnit, Format, InpDialect, UpAxis, UsdCurves};
use warpknit::map::Mapping;
use warpknit::pipeline::{EdgeFinish, Enlarge, FREE_PULLS, LoupeChoice, STRETCHES, Stretch};
use warpknit::render::light::toward_sun;
use warpknit::render::scene::Shape;
use warpknit::render::{RendererChoice, View};

/// The largest side of a picture, pixels.
pub(crate) const MOST_PIXELS: u32 = 32_768;

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum RendererArg {
    Auto,
    Gpu,
    Cpu,
}

impl From<RendererArg> for RendererChoice {
    fn from(renderer: RendererArg) -> Self {
        match renderer {
            RendererArg::Auto => Self::Auto,
            RendererArg::Gpu => Self::Gpu,
            RendererArg::Cpu => Self::Cpu,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SwitchArg {
    On,
    Off,
}

impl SwitchArg {
    pub(crate) fn is_on(self) -> bool {
        self == Self::On
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum UsdCurvesArg {
    /// The yarns' own curves, in mm
    Bezier,
    /// Lines between data points, in metres, with the physics of the yarns, as Newton reads them
    Linear,
}

impl From<UsdCurvesArg> for UsdCurves {
    fn from(curves: UsdCurvesArg) -> Self {
        match curves {
            UsdCurvesArg::Bezier => Self::Bezier,
            UsdCurvesArg::Linear => Self::Linear,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum InpArg {
    /// CalculiX: square beams, and a step that runs
    Calculix,
    /// Abaqus: round beams, and contact pairs
    Abaqus,
}

impl From<InpArg> for InpDialect {
    fn from(dialect: InpArg) -> Self {
        match dialect {
            InpArg::Calculix => Self::Calculix,
            InpArg::Abaqus => Self::Abaqus,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum ShapeArg {
    Tube,
    Ribbon,
}

impl From<ShapeArg> for Shape {
    fn from(shape: ShapeArg) -> Self {
        match shape {
            ShapeArg::Tube => Self::Tube,
            ShapeArg::Ribbon => Self::Ribbon,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum EdgeArg {
    /// Cut the yarn there
    Clip,
    /// Leave out every stitch that crosses it
    Drop,
}

impl From<EdgeArg> for Edge {
    fn from(edge: EdgeArg) -> Self {
        match edge {
            EdgeArg::Clip => Self::Clip,
            EdgeArg::Drop => Self::Drop,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum EdgesArg {
    /// Turn open edges in and sew them, and give seams their allowances
    Hemmed,
    /// End cloth where its panel ends
    Raw,
}

impl From<EdgesArg> for EdgeFinish {
    fn from(edges: EdgesArg) -> Self {
        match edges {
            EdgesArg::Hemmed => Self::Hemmed,
            EdgesArg::Raw => Self::Raw,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum FileUnitArg {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
}

impl From<FileUnitArg> for FileUnit {
    fn from(chosen: FileUnitArg) -> Self {
        match chosen {
            FileUnitArg::Mm => Self::Mm,
            FileUnitArg::Cm => Self::Cm,
            FileUnitArg::M => Self::M,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum UpArg {
    /// y, and z towards the viewer
    Y,
    /// z, and -y towards the viewer
    Z,
}

impl From<UpArg> for UpAxis {
    fn from(chosen: UpArg) -> Self {
        match chosen {
            UpArg::Y => Self::Y,
            UpArg::Z => Self::Z,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum PrecisionArg {
    /// 16 bits a coordinate and 8 a normal's
    U16,
    /// Floats of 32 bits
    F32,
}

impl From<PrecisionArg> for Precision {
    fn from(chosen: PrecisionArg) -> Self {
        match chosen {
            PrecisionArg::U16 => Self::Quantised,
            PrecisionArg::F32 => Self::F32,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum FloatArg {
    /// 64 bits
    F64,
    /// 32 bits
    F32,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum NodesArg {
    /// Each bar of each panel
    Bar,
    /// Each yarn
    Yarn,
}

impl From<NodesArg> for Nodes {
    fn from(chosen: NodesArg) -> Self {
        match chosen {
            NodesArg::Bar => Self::Bar,
            NodesArg::Yarn => Self::Yarn,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum MappingArg {
    /// The source paper's method: affine in each triangle
    Frame,
    /// Depth in mm along a smooth normal
    Smooth,
    /// Yarn keeps its length: loops deform as the cloth is strained
    Relaxed,
}

impl From<MappingArg> for Mapping {
    fn from(mapping: MappingArg) -> Self {
        match mapping {
            MappingArg::Frame => Self::Frame,
            MappingArg::Smooth => Self::Smooth,
            MappingArg::Relaxed => Self::Relaxed,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum ViewArg {
    Front,
    Back,
    Left,
    Right,
    Top,
    Iso,
}

impl From<ViewArg> for View {
    fn from(view: ViewArg) -> Self {
        match view {
            ViewArg::Front => Self::Front,
            ViewArg::Back => Self::Back,
            ViewArg::Left => Self::Left,
            ViewArg::Right => Self::Right,
            ViewArg::Top => Self::Top,
            ViewArg::Iso => Self::Iso,
        }
    }
}

/// Parses an output's path. Its ending gives the format.
pub(super) fn output(text: &str) -> Result<(PathBuf, Format), String> {
    let path = PathBuf::from(text);
    let format = Format::from_path(&path).map_err(|error| error.to_string())?;
    Ok((path, format))
}

#[cfg(feature = "view")]
/// Parses the path of a picture of the window.
pub(super) fn picture(text: &str) -> Result<PathBuf, String> {
    match output(text)? {
        (path, Format::Png) => Ok(path),
        _ => Err("a picture of the window ends with .png".to_owned()),
    }
}

/// The formats of what `inspect` finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FactsFormat {
    /// A drawing.
    Chart(chart::ChartFormat),
    /// The facts of a garment, for scripts.
    Json,
}

impl FactsFormat {
    /// The ending that asks for it.
    pub(crate) fn ending(self) -> &'static str {
        match self {
            Self::Chart(chart) => chart.ending(),
            Self::Json => ".json",
        }
    }
}

/// Parses the path of a file of `inspect`.
pub(super) fn diagram(text: &str) -> Result<(PathBuf, FactsFormat), String> {
    let path = PathBuf::from(text);
    let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
    let chart = || chart::ChartFormat::from_path(&path).map(FactsFormat::Chart);
    let format = if is_json { Some(FactsFormat::Json) } else { chart() };
    let format =
        format.ok_or("inspect writes no file with this ending; known are .svg .png .json")?;
    Ok((path, format))
}

/// Parses a size such as `1600x1200`.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text
        .split_once(['x', 'X'])
        .and_then(|(w, h)| Some((w.parse::<u32>().ok()?, h.parse::<u32>().ok()?)));
    match sides {
        Some((w, h)) if (1..=MOST_PIXELS).contains(&w) && (1..=MOST_PIXELS).contains(&h) => {
            Ok((w, h))
        }
        _ => Err(format!("write it as 1600x1200, both sides from 1 to {MOST_PIXELS}")),
    }
}

/// Parses the number of samples of edges. WebGPU guarantees 1 and 4 only.
pub(super) fn samples(text: &str) -> Result<u32, String> {
    match text {
        "1" => Ok(1),
        "4" => Ok(4),
        _ => Err("it must be 1 or 4".to_owned()),
    }
}

/// Parses a point such as `0,500,1200`.
pub(super) fn vector(text: &str) -> Result<DVec3, String> {
    let numbers =
        list(text).filter(|numbers: &[f64; 3]| numbers.iter().all(|number| number.is_finite()));
    numbers
        .map(DVec3::from)
        .ok_or_else(|| "write three numbers with commas, such as 0,500,1200".to_owned())
}

/// Parses the direction to the sun, given as angles in degrees around the camera and above its
/// level, along the camera's right, up and back axes.
pub(super) fn sun(text: &str) -> Result<DVec3, String> {
    list(text).and_then(toward_sun).ok_or_else(|| {
        "write two angles with a comma, such as -40,35: degrees to the right and up, up to 90"
            .to_owned()
    })
}

/// Parses an enlargement. Under 1 cloth would be finer than it is.
pub(super) fn enlarge(text: &str) -> Result<Enlarge, String> {
    if text == "auto" {
        return Ok(Enlarge::Auto);
    }
    let otherwise = "it must be auto, or 1 or more";
    number(text, |times: &f64| *times >= 1.0 && times.is_finite(), otherwise).map(Enlarge::Times)
}

/// Parses where a loupe looks.
pub(super) fn loupe(text: &str) -> Result<LoupeChoice, String> {
    if text == "off" {
        return Ok(LoupeChoice::Off);
    }
    let shares = list(text)
        .filter(|shares: &[f64; 2]| shares.iter().all(|share| (0.0..=1.0).contains(share)));
    shares.map(|shares| LoupeChoice::At(DVec2::from(shares))).ok_or_else(|| {
        "write off, or the place as shares of the picture's width and height, both from 0 to 1, \
             such as 0.5,0.4"
            .to_owned()
    })
}

/// Parses a rectangle: x, y, width, height.
pub(super) fn rectangle(text: &str) -> Result<[u32; 4], String> {
    list(text).ok_or_else(|| {
        "write x, y, width and height in pixels with commas, such as 100,50,800,300".to_owned()
    })
}

/// Parses two vectors in the plane.
pub(super) fn two_vectors(text: &str) -> Result<[f64; 4], String> {
    let numbers =
        list(text).filter(|numbers: &[f64; 4]| numbers.iter().all(|number| number.is_finite()));
    numbers.ok_or_else(|| "write both vectors in pixels with commas, such as 24,0,0,18".to_owned())
}

/// Parses exactly `N` numbers with commas between them.
fn list<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let numbers: Option<Vec<T>> =
        text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Parses a share of white.
pub(super) fn brightness(text: &str) -> Result<f32, String> {
    number(text, |share| (-1.0..=1.0).contains(share), "it must be between -1 and 1")
}

/// Parses a factor of contrast.
pub(super) fn contrast(text: &str) -> Result<f32, String> {
    number(text, |factor| (0.1..=10.0).contains(factor), "it must be between 0.1 and 10")
}

/// Parses a number that is neither infinite nor NaN.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    number(text, |number: &f64| number.is_finite(), "it must be a number")
}

/// Parses a finite number over 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, |number: &f64| *number > 0.0 && number.is_finite(), "it must be a number over 0")
}

/// Parses how a swatch is pulled.
pub(super) fn stretch(text: &str) -> Result<Stretch, String> {
    let ratio = |text: &str, (least, most): (f64, f64), what| {
        number(text.trim(), |ratio: &f64| (least..=most).contains(ratio), what)
    };
    let ratios = "write X, X,Y or X,free; each is a ratio of 0.5 to 2, such as 1.15 for 15 % more";
    let (courses, wales) = text.split_once(',').unwrap_or((text, "1"));
    if wales.trim().eq_ignore_ascii_case("free") {
        let pulls = "a free width is looked for at ratios of 1 to 1.25";
        return Ok(Stretch { courses: ratio(courses, FREE_PULLS, pulls)?, wales: None });
    }
    let wales = Some(ratio(wales, STRETCHES, ratios)?);
    Ok(Stretch { courses: ratio(courses, STRETCHES, ratios)?, wales })
}

/// The run-in of a bar, mm a rack. `None` for a bar that keeps its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RunIn(pub(crate) Option<f64>);

/// Parses a run-in, or `-` for a bar that keeps its own. The fabric checks its range.
pub(super) fn run_in(text: &str) -> Result<RunIn, String> {
    if text == "-" {
        return Ok(RunIn(None));
    }
    let otherwise =
        "write mm a rack of 480 courses, such as 1240, or - for a bar that keeps its own";
    number(text, |length: &f64| *length > 0.0 && length.is_finite(), otherwise)
        .map(|length| RunIn(Some(length)))
}

/// Parses width over height of a section. Beyond these limits tubes would be sheets.
pub(super) fn flattening(text: &str) -> Result<f64, String> {
    number(text, |ratio| (0.1..=10.0).contains(ratio), "it must be between 0.1 and 10")
}

/// Parses a field of view in degrees. Perspective has no picture at 180 degrees, and above 120 its
/// borders are stretched beyond use.
pub(super) fn field_of_view(text: &str) -> Result<f64, String> {
    number(text, |degrees| (1.0..=120.0).contains(degrees), "it must be between 1 and 120 degrees")
}

/// Parses a number for which `suits` is true, or returns the message `otherwise`.
fn number<T: FromStr>(
    text: &str,
    suits: impl FnOnce(&T) -> bool,
    otherwise: &str,
) -> Result<T, String> {
    text.parse().ok().filter(suits).ok_or_else(|| otherwise.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_vectors_and_numbers() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert!(size("0x4").is_err() && size("640").is_err() && size("99999x1").is_err());
        assert_eq!(vector("1,-2, 3.5"), Ok(DVec3::new(1.0, -2.0, 3.5)));
        assert!(vector("1,2").is_err() && vector("1,2,x").is_err() && vector("1,2,3,x").is_err());
        assert_eq!(enlarge("auto"), Ok(Enlarge::Auto));
        assert_eq!(enlarge("2.5"), Ok(Enlarge::Times(2.5)));
        for wrong in ["0.5", "-1", "inf", "nan", "big", ""] {
            assert!(enlarge(wrong).is_err(), "{wrong}");
        }
        assert_eq!(loupe("off"), Ok(LoupeChoice::Off));
        assert_eq!(loupe("0.25, 1"), Ok(LoupeChoice::At(DVec2::new(0.25, 1.0))));
        for wrong in ["on", "400,300", "0.5", "-0.1,0.5", "nan,0.5", "0.1,0.2,0.3", ""] {
            assert!(loupe(wrong).is_err(), "{wrong}");
        }
        assert_eq!(rectangle("1, 2,30,40"), Ok([1, 2, 30, 40]));
        assert!(
            rectangle("1,2,3").is_err()
                && rectangle("1,2,3,-4").is_err()
                && rectangle("1,2,3,4,5").is_err()
        );
        assert!(brightness("-2").is_err() && contrast("0").is_err() && contrast("1.5").is_ok());
        assert_eq!((run_in("1240"), run_in("-")), (Ok(RunIn(Some(1240.0))), Ok(RunIn(None))));
        assert!(run_in("0").is_err() && run_in("-5").is_err() && run_in("1.2m").is_err());
        assert!(positive("0").is_err() && positive("nan").is_err() && positive("inf").is_err());
    }
}
