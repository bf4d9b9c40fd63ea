//! Drape sequences: one garment, draped many times.
//!
//! In: a garment's first drape ([`Frames::read`]), then one file for each frame ([`Frames::pose`]).
//! Out: the garment with the frame's draped positions.
//!
//! Method: connectivity is constant in a sequence, so everything that was located on the flat
//! pattern stays valid. Of a frame with the connectivity of the first drape only the positions are
//! used. A frame whose vertices are numbered differently is paired with the flat pattern as the
//! first drape was.
//!
//! Cost: linear in the triangles, most of it for parsing the text.
//!
//! Not promised: that a frame shows the same cloth, only that its faces pair.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::file;
use super::normals::{cross, normals};
use super::obj::ObjMesh;
use super::pair::{FlatSource, LARGEST, Pairs, two_files};
use super::{Garment, GarmentError, GarmentFiles, MendedPairs, Panel, ReadOptions, Unit, winding};
use crate::ids::index32;

/// Ratio of a frame's size to the first one's, above which (or below whose inverse) the frame is
/// taken to be in another unit. Units are a factor of 2.5 or more apart, so the limit must be below
/// that. Cloth hardly stretches to twice its length in both directions, so it must not be much
/// lower.
const MAX_SIZE_RATIO: f64 = 2.0;
/// Marks a vertex of no triangle that can hold stitches. Such a vertex keeps its position.
const UNUSED: u32 = u32::MAX;

/// Reads further frames of a garment.
#[derive(Debug)]
pub struct Frames {
    path: PathBuf,
    flat: ObjMesh,
    pattern: FlatSource,
    /// Connectivity hash of the first drape ([`ObjMesh::connectivity`]).
    connectivity: u64,
    /// The flat file's faces whose winding was mended.
    reversed: Vec<u32>,
    /// For each vertex of each panel, a corner of a paired triangle: three times the triangle's
    /// index plus 0, 1 or 2.
    corners: Vec<Vec<u32>>,
    /// The same as vertex numbers in the first drape's file.
    vertices: Vec<Vec<u32>>,
    unit: Unit,
    /// Whether the user gave the unit.
    unit_given: bool,
    /// Size of the first drape, mm: the square root of its area.
    size: f64,
}

impl Frames {
    /// Reads a garment as [`super::read`] does, and prepares for further frames. Where there is no
    /// `first` file, the flat one is the first frame too.
    ///
    /// # Errors
    /// Those of [`super::read`].
    pub fn read(
        flat: &Path,
        first: Option<&Path>,
        options: &ReadOptions,
    ) -> Result<(Garment, Self), GarmentError> {
        let (garment, unit, files) = GarmentFiles::read(flat, first, options)?.garment(options)?;
        let GarmentFiles { path, flat, draped, pattern, cloth, .. } = files;
        let MendedPairs { pairs, reversed, .. } = cloth;
        let corners: Vec<_> =
            garment.panels.iter().map(|panel| corners(panel, &pairs, options.turn)).collect();
        let vertices = corners.iter().map(|corners| draped_vertices(corners, &pairs)).collect();
        let connectivity = draped.as_ref().unwrap_or(&flat).connectivity();
        let frames = Self {
            path: path.to_owned(),
            flat,
            pattern,
            connectivity,
            reversed,
            corners,
            vertices,
            unit,
            unit_given: options.unit.is_some(),
            size: size(
                garment.panels.iter().map(|panel| (panel, &panel.draped)),
                |draped, vertex| draped[vertex],
            ),
        };
        Ok((garment, frames))
    }

    /// Moves the garment of [`Frames::read`] to a frame's draped positions, and returns warnings
    /// about the frame. If the frame can't be used the garment stays as it was.
    ///
    /// # Errors
    /// [`GarmentError`] where the file can't be read, doesn't pair, or has no area.
    pub fn pose(&self, garment: &mut Garment, frame: &Path) -> Result<Vec<String>, GarmentError> {
        // All new positions are collected before the garment changes, so that a bad frame leaves it
        // as it was. First the fast way, for a frame with the connectivity of the first drape.
        let mesh = file::read(frame)?;
        let same = mesh.connectivity() == self.connectivity
            && mesh.positions.iter().all(|p| p.abs().max_element() <= LARGEST);
        let (draped, mut odd): (Vec<_>, _) = if same {
            let places =
                self.vertices.iter().map(|vertices| positions_of(vertices, &mesh.positions));
            (places.collect(), Vec::new())
        } else {
            // Coordinates out of range come here as well, since only pairing knows their line.
            let mut pairs = two_files(&self.flat, &mesh, [&self.path, frame], self.pattern)?;
            winding::reverse(&mut pairs, None, &self.reversed);
            let places = self
                .corners
                .iter()
                .map(|corners| positions_of(&draped_vertices(corners, &pairs), &pairs.draped));
            (places.collect(), std::mem::take(&mut pairs.warnings))
        };
        let size = size(garment.panels.iter().zip(&draped), |draped, vertex| {
            draped[vertex].unwrap_or_default()
        });
        if size == 0.0 {
            return Err(GarmentError::NoPanel {
                path: frame.to_owned(),
                reason: "it has no draped area".to_owned(),
            });
        }
        let (unit, strange) = self.unit_of(size);
        let origin = garment.summary.origin;
        for (panel, draped) in garment.panels.iter_mut().zip(&draped) {
            for (place, new) in panel.draped.iter_mut().zip(draped) {
                if let Some(new) = new {
                    *place = *new * unit.millimetres() - origin;
                }
            }
            panel.normals = normals(&panel.draped, &panel.triangles);
        }
        odd.extend(strange.map(|what| format!("{}: {what}", frame.display())));
        Ok(odd)
    }

    /// The size of a frame relative to the first drape, if it is in this unit.
    fn size_ratio(&self, size: f64, unit: Unit) -> f64 {
        size * unit.millimetres() / self.size
    }

    /// The unit of a frame whose size is `size` in that unit, and a warning if it differs.
    fn unit_of(&self, size: f64) -> (Unit, Option<String>) {
        let fitting = 1.0 / MAX_SIZE_RATIO..MAX_SIZE_RATIO;
        if self.unit_given || fitting.contains(&self.size_ratio(size, self.unit)) {
            return (self.unit, None);
        }
        let nearest = Unit::ALL
            .into_iter()
            .min_by(|a, b| {
                // By the logarithm, so that half the size and twice the size are equally far off.
                let [a, b] = [*a, *b].map(|unit| self.size_ratio(size, unit).ln().abs());
                a.total_cmp(&b)
            })
            .unwrap_or(self.unit);
        if fitting.contains(&self.size_ratio(size, nearest)) {
            return (
                nearest,
                Some(format!(
                    "taken to be in {nearest}, while the first frame is in {}; \
                     --unit says otherwise",
                    self.unit
                )),
            );
        }
        (
            self.unit,
            Some(format!(
                "{:.3} times as large as the first frame",
                self.size_ratio(size, self.unit)
            )),
        )
    }
}

/// For each vertex of a panel a corner of a paired triangle, as [`Frames::corners`] holds it.
fn corners(panel: &Panel, pairs: &Pairs, turned: bool) -> Vec<u32> {
    let order = if turned { [0, 2, 1] } else { [0, 1, 2] };
    let mut corners = vec![UNUSED; panel.draped.len()];
    for (triangle, face) in panel.triangles.iter().zip(&panel.faces) {
        // Pairs are in the order of the flat file's triangles, some of which have none.
        let pair = pairs.faces.partition_point(|paired| paired < face);
        for (vertex, corner) in triangle.iter().zip(order) {
            corners[*vertex as usize] = 3 * index32(pair) + corner;
        }
    }
    corners
}

/// The draped vertex at each corner.
fn draped_vertices(corners: &[u32], pairs: &Pairs) -> Vec<u32> {
    corners
        .iter()
        .map(|&corner| match corner {
            UNUSED => UNUSED,
            _ => pairs.draped_triangles[(corner / 3) as usize][(corner % 3) as usize],
        })
        .collect()
}

/// The positions of vertices. Nothing for unused ones.
fn positions_of(vertices: &[u32], positions: &[DVec3]) -> Vec<Option<DVec3>> {
    vertices.iter().map(|&vertex| (vertex != UNUSED).then(|| positions[vertex as usize])).collect()
}

/// The size of panels: the square root of their area. `position` gives a vertex's position from the
/// data that come with each panel.
fn size<'a, T>(
    panels: impl Iterator<Item = (&'a Panel, T)>,
    position: impl Fn(&T, usize) -> DVec3,
) -> f64 {
    panels
        .map(|(panel, draped)| -> f64 {
            panel
                .triangles
                .iter()
                .map(|corners| {
                    0.5 * cross(corners.map(|vertex| position(&draped, vertex as usize))).length()
                })
                .sum()
        })
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    /// A strip of two squares. Its vertices are not in the order in which faces use them, and no
    /// face uses the first one.
    fn strip(place: impl Fn(f64, f64) -> [f64; 3], rotated: bool) -> String {
        let mut text = String::from("v 9 9 9\n");
        for (x, y) in [(2.0, 1.0), (0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (0.0, 1.0), (1.0, 0.0)] {
            let [a, b, c] = place(x, y);
            writeln!(text, "v {a} {b} {c}").unwrap();
        }
        // The same faces, with other vertex numbers because of two more unused vertices.
        let more = if rotated { 2 } else { 0 };
        if rotated {
            text = format!("v 8 8 8\nv 8 8 8\n{text}");
        }
        for face in [[7, 5, 2, 4], [3, 7, 4, 6]] {
            writeln!(text, "f {}", face.map(|vertex| (vertex + more).to_string()).join(" "))
                .unwrap();
        }
        text
    }

    fn written(folder: &Path, name: &str, text: &str) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn a_frame_is_the_drape_that_reading_it_alone_gives() {
        let folder = tempfile::tempdir().unwrap();
        let flat =
            written(folder.path(), "flat.obj", &strip(|x, y| [100.0 * x, 100.0 * y, 0.0], false));
        let first =
            written(folder.path(), "1.obj", &strip(|x, y| [100.0 * x, 100.0 * y, 5.0 * x], false));
        let bent = |x: f64, y: f64| [110.0 * x, 90.0 * y, 30.0 * x * x];
        for turn in [false, true] {
            let options = ReadOptions {
                unit: Some(Unit::Mm),
                uv_scale: Some(1.0),
                turn,
                ..ReadOptions::default()
            };
            let (garment, frames) = Frames::read(&flat, Some(&first), &options).unwrap();
            for rotated in [false, true] {
                let frame = written(folder.path(), "2.obj", &strip(bent, rotated));
                let mut posed = garment.clone();
                assert_eq!(frames.pose(&mut posed, &frame).unwrap(), Vec::<String>::new());
                let alone = super::super::read(&flat, Some(&frame), &options).unwrap();
                assert_eq!(
                    posed.panels[0].draped, alone.panels[0].draped,
                    "turned {turn}, renumbered {rotated}"
                );
                assert_eq!(posed.panels[0].normals, alone.panels[0].normals);
                assert_ne!(posed.panels[0].draped, garment.panels[0].draped);
            }
        }
    }

    #[test]
    fn a_frame_in_another_unit_is_as_large_as_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let flat =
            written(folder.path(), "flat.obj", &strip(|x, y| [50.0 * x, 50.0 * y, 0.0], false));
        let options = ReadOptions { uv_scale: Some(10.0), ..ReadOptions::default() };
        let (mut garment, frames) = Frames::read(&flat, Some(&flat), &options).unwrap();
        assert_eq!(garment.summary.unit, "cm");
        let before = garment.panels[0].draped.clone();
        for (unit, times) in [("m", 0.01), ("mm", 10.0), ("in", 1.0 / 2.54)] {
            let text = strip(|x, y| [50.0 * times * x, 50.0 * times * y, 0.0], false);
            let frame = written(folder.path(), &format!("{unit}.obj"), &text);
            let odd = frames.pose(&mut garment, &frame).unwrap().concat();
            assert!(odd.contains(&format!("{unit}.obj: taken to be in {unit}, while")), "{odd}");
            assert!(
                garment.panels[0].draped.iter().zip(&before).all(|(a, b)| a.distance(*b) < 1e-6),
                "{unit}"
            );
        }
        // Cloth stretches, but not so far that the next unit is nearer.
        let stretched =
            written(folder.path(), "s.obj", &strip(|x, y| [150.0 * x, 60.0 * y, 0.0], false));
        assert_eq!(frames.pose(&mut garment, &stretched).unwrap(), Vec::<String>::new());
    }

    #[test]
    fn pieces_in_another_order_are_found_by_their_names() {
        let folder = tempfile::tempdir().unwrap();
        // Two squares of four vertices each; `first` is the name of the one that comes first in the
        // file.
        let text = |names: [&str; 2], x: [f64; 2]| {
            let mut text = String::new();
            for (at, (name, x)) in names.into_iter().zip(x).enumerate() {
                let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
                corners.iter().for_each(|(u, v)| {
                    writeln!(text, "v {} {} 0", 200.0 * (x + u), 200.0 * v).unwrap();
                });
                let vertex = |corner: usize| 4 * at + corner;
                writeln!(
                    text,
                    "o {name}\nf {} {} {} {}",
                    vertex(1),
                    vertex(2),
                    vertex(3),
                    vertex(4)
                )
                .unwrap();
            }
            text
        };
        let flat = written(folder.path(), "flat.obj", &text(["a", "b"], [0.0, 2.0]));
        let frame = written(folder.path(), "2.obj", &text(["b", "a"], [2.0, 0.0]));
        let (garment, frames) = Frames::read(&flat, Some(&flat), &ReadOptions::default()).unwrap();
        let mut posed = garment.clone();
        frames.pose(&mut posed, &frame).unwrap();
        for (posed, first) in posed.panels.iter().zip(&garment.panels) {
            assert_eq!(posed.draped, first.draped);
        }
    }

    #[test]
    fn a_bad_frame_is_named_and_leaves_the_garment_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let flat =
            written(folder.path(), "flat.obj", &strip(|x, y| [100.0 * x, 100.0 * y, 0.0], false));
        let (mut garment, frames) =
            Frames::read(&flat, Some(&flat), &ReadOptions::default()).unwrap();
        let before = garment.panels[0].draped.clone();
        let whole = strip(|x, y| [100.0 * x, 100.0 * y, 0.0], false);
        for (name, text) in [
            ("cut.obj", &whole[..whole.len() - 9]),
            ("point.obj", &strip(|_, _| [1.0; 3], false)),
            ("nan.obj", &whole.replace("100 0 0", "nan 0 0")),
            ("empty.obj", ""),
        ] {
            let frame = written(folder.path(), name, text);
            let message = frames.pose(&mut garment, &frame).unwrap_err().to_string();
            assert!(message.contains(name) && !message.contains('\n'), "{message}");
            assert_eq!(garment.panels[0].draped, before);
        }
    }
}
