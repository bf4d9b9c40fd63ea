//! What reading found: numbers, notes and warnings, and how much of the cloth is lost.
//!
//! In: the pieces and panels of a garment. Out: its [`GarmentSummary`], or an error where too much
//! of it can't be knitted.

use std::path::Path;

use glam::DVec3;

use super::error::GarmentError;
use super::obj::ObjMesh;
use super::pair::triangle_faces;
use super::pieces::{Piece, Refusal, Refused};
use super::{MendedPairs, Panel};

/// Share of the draped area that may take no stitches without an error. A hole of that size is no
/// small defect of a mesh: the file isn't what the user takes it for.
pub const MOST_LOSS: f64 = 0.1;
/// Share of the draped area that may lie under other cloth of its panel without a warning. Sewing
/// patterns have a third of that at most.
const LITTLE_COVERED: f64 = 1e-3;

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
    /// Faces that were wound against their neighbours in both meshes, and have been turned round.
    pub reversed: usize,
    /// Triangles without flat area.
    pub degenerate: usize,
    /// Triangles wound against their panel.
    pub flipped: usize,
    /// Triangles with a corner that has no `vt`.
    pub untextured: usize,
    /// Pieces of the pattern that are no panels: they have no area, or they are not plane.
    pub refused: usize,
    /// The place in the file's axes from which draped coordinates count, mm: 0, or a place near a
    /// garment that is far away.
    pub origin: DVec3,
    /// Draped area of the whole garment, mm².
    pub draped_mm2: f64,
    /// Draped areas that take no stitches.
    pub loss: Loss,
    /// The summary of each panel, in the order of [`super::Garment::panels`].
    pub panels: Vec<PanelSummary>,
    /// Panels wound against those that they are sewn to.
    pub against_seams: Vec<usize>,
    /// Notes for the user, one line each: what was mended, and how.
    pub notes: Vec<String>,
    /// Warnings for the user, one line each.
    pub warnings: Vec<String>,
}

/// The summary of reading one panel.
#[derive(Clone, Debug, Default)]
pub struct PanelSummary {
    /// Length of one flat unit in this panel, mm.
    pub scale_mm: f64,
    /// Number of its triangles without flat area.
    pub degenerate: usize,
    /// The other sides of its folds: panels of the same piece of the pattern, which lies folded
    /// over itself.
    pub folds: Vec<usize>,
    /// The name that its faces have in the file, where panels have different ones.
    pub name: Option<String>,
}

/// Draped areas that take no stitches, by their reason, mm².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Of triangles wound against their panel.
    pub flipped: f64,
    /// Of triangles without flat area.
    pub degenerate: f64,
    /// Of triangles with a corner that has no `vt`.
    pub untextured: f64,
    /// Of pieces that are no panels.
    pub refused: f64,
    /// Of cloth that lies under other cloth of its own panel in the pattern. Reading leaves it 0;
    /// [`crate::locate::covered::count_covered`] finds it.
    pub covered: f64,
}

impl Loss {
    /// All of it, mm².
    #[must_use]
    pub fn total(self) -> f64 {
        self.flipped + self.degenerate + self.untextured + self.refused + self.covered
    }

    /// What to do about it, for messages.
    fn remedy(self) -> String {
        let export = if self.untextured > 0.0 {
            "export it again with texture coordinates for all faces"
        } else {
            "export it again"
        };
        let (how, sheet) = if self.flipped + self.degenerate + self.refused > 0.0 {
            ("flat and apart", "shows which lie flat, and marks the flipped and covered ones")
        } else if self.covered > 0.0 {
            ("apart", "marks them")
        } else {
            return export.to_owned();
        };
        format!(
            "lay these faces {how} in the pattern and {export} \
             (`warpknit inspect GARMENT -o sheet.svg` {sheet})"
        )
    }

    /// The reasons with their areas, in one line.
    fn reasons(self) -> String {
        let reasons = [
            (self.flipped, "flipped"),
            (self.degenerate, "without flat area"),
            (self.untextured, "without vt"),
            (self.refused, "in pieces that are left out"),
            (self.covered, "under other cloth of their panel in the pattern"),
        ];
        let named = reasons.iter().filter(|(area, _)| *area > 0.0);
        named
            .map(|(area, reason)| format!("{} {reason}", cm2(*area)))
            .collect::<Vec<_>>()
            .join(", ")
    }
}

/// An area in mm², in cm² with three digits or more.
fn cm2(area: f64) -> String {
    let area = area / 100.0;
    let decimals = if area >= 100.0 {
        0
    } else if area >= 1.0 {
        1
    } else {
        3
    };
    format!("{area:.decimals$} cm²")
}

impl GarmentSummary {
    /// Draped area that takes no stitches, % of the whole garment's.
    #[must_use]
    pub fn lost_percent(&self) -> f64 {
        let lost = self.loss.total();
        if lost > 0.0 { 100.0 * lost / self.draped_mm2 } else { 0.0 }
    }

    /// All notes for the user: what was mended, and the panels wound against those that they are sewn
    /// to.
    #[must_use]
    pub fn all_notes(&self) -> Vec<String> {
        let mut notes = self.notes.clone();
        if !self.against_seams.is_empty() {
            let panels: Vec<_> =
                self.against_seams.iter().map(|panel| format!("panel {panel}")).collect();
            notes.push(format!(
                "wound against the panels that they are sewn to: {}; their technical back shows where \
                 those show their face, as it should on a collar that folds over \
                 (`turn = true` in [[panels]] of a fabric file turns a panel over)",
                shortened(&panels)
            ));
        }
        notes
    }

    /// The summary of pairing and of the winding.
    pub(super) fn of_pairs(cloth: &mut MendedPairs) -> Self {
        let MendedPairs { pairs, reversed, .. } = cloth;
        let mut summary = Self {
            triangles: pairs.total,
            untextured: pairs.untextured,
            reversed: reversed.len(),
            warnings: std::mem::take(&mut pairs.warnings),
            ..Self::default()
        };
        if !reversed.is_empty() {
            summary.notes.push(format!(
                "{} of {} faces were wound against their neighbours and are turned round, \
                 first face {}",
                reversed.len(),
                pairs.polygon_ranges().count(),
                reversed[0] + 1
            ));
        }
        summary
    }

    /// The pieces that can hold stitches. The others are counted, and a warning names them.
    pub(super) fn usable_pieces(
        &mut self,
        cloth: &MendedPairs,
        pieces: Vec<Result<Piece, Refused>>,
        flat: &Path,
        unit_mm: f64,
        loss: &mut Loss,
    ) -> Result<Vec<Piece>, GarmentError> {
        let mut usable = Vec::new();
        let mut refusals = Vec::new();
        for piece in pieces {
            match piece {
                Ok(piece) => usable.push(piece),
                Err(Refused { reason, triangles }) => {
                    self.refused += 1;
                    loss.refused += cloth.areas.draped_sum(&triangles) * unit_mm * unit_mm;
                    let polygon = cloth.pairs.polygons[triangles[0] as usize];
                    if reason == Refusal::NoFlatArea {
                        self.degenerate += triangles.len();
                    }
                    refusals.push(format!(
                        "the piece of {} triangles at face {} {reason}",
                        triangles.len(),
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
            self.warnings.push(format!("left out: {}", shortened(&refusals)));
        }
        Ok(usable)
    }

    /// Adds a panel.
    pub(super) fn add_panel(&mut self, scale_mm: f64, degenerate: usize) {
        self.panels.push(PanelSummary { scale_mm, degenerate, ..PanelSummary::default() });
        self.degenerate += degenerate;
    }

    /// Names the panels by the objects, or else the groups, of their faces. A panel whose faces have
    /// several names has none, and no panel has one where all would have the same.
    pub(super) fn name_panels(&mut self, panels: &[Panel], flat: &ObjMesh) {
        if flat.names.is_empty() {
            return;
        }
        let faces = triangle_faces(flat);
        let name = |panel: &Panel| {
            let mut labels = panel.faces.iter().map(|face| {
                let face = &flat.faces[faces[face.0 as usize] as usize];
                flat.label(face)
            });
            let label = labels.next()?;
            let number = label.object.or(label.group)?;
            labels.all(|own| own == label).then(|| flat.names[number as usize].clone())
        };
        let names: Vec<_> = panels.iter().map(name).collect();
        if names.iter().any(|name| *name != names[0]) {
            for (panel, name) in self.panels.iter_mut().zip(names) {
                panel.name = name;
            }
        }
    }

    /// Notes which panels are sides of the same folded piece.
    pub(super) fn note_folds(&mut self, pieces: &[Piece]) {
        let mut sides: Vec<(u32, usize)> = pieces
            .iter()
            .zip(0..)
            .filter_map(|(piece, panel)| Some((piece.folded?, panel)))
            .collect();
        // Sides of one piece are together then, in the order of the panels.
        sides.sort_unstable();
        let mut folded = Vec::new();
        for sides in sides.chunk_by(|a, b| a.0 == b.0) {
            let panels: Vec<_> = sides.iter().map(|&(_, panel)| panel).collect();
            for &panel in &panels {
                self.panels[panel].folds =
                    panels.iter().copied().filter(|&other| other != panel).collect();
            }
            folded.push(panels.iter().map(usize::to_string).collect::<Vec<_>>().join(" and "));
        }
        if !folded.is_empty() {
            self.notes.push(format!(
                "the pattern is folded over itself, and each side of a fold is a panel: {}",
                shortened(&folded)
            ));
        }
    }

    /// Counts triangles that take no stitches, and warns of them.
    pub(super) fn count_defects(&mut self, panels: &[Panel]) {
        self.flipped = panels.iter().map(|panel| panel.flipped.len()).sum();
        if self.flipped > 0 {
            let mut places = Vec::new();
            for (i, panel) in
                panels.iter().enumerate().filter(|(_, panel)| !panel.flipped.is_empty())
            {
                places.push(format!("{} in panel {i}", panel.flipped.len()));
            }
            self.warnings.push(format!(
                "{} flat triangles are flipped against their panel and take no stitches: {}",
                self.flipped,
                shortened(&places)
            ));
        }
        if self.degenerate > 0 {
            self.warnings.push(format!(
                "{} triangles have no flat area and take no stitches",
                self.degenerate
            ));
        }
        // A sewing pattern has a few large pieces. An automatic unwrap (a texture atlas) has many small
        // ones, and a fabric laid out on each of them would look like patchwork. More than 8 pieces of
        // under 4 triangles each on average are taken for an atlas: no sewing pattern is that coarse.
        let usable: usize = panels.iter().map(|panel| panel.triangles.len()).sum();
        if panels.len() > 8 && usable < 4 * panels.len() {
            self.warnings.push(format!(
                "the pattern is in {} pieces of {:.1} triangles each: \
                 is it an atlas and not a sewing pattern?",
                panels.len(),
                usable as f64 / panels.len() as f64
            ));
        }
    }

    /// Warns of cloth that is lost, and refuses a garment that loses too much of it. `total` is the
    /// draped area of the whole garment, mm².
    pub(super) fn note_loss(
        &mut self,
        loss: Loss,
        total: f64,
        flat: &Path,
        allowed: bool,
    ) -> Result<(), GarmentError> {
        (self.draped_mm2, self.loss) = (total, loss);
        // Less is the rounding of triangles that have no area.
        if loss.total() <= 1e-9 * total {
            return Ok(());
        }
        self.check_loss(flat, allowed)?;
        self.warnings.push(format!("{}; {}", self.what_is_lost(), loss.remedy()));
        Ok(())
    }

    /// Counts cloth that lies under other cloth of its own panel as lost, mm² of draped area, warns
    /// of it, and refuses a garment that loses too much. `panel` is the first with such cloth.
    pub(crate) fn note_covered(
        &mut self,
        covered: f64,
        panel: usize,
        flat: &Path,
        allowed: bool,
    ) -> Result<(), GarmentError> {
        self.loss.covered = covered;
        self.check_loss(flat, allowed)?;
        if covered > LITTLE_COVERED * self.draped_mm2 {
            self.warnings.push(format!(
                "{} ({:.1} % of the draped area) lie under other cloth of their own panel in the \
                 pattern (first panel {panel}): stitches there go to one of the two places, and the \
                 other stays bare; lay them apart in the pattern (`warpknit inspect GARMENT -o \
                 sheet.svg` marks them)",
                cm2(covered),
                100.0 * covered / self.draped_mm2
            ));
        }
        Ok(())
    }

    /// How much of the cloth is lost, and why.
    fn what_is_lost(&self) -> String {
        format!(
            "{} ({:.3} % of the draped area) take no stitches: {}",
            cm2(self.loss.total()),
            self.lost_percent(),
            self.loss.reasons()
        )
    }

    /// Refuses a garment that loses too much of its cloth, unless that is allowed.
    fn check_loss(&self, flat: &Path, allowed: bool) -> Result<(), GarmentError> {
        if self.loss.total() > MOST_LOSS * self.draped_mm2 && !allowed {
            let (path, what) = (flat.to_path_buf(), self.what_is_lost());
            return Err(GarmentError::Loss { path, what, remedy: self.loss.remedy() });
        }
        Ok(())
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoFlatArea => f.write_str("has no flat area"),
            Self::NoDrapedArea => f.write_str("has no draped area"),
            Self::NotFlat(share) => write!(
                f,
                "leaves its plane by {:.1} % of its size (2 % is the most)",
                100.0 * share
            ),
        }
    }
}

/// A list on one line: its first eight entries, and the number of the others.
pub(super) fn shortened(entries: &[String]) -> String {
    let shown = entries.len().min(8);
    let more = entries.len() - shown;
    let list = entries[..shown].join(", ");
    if more > 0 { format!("{list} and {more} more") } else { list }
}
