//! `warpknit.Yarns`: what a drape or a swatch makes.
//!
//! In: the arrays of [`LaidArrays`]. Out: numpy arrays over the same memory, tubes, pictures, files and
//! the report. Tubes and pictures are made from the arrays. Files and the report are made by a run
//! of `warpknit::pipeline` with the same settings, so that they are those of the command, byte for
//! byte; that run knits again.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use image::RgbaImage;
use numpy::{IntoPyArray, PyArray, PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use warpknit::drape::swatch_panel;
use warpknit::export::glb::GlbOptions;
use warpknit::export::npz::NpzOptions;
use warpknit::export::{Axes, Format, default_section, png};
use warpknit::pipeline::{self, Clock, PictureSettings, RunError, Settings, Source, Textures};
use warpknit::render::scene::{Scene, ScenePoint, Shape};
use warpknit::yarn::tube::{MAX_ST, SR, Section, Tubes};
use warpknit::{fabric, garment};

use crate::error;
use crate::laid::{LaidArrays, index64};
use crate::names;
use crate::picture::{self, Keywords};
use crate::work::awaited;

/// Memory of tubes: places, normals and texture coordinates of a vertex, and a triangle's corners.
const VERTEX_BYTES: f64 = 32.0;
const TRIANGLE_BYTES: f64 = 12.0;

/// What yarns were laid on.
#[derive(Clone)]
pub(crate) enum Origin {
    /// A garment, as it was read.
    Garment(Arc<garment::Garment>),
    /// A flat piece of so many wales and courses.
    Swatch([u32; 2]),
}

/// The yarns of a cloth. `points` has a row for each point, and `offsets` says where strands begin:
/// strand i is points[offsets[i]:offsets[i + 1]]. A strand is an uninterrupted run of yarn.
///
/// Arrays are made once and can't be written to: yarns.points is yarns.points.
#[pyclass(frozen, module = "warpknit")]
pub(crate) struct Yarns {
    origin: Origin,
    /// The fabric at the chosen densities, and as it is drawn.
    fabric: fabric::Fabric,
    shown: fabric::Fabric,
    settings: Settings,
    source: Source,
    points: Py<PyArray<f64, numpy::Ix2>>,
    normals: Py<PyArray<f64, numpy::Ix2>>,
    flat: Py<PyArray<f64, numpy::Ix2>>,
    course: Py<PyArray1<i32>>,
    wale: Py<PyArray1<i32>>,
    offsets: Py<PyArray1<i64>>,
    yarn: Py<PyArray1<i32>>,
    panel: Py<PyArray1<i32>>,
    bar: Py<PyArray1<i32>>,
    radius: Py<PyArray1<f64>>,
    stitch_counts: Py<PyArray1<i64>>,
    strands: StrandLayout,
    report: OnceLock<String>,
}

/// What tubes and pictures need of the strands besides their points.
struct StrandLayout {
    offsets: Vec<usize>,
    bars: Vec<usize>,
    stitches: Vec<u32>,
    first_stitches: Vec<usize>,
}

impl StrandLayout {
    fn of(laid: &LaidArrays) -> Self {
        let numbers = |values: &[i32]| values.iter().map(|&value| unsigned(value.into())).collect();
        Self {
            offsets: laid.offsets.iter().map(|&offset| unsigned(offset)).collect(),
            bars: numbers(&laid.bar),
            stitches: laid.stitches.clone(),
            first_stitches: laid.first_stitches.clone(),
        }
    }

    fn len(&self) -> usize {
        self.bars.len()
    }

    fn points(&self, strand: usize) -> std::ops::Range<usize> {
        self.offsets[strand]..self.offsets[strand + 1]
    }

    /// The first point of each stitch of a strand, from its first.
    fn stitches(&self, strand: usize) -> &[u32] {
        &self.stitches[self.first_stitches[strand]..self.first_stitches[strand + 1]]
    }

    /// The stitches of a strand as ranges of its points that share their ends.
    fn pieces(&self, strand: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        let (firsts, last) = (self.stitches(strand), self.points(strand).len() - 1);
        firsts.iter().enumerate().map(move |(at, &first)| {
            let next = firsts.get(at + 1).map_or(last, |&next| next as usize);
            first as usize..next + 1
        })
    }
}

/// A number that was an index.
fn unsigned(number: i64) -> usize {
    usize::try_from(number).unwrap_or(0)
}

/// A numpy array over the memory of a vector, which can't be written to.
fn column<T: numpy::Element>(py: Python<'_>, values: Vec<T>) -> PyResult<Py<PyArray1<T>>> {
    Ok(frozen(py, values)?.unbind())
}

/// The same with `width` columns.
fn rows<T: numpy::Element>(
    py: Python<'_>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Py<PyArray<T, numpy::Ix2>>> {
    let height = values.len() / width;
    Ok(frozen(py, values)?.reshape([height, width])?.unbind())
}

/// An array over the memory of a vector, of `width` columns, that may be written to.
fn table<T: numpy::Element>(
    py: Python<'_>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Bound<'_, PyArray<T, numpy::Ix2>>> {
    let height = values.len() / width;
    values.into_pyarray(py).reshape([height, width])
}

/// An array that can't be made writeable, nor its views: numpy refuses that where the memory is not
/// numpy's and no array before it is writeable.
fn frozen<T: numpy::Element>(py: Python<'_>, values: Vec<T>) -> PyResult<Bound<'_, PyArray1<T>>> {
    let array = values.into_pyarray(py);
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array)
}

impl Yarns {
    pub(crate) fn new(
        py: Python<'_>,
        origin: Origin,
        (fabric, shown): (fabric::Fabric, fabric::Fabric),
        settings: Settings,
        source: Source,
        laid: LaidArrays,
    ) -> PyResult<Self> {
        let radii: Vec<_> = shown.thickness().iter().map(|share| share * shown.radius()).collect();
        let strands = StrandLayout::of(&laid);
        let radius = strands.bars.iter().map(|&bar| radii[bar]).collect();
        let counts = laid.first_stitches.windows(2).map(|pair| index64(pair[1] - pair[0]));
        let counts = counts.collect();
        Ok(Self {
            origin,
            fabric,
            shown,
            settings,
            source,
            points: rows(py, laid.points, 3)?,
            normals: rows(py, laid.normals, 3)?,
            flat: rows(py, laid.flat, 3)?,
            course: column(py, laid.course)?,
            wale: column(py, laid.wale)?,
            offsets: column(py, laid.offsets)?,
            yarn: column(py, laid.yarn)?,
            panel: column(py, laid.panel)?,
            bar: column(py, laid.bar)?,
            radius: column(py, radius)?,
            stitch_counts: column(py, counts)?,
            strands,
            report: OnceLock::new(),
        })
    }

    /// The place from which tubes and pictures count.
    fn start(&self) -> DVec3 {
        match &self.origin {
            Origin::Garment(garment) => garment.summary.origin,
            Origin::Swatch(_) => DVec3::ZERO,
        }
    }

    /// Makes files in a run of its own.
    fn write(&self, outputs: Vec<(PathBuf, Format)>, settings: &Settings) -> Result<(), RunError> {
        let settings = Settings { outputs, ..settings.clone() };
        let clock = Clock::start(&());
        match &self.origin {
            Origin::Swatch(size) => {
                pipeline::swatch(*size, &self.fabric, &self.source, &settings, clock)?;
            }
            Origin::Garment(garment) => {
                let garment = garment::Garment::clone(garment);
                pipeline::drape(garment, None, &self.fabric, &self.source, &settings, clock)?;
            }
        }
        Ok(())
    }

    /// The yarns as a scene.
    fn scene(&self, points: &[DVec3], normals: &[DVec3], shape: Shape) -> Result<Scene, RunError> {
        let textures = Textures::read(None, &self.shown)?;
        let mut scene = pipeline::scene(shape, &self.shown, self.shown.radius(), &textures);
        let start = self.start();
        for strand in 0..self.strands.len() {
            let range = self.strands.points(strand);
            // A fabric has at most a hundred bars.
            let look = u16::try_from(self.strands.bars[strand]).unwrap_or(0);
            let points = range.map(|point| ScenePoint {
                position: (points[point] - start).as_vec3(),
                normal: normals[point].as_vec3(),
                flatten: 1.0,
            });
            scene.push_stitches(points, self.strands.stitches(strand).iter().copied(), look);
        }
        Ok(scene)
    }

    /// A picture, which Ctrl-C ends.
    fn picture(&self, py: Python<'_>, picture: PictureSettings) -> PyResult<RgbaImage> {
        let (points, normals) = (self.points.bind(py).readonly(), self.normals.bind(py).readonly());
        let (points, normals) = (vectors(&points)?, vectors(&normals)?);
        let scene = py.detach(|| self.scene(points, normals, picture.shape));
        let scene = scene.map_err(|error| error::of_run(&error))?;
        let (origin, fabric) = (self.origin.clone(), self.shown.clone());
        awaited(py, None, move |watch| {
            let (is_swatch, garment) = match origin {
                Origin::Garment(garment) => (false, garment),
                Origin::Swatch([wales, courses]) => {
                    (true, Arc::new(swatch_panel(&fabric, wales, courses)))
                }
            };
            Ok(picture::draw(&scene, picture, (&garment, &fabric), is_swatch, watch.unwanted())?)
        })
    }
}

/// The rows of an array that Rust made.
fn vectors<'a>(array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [DVec3]> {
    Ok(bytemuck::cast_slice(array.as_slice()?))
}

/// A whole number within its range, or an error in words of Python.
pub(crate) fn whole(name: &str, number: i64, range: &RangeInclusive<u32>) -> PyResult<u32> {
    let within = u32::try_from(number).ok().filter(|number| range.contains(number));
    within.ok_or_else(|| {
        let (least, most) = (range.start(), range.end());
        PyValueError::new_err(format!("{name} is {number}, but must be between {least} and {most}"))
    })
}

#[pymethods]
impl Yarns {
    /// (n, 3) float64: data points on the body, mm, in the axes of the garment's file.
    #[getter]
    fn points(&self, py: Python<'_>) -> Py<PyArray<f64, numpy::Ix2>> {
        self.points.clone_ref(py)
    }

    /// (n, 3) float64: unit normals of the cloth at each point, out of its technical face.
    #[getter]
    fn normals(&self, py: Python<'_>) -> Py<PyArray<f64, numpy::Ix2>> {
        self.normals.clone_ref(py)
    }

    /// (n, 3) float64: the points on their flat panel, mm: across the wales, along them, and out of
    /// the technical face.
    #[getter]
    fn flat(&self, py: Python<'_>) -> Py<PyArray<f64, numpy::Ix2>> {
        self.flat.clone_ref(py)
    }

    /// (n,) int32: the course of each point, counted from the panel's lowest.
    #[getter]
    fn course(&self, py: Python<'_>) -> Py<PyArray1<i32>> {
        self.course.clone_ref(py)
    }

    /// (n,) int32: the wale of each point, counted from the panel's leftmost.
    #[getter]
    fn wale(&self, py: Python<'_>) -> Py<PyArray1<i32>> {
        self.wale.clone_ref(py)
    }

    /// (s + 1,) int64: the first point of each strand, and n at the end.
    #[getter]
    fn offsets(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.offsets.clone_ref(py)
    }

    /// (s,) int32: the yarn of each strand, from 0.
    #[getter]
    fn yarn(&self, py: Python<'_>) -> Py<PyArray1<i32>> {
        self.yarn.clone_ref(py)
    }

    /// (s,) int32: the panel of each strand, from 0.
    #[getter]
    fn panel(&self, py: Python<'_>) -> Py<PyArray1<i32>> {
        self.panel.clone_ref(py)
    }

    /// (s,) int32: the bar of each strand, from 0, front first.
    #[getter]
    fn bar(&self, py: Python<'_>) -> Py<PyArray1<i32>> {
        self.bar.clone_ref(py)
    }

    /// (s,) float64: the radius of each strand as it is drawn, mm.
    #[getter]
    fn radius(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.radius.clone_ref(py)
    }

    /// (s,) int64: stitches and parts of stitches of each strand. Its tube in `to_mesh` has
    /// (st * stitches + 1) * (sr + 1) vertices.
    #[getter]
    fn stitch_counts(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.stitch_counts.clone_ref(py)
    }

    /// (3,) floats: the place from which the vertices of `to_mesh` count, mm. It is zero unless the
    /// garment lies over 10 m from the origin of its file.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.start().to_array()
    }

    /// The fabric as it is drawn.
    #[getter]
    fn fabric(&self) -> crate::fabric::Fabric {
        crate::fabric::Fabric { fabric: self.shown.clone() }
    }

    /// Number of stitches and parts of stitches.
    #[getter]
    fn stitches(&self) -> usize {
        self.strands.stitches.len()
    }

    /// The yarns as tubes: (v, f, n, uv), the arrays of a triangle mesh.
    ///
    /// v: (k, 3) float32, mm. f: (t, 3) uint32, counter-clockwise from outside. n: (k, 3) float32, unit
    /// normals. uv: (k, 2) float32, around the yarn 0..1 and along it in mm.
    ///
    /// st: segments along each stitch. sr: edges around. flatten: width over height of the section.
    /// caps: whether ends are closed.
    ///
    /// Raises MemoryError where the arrays don't fit.
    #[pyo3(signature = (st=10, sr=6, *, flatten=1.0, caps=false))]
    fn to_mesh<'py>(
        &self,
        py: Python<'py>,
        st: i64,
        sr: i64,
        flatten: f64,
        caps: bool,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let (st, sr) = (whole("st", st, &(1..=MAX_ST))?, whole("sr", sr, &SR)?);
        if !(0.1..=10.0).contains(&flatten) {
            let text = format!("flatten is {flatten}, but must be between 0.1 and 10");
            return Err(PyValueError::new_err(text));
        }
        let base = Section { st, sr, flatten, caps, ..default_section(self.shown.radius()) };
        let (vertices, triangles) = base.size_of(self.strands.stitches.len(), self.strands.len());
        if u32::try_from(vertices).is_err() {
            let text = format!("{vertices} vertices are over the 2^32 of an index: lower st or sr");
            return Err(PyValueError::new_err(text));
        }
        #[expect(clippy::cast_precision_loss, reason = "an estimate of two digits")]
        let needed = (VERTEX_BYTES * vertices as f64 + TRIANGLE_BYTES * triangles as f64) / 1e9;
        let stitches = self.strands.stitches.len() as u64;
        pipeline::check_memory("a mesh of tubes", stitches, needed, "lower st or sr")
            .map_err(|error| error::of_run(&error))?;
        let thickness = self.shown.thickness();
        let (points, normals) = (self.points.bind(py).readonly(), self.normals.bind(py).readonly());
        let (points, normals) = (vectors(&points)?, vectors(&normals)?);
        let start = self.start();
        let tubes = py.detach(|| {
            let mut tubes = Tubes::default();
            tubes.reserve(self.strands.stitches.len(), self.strands.len(), &base);
            let mut near = Vec::new();
            for strand in 0..self.strands.len() {
                let range = self.strands.points(strand);
                near.clear();
                near.extend(points[range.clone()].iter().map(|place| *place - start));
                let radius = base.radius * thickness[self.strands.bars[strand]];
                let section = Section { radius, ..base };
                tubes.add(&near, &normals[range], self.strands.pieces(strand), &section);
            }
            tubes
        });
        let arrays = (
            table::<f32>(py, bytemuck::cast_vec(tubes.positions), 3)?,
            table::<u32>(py, bytemuck::cast_vec(tubes.triangles), 3)?,
            table::<f32>(py, bytemuck::cast_vec(tubes.normals), 3)?,
            table::<f32>(py, bytemuck::cast_vec(tubes.uvs), 2)?,
        );
        arrays.into_pyobject(py)
    }

    /// A picture: (height, width, 4) uint8, sRGB with straight alpha. The CPU draws it.
    ///
    /// size: width and height, pixels. view: "front", "back", "left", "right", "top" or "iso".
    /// zoom: magnifies the middle. background: "white", "#rrggbb" or "transparent". spp: samples for
    /// each pixel. shape: "tube" or "ribbon".
    ///
    /// studio: whether floor and wall are around the yarns; by default around a garment, unless there is
    /// a background or an environment. body: a mesh file of an opaque body in the garment.
    /// body_cloth: whether an opaque lining, made from the garment, is its body. sun: degrees to
    /// the right of the camera, and up. environment: a .hdr or .exr of everything around, which lights the
    /// yarns, and is seen behind them unless there is a background. environment_turn: turns it around the
    /// vertical, degrees, counter-clockwise as seen from above.
    #[pyo3(signature = (size=(800, 600), view="front", *, zoom=1.0, background=None, spp=4,
                        shape="tube", studio=None, body=None, body_cloth=false, sun=None,
                        environment=None, environment_turn=0.0),
           text_signature = "($self, size=(800, 600), view='front', *, zoom=1.0, background=None, \
                             spp=4, shape='tube', studio=None, body=None, body_cloth=False, \
                             sun=None, environment=None, environment_turn=0.0)")]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn render(
        &self,
        py: Python<'_>,
        size: (i64, i64),
        view: &str,
        zoom: f64,
        background: Option<&str>,
        spp: i64,
        shape: &str,
        studio: Option<bool>,
        body: Option<PathBuf>,
        body_cloth: bool,
        sun: Option<[f64; 2]>,
        environment: Option<PathBuf>,
        environment_turn: f64,
    ) -> PyResult<Py<PyAny>> {
        if matches!(self.origin, Origin::Swatch(_)) && (body.is_some() || body_cloth) {
            return Err(PyValueError::new_err(
                "a swatch has no body: body and body_cloth need a drape",
            ));
        }
        let keywords = Keywords {
            size,
            view,
            zoom,
            background,
            spp,
            shape,
            studio,
            body,
            body_cloth,
            sun,
            environment,
            environment_turn,
        };
        let settings = keywords.settings(py)?;
        let (width, height) = settings.size;
        let pixels = self.picture(py, settings)?.into_raw().into_pyarray(py);
        pixels.reshape([height as usize, width as usize, 4])?.into_py_any(py)
    }

    /// Writes files, one for each path. The ending says what is written: every ending that the
    /// command's -o knows.
    ///
    /// st, sr: segments along each stitch of a tube, and edges around. curves: an .obj has centre lines.
    /// size, view: of pictures, as of `render`. file_unit, up: "mm", "cm" or "m", and "y" or "z", of .ply
    /// and .obj. usd_curves: "bezier", or "linear" with physics. inp: "calculix" or "abaqus".
    /// glb_precision, nodes: "u16" or "f32", and "bar" or "yarn". glb_meshopt: whether it is compressed.
    /// npz_precision, npz_compress: "f64" or "f32", and whether arrays are compressed.
    ///
    /// The files are those of the command, byte for byte, and appear only when all of them are whole.
    /// To write them, the cloth is knitted again.
    #[pyo3(signature = (*paths, st=None, sr=None, flatten=None, caps=false, curves=false,
                        size=(1600, 1200), view="front", file_unit="mm", up="y",
                        usd_curves="bezier", inp="calculix", glb_precision="u16", nodes="bar",
                        glb_meshopt=false, npz_precision="f64", npz_compress=false),
           text_signature = "($self, *paths, st=None, sr=None, flatten=None, caps=False, \
                             curves=False, size=(1600, 1200), view='front', file_unit='mm', \
                             up='y', usd_curves='bezier', inp='calculix', glb_precision='u16', \
                             nodes='bar', glb_meshopt=False, npz_precision='f64', \
                             npz_compress=False)")]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn save(
        &self,
        py: Python<'_>,
        paths: Vec<PathBuf>,
        st: Option<i64>,
        sr: Option<i64>,
        flatten: Option<f64>,
        caps: bool,
        curves: bool,
        size: (i64, i64),
        view: &str,
        file_unit: &str,
        up: &str,
        usd_curves: &str,
        inp: &str,
        glb_precision: &str,
        nodes: &str,
        glb_meshopt: bool,
        npz_precision: &str,
        npz_compress: bool,
    ) -> PyResult<()> {
        if paths.is_empty() {
            return Err(PyValueError::new_err("name a file, such as \"cloth.glb\""));
        }
        let st = st.map(|st| whole("st", st, &(1..=MAX_ST))).transpose()?;
        let sr = sr.map(|sr| whole("sr", sr, &SR)).transpose()?;
        let formats = paths.into_iter().map(|path| Ok((Format::from_path(&path)?, path)));
        let outputs = formats.map(|pair| pair.map(|(format, path)| (path, format)));
        let outputs = outputs.collect::<Result<Vec<_>, _>>();
        let outputs = outputs.map_err(|error| error::of_export(&error))?;
        let size = picture::size(size)?;
        let mut settings = Settings {
            st,
            sr,
            flatten,
            caps,
            centre_lines: curves,
            usd_curves: names::usd_curves(usd_curves)?,
            inp: names::inp(inp)?,
            axes: Axes { unit: names::file_unit(file_unit)?, up: names::up(up)? },
            glb: GlbOptions {
                precision: names::glb_precision(glb_precision)?,
                nodes: names::nodes(nodes)?,
                is_compressed: glb_meshopt,
            },
            npz: NpzOptions {
                is_single: names::npz_is_single(npz_precision)?,
                is_compressed: npz_compress,
            },
            ..self.settings.clone()
        };
        (settings.picture.size, settings.picture.view) = (size, names::view(view)?);
        let written = py.detach(|| self.write(outputs, &settings));
        written.map_err(|error| error::of_run(&error))
    }

    /// The report: a dict with the keys of a .json that the command writes. Counts, times, clearance,
    /// and under "cloth" mass in g/m², run-in and thickness.
    ///
    /// It is measured at the first call, which knits the cloth again.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = match self.report.get() {
            Some(text) => text,
            None => {
                let folder = tempfile::tempdir()?;
                let path = folder.path().join("report.json");
                let outputs = vec![(path.clone(), Format::Json)];
                let written = py.detach(|| self.write(outputs, &self.settings));
                written.map_err(|error| error::of_run(&error))?;
                let text = std::fs::read_to_string(path)?;
                self.report.get_or_init(|| text)
            }
        };
        py.import("json")?.call_method1("loads", (text,))
    }

    /// A picture of 800 x 600 pixels, for notebooks.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let settings = PictureSettings { size: (800, 600), ..PictureSettings::default() };
        let picture = self.picture(py, settings)?;
        let mut bytes = Vec::new();
        png::encode(&picture, &mut bytes)?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn __len__(&self) -> usize {
        self.strands.len()
    }

    fn __repr__(&self) -> String {
        let (strands, stitches) = (self.strands.len(), self.strands.stitches.len());
        let name = &self.shown.name;
        format!("<warpknit.Yarns of {name:?}: {strands} strands, {stitches} stitches>")
    }
}
