//! The garment: panels whose flat triangles know their draped positions.
//!
//! In: one OBJ with `vt`, or a flat and a draped OBJ ([`read`]). Out: a [`Garment`] in millimetres,
//! each [`Panel`] in axes of its own.
//!
//! The steps: `obj` parses the text into a mesh, `pair` pairs flat and draped triangles, `panel`
//! finds the connected pieces and their planes, `unit` estimates units and scales. `error` has the
//! messages for everything that may be wrong with a file.
//!
//! Cost: nearly all of the time goes into parsing the text.
//!
//! Not promised: that flat and draped are the same cloth (only that their triangles pair), and that
//! the cloth doesn't intersect itself.

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, DVec2, DVec3};

use crate::ids::FaceId;

mod error;
mod frames;
mod memory;
mod obj;
mod order;
mod pair;
mod panel;
mod records;
mod rectangle;
pub mod stretch;
mod unit;

pub use error::{ArrayFault, GarmentError, GarmentFault};
pub use frames::Frames;
pub use unit::{Unit, UnknownUnit};

use obj::ObjMesh;
use pair::{FlatSource, Pairs};
use panel::{Piece, Refusal, Refused};

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
    /// The same vertices draped, mm.
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
}

/// All panels of a garment, with a summary of what reading found.
#[derive(Clone, Debug)]
pub struct Garment {
    /// Usable panels, in order of their lowest face.
    pub panels: Vec<Panel>,
    /// The summary of reading.
    pub summary: GarmentSummary,
}

/// The summary of reading a garment, for the report and for `inspect`.
#[derive(Clone, Debug, Default)]
pub struct GarmentSummary {
    /// Triangles in the file, usable or not.
    pub triangles: usize,
    /// Unit of the draped coordinates: mm, cm, dm, m, in.
    pub unit: &'static str,
    /// Whether the unit was guessed and not given by the user.
    pub unit_guessed: bool,
    /// Length of one flat unit for the whole garment, mm. Panels that differ from it are named in
    /// `warnings`.
    pub uv_scale_mm: f64,
    /// Triangles without flat area.
    pub degenerate: usize,
    /// Triangles wound against their panel.
    pub flipped: usize,
    /// Triangles with a corner that has no `vt`.
    pub untextured: usize,
    /// Pieces of the pattern that are no panels: they have no area, or they are not plane.
    pub refused: usize,
    /// The summary of each panel, in the order of [`Garment::panels`].
    pub panels: Vec<PanelSummary>,
    /// Warnings for the user, one line each.
    pub warnings: Vec<String>,
}

/// The summary of reading one panel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PanelSummary {
    /// Length of one flat unit in this panel, mm.
    pub scale_mm: f64,
    /// Number of its triangles without flat area.
    pub degenerate: usize,
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
        let mut triangles_at: HashMap<[u32; 2], u32> = HashMap::new();
        for &[a, b, c] in self.triangles.iter().chain(&self.flipped) {
            for [a, b] in [[a, b], [b, c], [c, a]] {
                *triangles_at.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        triangles_at.values().filter(|&&count| count > 2).count()
    }
}

impl Garment {
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

/// Reads a garment: `flat` and `draped`, or one file whose `vt` are the flat pattern.
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
    pairs: Pairs,
    pieces: Vec<Result<Piece, Refused>>,
}

impl<'a> GarmentFiles<'a> {
    fn read(
        path: &'a Path,
        draped_path: Option<&Path>,
        options: &ReadOptions,
    ) -> Result<Self, GarmentError> {
        check(options)?;
        let flat = obj::read(path)?;
        let draped = match draped_path {
            Some(draped_path) => Some((draped_path, obj::read(draped_path)?)),
            None => None,
        };
        Self::pair(path, flat, draped)
    }

    /// Pairs the triangles of one mesh with `vt`, or of a flat and a draped one.
    fn pair(
        path: &'a Path,
        flat: ObjMesh,
        draped: Option<(&Path, ObjMesh)>,
    ) -> Result<Self, GarmentError> {
        let Some((draped_path, draped_mesh)) = draped else {
            let pairs = pair::with_texture(&flat, path)?;
            let pieces = panel::pieces(&pairs);
            let pattern = FlatSource::Texture;
            return Ok(Self { path, flat, draped: None, pattern, pairs, pieces });
        };
        let paths = [path, draped_path];
        let mut pattern = FlatSource::Positions;
        let mut pairs = pair::two_files(&flat, &draped_mesh, paths, pattern)?;
        let mut pieces = panel::pieces(&pairs);
        let leaves_plane =
            pieces.iter().any(|piece| matches!(piece, Err((Refusal::NotFlat(_), _, _))));
        // Some tools export the garment at rest on the body as FLAT. Its positions are no pattern,
        // but its `vt` may be one.
        if leaves_plane && flat.is_textured() {
            pattern = FlatSource::Texture;
            pairs = pair::two_files(&flat, &draped_mesh, paths, pattern)?;
            pairs.warnings.push(format!(
                "{} does not lie flat: its vt are taken for the flat pattern",
                path.display()
            ));
            pieces = panel::pieces(&pairs);
        }
        Ok(Self { path, flat, draped: Some(draped_mesh), pattern, pairs, pieces })
    }

    /// The garment alone.
    fn into_garment(self, options: &ReadOptions) -> Result<Garment, GarmentError> {
        self.garment(options).map(|(garment, _, _)| garment)
    }

    /// The garment and the unit of its draped positions. The files are returned too, since the
    /// frames of a sequence are paired with them.
    fn garment(mut self, options: &ReadOptions) -> Result<(Garment, Unit, Self), GarmentError> {
        let mut summary = GarmentSummary {
            triangles: self.pairs.total,
            untextured: self.pairs.untextured,
            warnings: std::mem::take(&mut self.pairs.warnings),
            ..GarmentSummary::default()
        };
        let pairs = &self.pairs;
        let unit = choose_unit(pairs, options, &mut summary);
        let pieces = usable_pieces(std::mem::take(&mut self.pieces), self.path, &mut summary)?;
        let scales = estimate_scales(
            pairs,
            &pieces,
            unit,
            options,
            self.pattern == FlatSource::Positions,
            &mut summary,
        );
        let panels: Vec<Panel> = pieces
            .iter()
            .zip(scales)
            .map(|(piece, scale_mm)| {
                let (panel, degenerate) = piece.panel(pairs, scale_mm, unit.millimetres(), options);
                summary.panels.push(PanelSummary { scale_mm, degenerate });
                summary.degenerate += degenerate;
                panel
            })
            .collect();
        count_defects(&panels, &mut summary);
        Ok((Garment { panels, summary }, unit, self))
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

/// The unit of the draped mesh: the given one, or a guess from the size of the paired triangles.
fn choose_unit(pairs: &Pairs, options: &ReadOptions, summary: &mut GarmentSummary) -> Unit {
    // The largest dimension: a flat swatch has no thickness, and a scarf is narrow.
    let extent = pairs.draped_extent().max_element();
    let (guess, fits) = unit::guess(extent);
    let unit = options.unit.unwrap_or(guess);
    summary.unit = unit.name();
    summary.unit_guessed = options.unit.is_none();
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

/// The pieces that can hold stitches. The others are counted, and a warning names them.
fn usable_pieces(
    pieces: Vec<Result<Piece, Refused>>,
    flat: &Path,
    summary: &mut GarmentSummary,
) -> Result<Vec<Piece>, GarmentError> {
    let mut usable = Vec::new();
    let mut refusals = Vec::new();
    for piece in pieces {
        match piece {
            Ok(piece) => usable.push(piece),
            Err((refusal, triangles, polygon)) => {
                summary.refused += 1;
                let why = match refusal {
                    Refusal::NoFlatArea => {
                        summary.degenerate += triangles;
                        "has no flat area".to_owned()
                    }
                    Refusal::NoDrapedArea => "has no draped area".to_owned(),
                    Refusal::NotFlat(share) => {
                        format!(
                            "leaves its plane by {:.1} % of its size (2 % is the most)",
                            100.0 * share
                        )
                    }
                };
                refusals.push(format!(
                    "the piece of {triangles} triangles at face {} {why}",
                    polygon + 1
                ));
            }
        }
    }
    if usable.is_empty() {
        let reason = format!("{}: is this the flat pattern?", shortened(&refusals));
        return Err(GarmentError::NoPanel { path: flat.to_path_buf(), reason });
    }
    if !refusals.is_empty() {
        summary.warnings.push(format!("left out: {}", shortened(&refusals)));
    }
    Ok(usable)
}

/// The scale of each piece: mm per flat unit. `flat_file` tells whether the pattern is the
/// positions of a flat file, which have a unit, and not a `vt`, which has none.
fn estimate_scales(
    pairs: &Pairs,
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
        pieces.iter().map(|piece| piece.stretches(pairs, unit.millimetres())).collect();
    let own: Vec<f64> = all.iter_mut().map(|stretches| unit::scale(stretches)).collect();
    let scales = unit::choose_scales(unit::scale(&mut all.concat()), &own, flat_file);
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

/// Counts triangles that take no stitches, and warns of them.
fn count_defects(panels: &[Panel], summary: &mut GarmentSummary) {
    summary.flipped = panels.iter().map(|panel| panel.flipped.len()).sum();
    if summary.flipped > 0 {
        let mut places = Vec::new();
        for (i, panel) in panels.iter().enumerate().filter(|(_, panel)| !panel.flipped.is_empty()) {
            places.push(format!("{} in panel {i}", panel.flipped.len()));
        }
        summary.warnings.push(format!(
            "{} flat triangles are flipped against their panel and take no stitches: {}",
            summary.flipped,
            shortened(&places)
        ));
    }
    if summary.degenerate > 0 {
        summary.warnings.push(format!(
            "{} triangles have no flat area and take no stitches",
            summary.degenerate
        ));
    }
    // A sewing pattern has a few large pieces. An automatic unwrap (a texture atlas) has many small
    // ones, and a fabric laid out on each of them would look like patchwork. More than 8 pieces of
    // under 4 triangles each on average are taken for an atlas: no sewing pattern is that coarse.
    let usable: usize = panels.iter().map(|panel| panel.triangles.len()).sum();
    if panels.len() > 8 && usable < 4 * panels.len() {
        summary.warnings.push(format!(
            "the pattern is in {} pieces of {:.1} triangles each: \
             is it an atlas and not a sewing pattern?",
            panels.len(),
            usable as f64 / panels.len() as f64
        ));
    }
}

/// A list on one line: its first eight entries, and the number of the others.
fn shortened(entries: &[String]) -> String {
    let shown = entries.len().min(8);
    let more = entries.len() - shown;
    let list = entries[..shown].join(", ");
    if more > 0 { format!("{list} and {more} more") } else { list }
}
