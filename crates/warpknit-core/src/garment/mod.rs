//! The garment: panels whose flat triangles know their draped positions.
//!
//! In: one OBJ, glTF, USD or PLY with `vt`, or a flat and a draped one ([`read`]). Out: a
//! [`Garment`] in millimetres, each [`Panel`] in axes of its own.
//!
//! The steps: `file` has the reader of its kind parse a file into a mesh, `pair` pairs flat and draped
//! triangles, `winding` turns round the faces that are wound against their neighbours, `pieces` finds
//! the connected pieces and their planes, `unit` estimates units and scales, `panel` makes panels of
//! the pieces, and `summary` says what was found and lost. `error` has the messages for everything that
//! may be wrong with a file.
//!
//! Cost: linear in the triangles; docs/performance.md has figures.
//!
//! Not promised: that flat and draped are the same cloth (only that their triangles pair), and that
//! the cloth doesn't intersect itself.

use std::path::Path;

use glam::{DAffine3, DVec2, DVec3};
use rayon::prelude::*;

use crate::ids::FaceId;

mod error;
mod file;
mod frames;
mod garmentcode;
mod gltf;
mod json;
mod kind;
mod memory;
mod normals;
mod obj;
mod order;
mod pair;
mod panel;
mod pieces;
mod ply;
mod rectangle;
mod sets;
pub mod solid;
mod soup;
pub mod stretch;
mod summary;
mod unit;
mod usd;
mod vertices;
mod winding;

pub use error::{ArrayFault, GarmentError, GarmentFault};
pub use file::{file_of, moments};
pub use frames::Frames;
pub use summary::{GarmentSummary, Loss, MOST_LOSS, PanelSummary};
pub use unit::{Unit, UnknownUnit};

use obj::ObjMesh;
use pair::{FlatSource, Pairs};
use panel::PanelNumbers;
use pieces::{Areas, Piece, Refusal, Refused};
use summary::shortened;
use vertices::Vertices;

/// Distance from the origin from which on draped coordinates count from a local one, mm. There a
/// 32-bit float is exact to 0.5 µm. A smaller distance would move garments that need it not.
const FAR: f64 = 10_000.0;
/// Local origins are multiples of this, mm: eighths of a metre, which `.glb` holds exactly.
const ORIGIN_STEP: f64 = 125.0;

/// Options for reading a garment.
///
/// By default the unit and the scale are estimated, the wales run along the flat y axis, and the
/// technical face is on the side to which the draped triangles' winding points.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Unit of the draped coordinates. It is guessed from the garment's size if absent.
    pub unit: Option<Unit>,
    /// Length of one flat unit, mm. It is estimated from the areas if absent.
    pub uv_scale: Option<f64>,
    /// Angle by which the wale direction is turned in the panel's plane, radians, counter-clockwise
    /// as seen from the technical face.
    pub grain: f64,
    /// Puts the technical face on the other side of the cloth.
    pub turn: bool,
    /// Accepts a garment of which over [`MOST_LOSS`] can't be knitted.
    pub allow_loss: bool,
}

/// A panel: one connected piece of the flat pattern, with its draped positions.
///
/// Panel axes: `u` across the wales, to the right seen from the technical face; `v` along the
/// wales; `w` out of the technical face. Triangles are counter-clockwise in (u, v), and their
/// draped winding points out of the technical face.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Flat vertices in panel axes, mm.
    pub uv: Vec<DVec2>,
    /// The same vertices draped, mm from [`GarmentSummary::origin`].
    pub draped: Vec<DVec3>,
    /// Unit draped vertex normals, angle-weighted over the triangles of this panel only (split at
    /// panel borders).
    pub normals: Vec<DVec3>,
    /// Triangles that can hold stitches. Neighbours on the panel are near each other in this array
    /// (see [`Panel::order_along_curve`]).
    pub triangles: Vec<[u32; 3]>,
    /// The face in the file of each triangle.
    pub faces: Vec<FaceId>,
    /// Triangles wound against their panel. They hold no stitches; data points that lie in them are
    /// counted as losses.
    pub flipped: Vec<[u32; 3]>,
    /// Transform from panel axes (u, v, depth) to the flat mesh's own axes, both in mm.
    pub flat_from_panel: DAffine3,
    /// Whether the flat piece lies mirrored (clockwise) in its own plane.
    pub mirrored: bool,
    /// The panel behind which it lies, if it is cloth that a finished edge turns in
    /// ([`crate::edges`]). `None` for a panel of the file.
    pub turned_in: Option<usize>,
}

/// All panels of a garment, with a summary of what reading found.
#[derive(Clone, Debug)]
pub struct Garment {
    /// Usable panels, in order of their lowest face.
    pub panels: Vec<Panel>,
    /// The summary of reading.
    pub summary: GarmentSummary,
}

impl Panel {
    /// Flat area that can hold stitches, mm².
    #[must_use]
    pub fn area(&self) -> f64 {
        let twice: f64 = self
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|vertex| self.uv[vertex as usize]);
                (b - a).perp_dot(c - a)
            })
            .sum();
        0.5 * twice
    }

    /// Size of the flat bounding box along u and v, mm.
    #[must_use]
    pub fn size(&self) -> DVec2 {
        let [low, high] = self.bounds();
        high - low
    }

    /// The lowest-left and the highest-right corner of its bounding box in panel axes, mm.
    #[must_use]
    pub fn bounds(&self) -> [DVec2; 2] {
        let uv = self.uv.iter().copied();
        [uv.clone().fold(DVec2::INFINITY, DVec2::min), uv.fold(DVec2::NEG_INFINITY, DVec2::max)]
    }

    /// Number of edges with more than two triangles, including flipped triangles.
    #[must_use]
    pub fn non_manifold_edges(&self) -> usize {
        // An edge is named by its smaller vertex first, so that both directions are the same edge.
        // Sorting brings equal edges together; for millions of them it is faster than hashing.
        let triangles = self.triangles.iter().chain(&self.flipped);
        let sides = triangles.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.par_sort_unstable();
        edges.chunk_by(|a, b| a == b).filter(|equal| equal.len() > 2).count()
    }
}

impl Garment {
    /// Turns one panel over, in addition to [`ReadOptions::turn`]: its technical face is on the other
    /// side then, and its wales keep their direction. Its winding is what is wanted then, so it leaves
    /// [`GarmentSummary::against_seams`]. A panel that doesn't exist is no error here;
    /// laying out the fabric reports it.
    ///
    /// ```
    /// use warpknit_core::garment::Garment;
    /// let mut garment = Garment::rectangle(100.0, 40.0);
    /// garment.turn_over(0);
    /// assert_eq!(garment.panels[0].normals[0], -glam::DVec3::Z);
    /// ```
    pub fn turn_over(&mut self, panel: usize) {
        if let Some(turned) = self.panels.get_mut(panel) {
            turned.turn_over();
            self.summary.against_seams.retain(|&against| against != panel);
        }
    }

    /// Turns the wale direction of one panel, in addition to [`ReadOptions::grain`]. The angle is
    /// in radians, counter-clockwise as seen from the technical face. A panel that doesn't exist is
    /// no error here; laying out the fabric reports it.
    ///
    /// ```
    /// use warpknit_core::garment::Garment;
    /// let mut garment = Garment::rectangle(100.0, 40.0);
    /// garment.turn_grain(0, std::f64::consts::FRAC_PI_2);
    /// assert!((garment.panels[0].size().x - 40.0).abs() < 1e-9);
    /// ```
    pub fn turn_grain(&mut self, panel: usize, grain: f64) {
        let Some(turned) = self.panels.get_mut(panel) else { return };
        let lost = turned.turn_grain(grain);
        self.summary.degenerate += lost;
        if let Some(summary) = self.summary.panels.get_mut(panel) {
            summary.degenerate += lost;
        }
    }
}

/// Reads a garment: `flat` and `draped`, or one file whose `vt` are the flat pattern. `flat` may be the
/// JSON of a pattern that GarmentCode made, and `draped` its OBJ.
///
/// # Errors
/// [`GarmentError`]: a single line that names the file, the line in it where there is one, and what
/// to do. No input causes a panic.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use warpknit_core::garment::{ReadOptions, read};
/// let path = tempfile::NamedTempFile::new()?;
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")?;
/// let garment = read(path.path(), None, &ReadOptions::default())?;
/// assert_eq!(garment.summary.unit, "m");
/// assert!((garment.panels[0].area() - 500_000.0).abs() < 1e-6);
/// # Ok(())
/// # }
/// ```
pub fn read(
    flat: &Path,
    draped: Option<&Path>,
    options: &ReadOptions,
) -> Result<Garment, GarmentError> {
    GarmentFiles::read(flat, draped, options)?.into_garment(options)
}

/// The files of a garment, paired.
struct GarmentFiles<'a> {
    path: &'a Path,
    flat: ObjMesh,
    /// The draped file, if there are two files.
    draped: Option<ObjMesh>,
    pattern: FlatSource,
    /// Length of a unit of the flat pattern, mm, where a file says it.
    flat_unit_mm: Option<f64>,
    cloth: MendedPairs,
}

/// The paired triangles, their winding mended, and their pieces.
struct MendedPairs {
    pairs: Pairs,
    vertices: Vertices,
    areas: Areas,
    /// The polygons whose winding was mended, in ascending order.
    reversed: Vec<u32>,
    /// Whether no draped triangle is known to be wound against its neighbours, over seams too.
    draped_agree: bool,
    pieces: Vec<Result<Piece, Refused>>,
}

impl MendedPairs {
    fn new(mut pairs: Pairs) -> Self {
        let mut vertices = Vertices::new(&pairs);
        let agree = || {
            // Without seams the draped mesh is numbered as the pattern.
            pairs.draped_triangles == vertices.triangles
                || winding::all_agree(&pairs.draped_triangles, pairs.draped.len())
        };
        let (reversed, draped_agree) = rayon::join(|| winding::reversed(&pairs, &vertices), agree);
        let draped_agree = draped_agree && reversed.is_empty();
        winding::reverse(&mut pairs, Some(&mut vertices), &reversed);
        let areas = Areas::new(&pairs);
        let pieces = pieces::pieces(&pairs, &vertices, &areas);
        Self { pairs, vertices, areas, reversed, draped_agree, pieces }
    }
}

impl<'a> GarmentFiles<'a> {
    fn read(
        path: &'a Path,
        draped_path: Option<&'a Path>,
        options: &ReadOptions,
    ) -> Result<Self, GarmentError> {
        check(options)?;
        let Some(draped_path) = draped_path else {
            return Self::pair(path, file::read(path)?, None);
        };
        if let Some(pattern) = file::pattern(path)? {
            let wrong = |what| GarmentError::Mesh { path: draped_path.to_path_buf(), what };
            let mesh = pattern.fit(file::read(draped_path)?).map_err(wrong)?;
            let files = Self::pair(draped_path, mesh, None)?;
            return Ok(Self { flat_unit_mm: Some(1.0), ..files });
        }
        let (flat, draped) = rayon::join(|| file::read(path), || file::read(draped_path));
        Self::pair(path, flat?, Some((draped_path, draped?)))
    }

    /// Pairs the triangles of one mesh with `vt`, or of a flat and a draped one.
    fn pair(
        path: &'a Path,
        flat: ObjMesh,
        draped: Option<(&Path, ObjMesh)>,
    ) -> Result<Self, GarmentError> {
        let Some((draped_path, draped_mesh)) = draped else {
            let cloth = MendedPairs::new(pair::with_texture(&flat, path)?);
            let pattern = FlatSource::Texture;
            return Ok(Self { path, flat, draped: None, pattern, flat_unit_mm: None, cloth });
        };
        let paths = [path, draped_path];
        let mut pattern = FlatSource::Positions;
        let mut cloth = MendedPairs::new(pair::two_files(&flat, &draped_mesh, paths, pattern)?);
        let leaves_plane = cloth
            .pieces
            .iter()
            .any(|piece| matches!(piece, Err(Refused { reason: Refusal::NotFlat(_), .. })));
        // Some tools export the garment at rest on the body as FLAT. Its positions are no pattern,
        // but its `vt` may be one.
        if leaves_plane && flat.is_textured() {
            pattern = FlatSource::Texture;
            let mut pairs = pair::two_files(&flat, &draped_mesh, paths, pattern)?;
            pairs.warnings.push(format!(
                "{} does not lie flat: its vt are taken for the flat pattern",
                path.display()
            ));
            cloth = MendedPairs::new(pairs);
        }
        Ok(Self { path, flat, draped: Some(draped_mesh), pattern, flat_unit_mm: None, cloth })
    }

    /// The garment alone.
    fn into_garment(self, options: &ReadOptions) -> Result<Garment, GarmentError> {
        self.garment(options).map(|(garment, _, _)| garment)
    }

    /// The garment and the unit of its draped positions. The files are returned too, since the
    /// frames of a sequence are paired with them.
    fn garment(mut self, options: &ReadOptions) -> Result<(Garment, Unit, Self), GarmentError> {
        let uv_scale = options.uv_scale.or(self.flat_unit_mm);
        let options = &ReadOptions { uv_scale, ..options.clone() };
        let mut summary = GarmentSummary::of_pairs(&mut self.cloth);
        let pieces = std::mem::take(&mut self.cloth.pieces);
        let MendedPairs { pairs, vertices, areas, .. } = &self.cloth;
        let said = self.draped.as_ref().unwrap_or(&self.flat).unit;
        let unit = choose_unit(pairs, options, said, &mut summary);
        let unit_mm = unit.millimetres();
        let mut loss =
            Loss { untextured: pairs.untextured_area * unit_mm * unit_mm, ..Loss::default() };
        let pieces = summary.usable_pieces(&self.cloth, pieces, self.path, unit_mm, &mut loss)?;
        let flat_file = self.pattern == FlatSource::Positions;
        let scales = estimate_scales(areas, &pieces, unit, options, flat_file, &mut summary);
        let mut numbers = PanelNumbers::new(vertices);
        let mut panels: Vec<Panel> = pieces
            .iter()
            .zip(scales)
            .map(|(piece, scale_mm)| {
                let (panel, left) =
                    piece.panel(pairs, (vertices, &mut numbers), scale_mm, unit_mm, options);
                summary.add_panel(scale_mm, left.degenerate);
                loss.degenerate += left.degenerate_area;
                loss.flipped += left.flipped_area;
                panel
            })
            .collect();
        summary.origin = local_origin(&panels);
        for point in panels.iter_mut().flat_map(|panel| &mut panel.draped) {
            *point -= summary.origin;
        }
        summary.note_folds(&pieces);
        if !self.cloth.draped_agree {
            summary.against_seams = winding::against_seams(pairs, &pieces);
        }
        summary.name_panels(&panels, &self.flat);
        summary.count_defects(&panels);
        let total = (areas.draped_total() + pairs.untextured_area) * unit_mm * unit_mm;
        summary.note_loss(loss, total, self.path, options.allow_loss)?;
        Ok((Garment { panels, summary }, unit, self))
    }
}

/// The origin of draped coordinates: that of the file, unless the garment is far from it. Pictures
/// and most files hold 32-bit floats, which are as exact as a yarn needs only near their origin.
fn local_origin(panels: &[Panel]) -> DVec3 {
    let points = panels.iter().flat_map(|panel| &panel.draped);
    let [low, high] = points
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)]);
    let centre = 0.5 * (low + high);
    if centre.abs().max_element() > FAR {
        (centre / ORIGIN_STEP).round() * ORIGIN_STEP
    } else {
        DVec3::ZERO
    }
}

/// Refuses options out of their range.
fn check(options: &ReadOptions) -> Result<(), GarmentError> {
    if !options.grain.is_finite() {
        return Err(GarmentError::Option {
            option: "--grain",
            value: options.grain,
            must: "a finite angle",
        });
    }
    match options.uv_scale {
        Some(value) if !(1e-9..=1e9).contains(&value) => Err(GarmentError::Option {
            option: "--uv-scale",
            value,
            must: "between 1e-9 and 1e9 mm per flat unit",
        }),
        _ => Ok(()),
    }
}

/// The unit of the draped mesh: the given one, the one that its file says if garments have that
/// size, or a guess from the size of the paired triangles.
fn choose_unit(
    pairs: &Pairs,
    options: &ReadOptions,
    said: Option<Unit>,
    summary: &mut GarmentSummary,
) -> Unit {
    // The largest dimension: a flat swatch has no thickness, and a scarf is narrow.
    let extent = pairs.draped_extent().max_element();
    let (guess, fits) = match said.filter(|unit| unit::fits(extent, *unit)) {
        Some(unit) => (unit, true),
        None => unit::guess(extent),
    };
    let unit = options.unit.unwrap_or(guess);
    summary.unit = unit.name();
    summary.unit_guessed = options.unit.is_none() && said != Some(unit);
    if summary.unit_guessed && !fits {
        let (least, most) = unit::GARMENT_SIZE;
        summary.warnings.push(format!(
            "in no unit is the garment between {least} mm and {most} mm: \
             {unit} is taken, which makes it {:.4} mm; --unit says otherwise",
            extent * unit.millimetres()
        ));
    }
    unit
}

/// The scale of each piece: mm per flat unit. `flat_file` tells whether the pattern is the
/// positions of a flat file, which have a unit, and not a `vt`, which has none.
fn estimate_scales(
    areas: &Areas,
    pieces: &[Piece],
    unit: Unit,
    options: &ReadOptions,
    flat_file: bool,
    summary: &mut GarmentSummary,
) -> Vec<f64> {
    if let Some(scale) = options.uv_scale {
        summary.uv_scale_mm = scale;
        return vec![scale; pieces.len()];
    }
    // The garment's estimate is the median over all triangles and not over the panels' estimates,
    // so that small panels count little.
    let mut all: Vec<Vec<_>> =
        pieces.iter().map(|piece| piece.stretches(areas, unit.millimetres())).collect();
    let mut own: Vec<f64> = all.iter_mut().map(|stretches| unit::scale(stretches)).collect();
    // The sides of a fold were drawn as one piece, so they have one scale.
    for (i, piece) in pieces.iter().enumerate().filter(|(_, piece)| piece.folded.is_some()) {
        let sides = pieces.iter().zip(&all).filter(|(side, _)| side.folded == piece.folded);
        let mut together: Vec<_> = sides.flat_map(|(_, stretches)| stretches).copied().collect();
        own[i] = unit::scale(&mut together);
    }
    let whole = if let [only] = *own { only } else { unit::scale(&mut all.concat()) };
    let scales = unit::choose_scales(whole, &own, flat_file);
    summary.uv_scale_mm = scales.garment;
    if !scales.differing.is_empty() {
        let names: Vec<_> =
            scales.differing.iter().map(|&i| format!("panel {i} {:.4}", own[i])).collect();
        summary.warnings.push(format!(
            "panels differ in scale from the garment's {:.4} mm per flat unit \
             and take their own: {}; --uv-scale sets one for all",
            scales.garment,
            shortened(&names)
        ));
    }
    scales.panels
}
