//! The sewing pattern of a garment that GarmentCode made (Korosteleva and Sorkine-Hornung,
//! "GarmentCode: Programming Parametric Sewing Patterns", 2023), a JSON beside its OBJ.
//!
//! In: the JSON, and the OBJ's mesh. Out: the mesh with texture coordinates in mm, whose faces bear the
//! names of their panels. The OBJ alone can't give the pattern: its texture coordinates are shrunk
//! into the unit square, more along one axis than along the other. The pattern says how large
//! each panel is, and both scales are medians of the panels' ratios.
//!
//! Method: connected pieces of the texture, in the order of their faces, are the panels in the pattern's
//! order, because GarmentCode writes them so. It is checked: a panel whose size differs by over
//! [`TOLERANCE`] from its piece is an error. Not promised: that two panels of one size are the right
//! ones of the pair.

use std::sync::Arc;

use glam::DVec2;

use super::json::Json;
use super::obj::{Label, ObjMesh, UNTEXTURED};
use super::sets::Sets;
use crate::ids::index32;

/// How much the size of a panel may differ from that of its piece. Curved edges are chains of edges
/// some centimetres long in the mesh, so a panel may be a hundredth smaller there. Panels that were taken for
/// each other differ by far more, or are mirror images.
const TOLERANCE: f64 = 0.05;
/// Points of a curved edge at which its extent is measured.
const STEPS: u32 = 32;
/// The unit where the pattern says none: centimetres.
const UNITS_IN_METRE: f64 = 100.0;

/// A sewing pattern.
#[derive(Debug)]
pub(super) struct SewingPattern {
    /// Names and sizes of the panels, mm, in the order of the mesh.
    panels: Vec<(String, DVec2)>,
}

impl SewingPattern {
    /// The pattern of a JSON. `None` where it is another JSON, such as glTF.
    ///
    /// # Errors
    /// What is wrong with a pattern.
    pub(super) fn of(root: &Json) -> Result<Option<Self>, String> {
        let Some(Json::Object(panels)) = root.get("pattern").and_then(|own| own.get("panels"))
        else {
            return Ok(None);
        };
        let said = root.get("properties").and_then(|own| own.get("units_in_meter"));
        let units = said.map_or(Some(UNITS_IN_METRE), Json::as_number);
        let units = units.filter(|units| units.is_finite() && *units > 0.0);
        let unit_mm = 1000.0 / units.ok_or("its units_in_meter is no number above 0")?;
        let mut sized = Vec::new();
        for (name, panel) in panels {
            let size = size(panel).ok_or_else(|| {
                format!("its panel {name:?} has a wrong vertex or edge: write the pattern again")
            })?;
            sized.push((name.clone(), size * unit_mm));
        }
        let pattern = root.get("pattern").map_or(&[][..], |own| own.list("panel_order"));
        let order: Vec<_> = pattern.iter().filter_map(Json::as_text).collect();
        if !order.is_empty() {
            // Panels that the order lacks are at its end, as they stand.
            let place = |name: &str| order.iter().position(|own| *own == name);
            sized.sort_by_key(|(name, _)| place(name).unwrap_or(order.len()));
        }
        Ok(Some(Self { panels: sized }))
    }

    /// Gives a mesh the pattern's names and size.
    ///
    /// # Errors
    /// Why the mesh is none of this pattern.
    pub(super) fn fit(&self, mesh: ObjMesh) -> Result<ObjMesh, String> {
        if !mesh.is_textured() || mesh.texture_triangles.is_empty() {
            return Err("has faces without vt, which the pattern needs: export it again".to_owned());
        }
        let (pieces, count) = pieces(&mesh);
        if count != self.panels.len() {
            return Err(format!(
                "has {count} pieces in its vt, and the pattern {} panels: give the pattern of this \
                 garment",
                self.panels.len()
            ));
        }
        let mut boxes = vec![[DVec2::INFINITY, DVec2::NEG_INFINITY]; count];
        for (corners, piece) in mesh.texture_triangles.iter().zip(&pieces) {
            for corner in corners {
                let place = mesh.texture[*corner as usize].truncate();
                let [low, high] = &mut boxes[*piece as usize];
                (*low, *high) = (low.min(place), high.max(place));
            }
        }
        let sizes: Vec<_> = boxes.iter().map(|[low, high]| *high - *low).collect();
        let ratios = || self.panels.iter().zip(&sizes).map(|((_, mm), flat)| *mm / *flat);
        let scale = DVec2::new(median(ratios().map(|r| r.x)), median(ratios().map(|r| r.y)));
        for ((name, _), ratio) in self.panels.iter().zip(ratios()) {
            let off = (ratio / scale - 1.0).abs();
            // A piece without area has none.
            let is_its_size = off.max_element() <= TOLERANCE;
            if !is_its_size {
                return Err(format!(
                    "has a piece in place of the panel {name:?} that is {:.0} % off its size: give \
                     the pattern of this garment",
                    100.0 * off.max_element()
                ));
            }
        }
        let texture = mesh.texture.iter().map(|place| *place * scale.extend(1.0)).collect();
        let own = |panel| Label { object: Some(index32(panel)), group: None };
        let mut faces = mesh.faces;
        let mut triangle = 0;
        for face in &mut faces {
            face.label = pieces[triangle];
            triangle += face.triangles();
        }
        Ok(ObjMesh {
            texture: Arc::new(texture),
            labels: (0..count).map(own).collect(),
            names: self.panels.iter().map(|(name, _)| name.clone()).collect(),
            faces,
            ..mesh
        })
    }
}

/// The piece of each triangle, numbered in the order of their first faces, and how many there are.
fn pieces(mesh: &ObjMesh) -> (Vec<u32>, usize) {
    let mut sets = Sets::new(mesh.texture.len());
    for [a, b, c] in mesh.texture_triangles.iter() {
        sets.join(*a, *b);
        sets.join(*b, *c);
    }
    let mut numbers = vec![UNTEXTURED; mesh.texture.len()];
    let mut count = 0;
    let mut number = |corners: &[u32; 3]| {
        let own = &mut numbers[sets.root(corners[0]) as usize];
        if *own == UNTEXTURED {
            *own = index32(count);
            count += 1;
        }
        *own
    };
    let pieces = mesh.texture_triangles.iter().map(&mut number).collect();
    (pieces, count)
}

/// The middle one of some numbers.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<_> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The extent of a panel, with its curved edges.
fn size(panel: &Json) -> Option<DVec2> {
    let vertices = panel.list("vertices").iter().map(pair).collect::<Option<Vec<_>>>()?;
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for edge in panel.list("edges") {
        let [start, end] = edge.list("endpoints") else { return None };
        let ends = [start, end].map(|end| vertices.get(end.as_index()?).copied());
        let [start, end] = [ends[0]?, ends[1]?];
        let curve = edge.get("curvature").filter(|own| **own != Json::Null);
        let curve = curve.map_or(Some(Curve::Line), |own| Curve::of(own, start, end))?;
        for step in 0..=STEPS {
            let place = curve.at(start, end, f64::from(step) / f64::from(STEPS));
            (low, high) = (low.min(place), high.max(place));
        }
    }
    let size = high - low;
    (size.is_finite() && size.min_element() > 0.0).then_some(size)
}

fn pair(place: &Json) -> Option<DVec2> {
    let Json::List(numbers) = place else { return None };
    let [x, y] = &numbers[..] else { return None };
    Some(DVec2::new(x.as_number()?, y.as_number()?))
}

/// The course of an edge.
enum Curve {
    Line,
    /// Bézier curves with these points between their ends.
    Quadratic(DVec2),
    Cubic([DVec2; 2]),
    /// A circle's centre, and the angle from the start to the end.
    Arc(DVec2, f64),
}

impl Curve {
    fn of(curvature: &Json, start: DVec2, end: DVec2) -> Option<Self> {
        // Relative to the edge: along it, and to its left.
        let edge = end - start;
        let point = |own: &Json| pair(own).map(|own| start + own.x * edge + own.y * edge.perp());
        // Older patterns have one point and no type.
        if matches!(curvature, Json::List(_)) {
            return point(curvature).map(Self::Quadratic);
        }
        Some(match (curvature.text("type")?, curvature.list("params")) {
            ("quadratic", [middle]) => Self::Quadratic(point(middle)?),
            ("cubic", [first, second]) => Self::Cubic([point(first)?, point(second)?]),
            ("circle", [radius, is_large, is_right]) => {
                let radius = radius.as_number()?;
                let is_true = |own: &Json| *own == Json::Bool(true) || own.as_number() == Some(1.0);
                let half = 0.5 * edge.length();
                let depth = (radius * radius - half * half).max(0.0).sqrt();
                let angle = 2.0 * (half / radius).min(1.0).asin();
                let turn = if is_true(is_large) { std::f64::consts::TAU - angle } else { angle };
                // An arc to the right of its edge turns left, about a centre on the left; more than
                // half a circle has its centre on the other side.
                let is_left = is_true(is_right) != is_true(is_large);
                let side = if is_left { 1.0 } else { -1.0 };
                let centre = 0.5 * (start + end) + side * depth * edge.perp().normalize_or_zero();
                Self::Arc(centre, if is_true(is_right) { turn } else { -turn })
            }
            _ => return None,
        })
    }

    fn at(&self, start: DVec2, end: DVec2, t: f64) -> DVec2 {
        let s = 1.0 - t;
        match self {
            Self::Line => start * s + end * t,
            Self::Quadratic(middle) => start * s * s + *middle * (2.0 * s * t) + end * t * t,
            Self::Cubic([first, second]) => {
                start * s.powi(3)
                    + *first * (3.0 * s * s * t)
                    + *second * (3.0 * s * t * t)
                    + end * t.powi(3)
            }
            Self::Arc(centre, angle) => {
                *centre + DVec2::from_angle(angle * t).rotate(start - *centre)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::obj;
    use super::*;

    /// A panel of 40 cm by 20, and one of 10 by 30 with a bulge of 5 to the left, which comes first in the
    /// mesh.
    const PATTERN: &str = r#"{"pattern":{"panels":{
        "front":{"vertices":[[0,0],[40,0],[40,20],[0,20]],"edges":[{"endpoints":[0,1]},
            {"endpoints":[1,2]},{"endpoints":[2,3]},{"endpoints":[3,0]}]},
        "sleeve":{"vertices":[[0,0],[10,0],[10,30],[0,30]],"edges":[{"endpoints":[0,1]},
            {"endpoints":[1,2]},{"endpoints":[2,3]},{"endpoints":[3,0],
            "curvature":{"type":"quadratic","params":[[0.5,-0.3333333333]]}}]}},
        "panel_order":["sleeve","front"]},"properties":{"units_in_meter":100}}"#;
    /// Both in the unit square, which is 2 m wide and 0.5 m high.
    const MESH: &str = "v 0 0 0\nv 15 0 0\nv 15 30 0\nv 0 30 0\nv 90 0 0\nv 130 0 0\nv 130 20 0\n\
        v 90 20 0\nvt 0 0\nvt 0.075 0\nvt 0.075 0.6\nvt 0 0.6\nvt 0.2 0\nvt 0.4 0\nvt 0.4 0.4\n\
        vt 0.2 0.4\nf 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7\nf 5/5 7/7 8/8\n";

    fn pattern(text: &str) -> Result<Option<SewingPattern>, String> {
        SewingPattern::of(&Json::parse(text.as_bytes()).unwrap())
    }

    fn mesh() -> ObjMesh {
        obj::parse(MESH.as_bytes(), Path::new("a.obj")).unwrap()
    }

    #[test]
    fn a_mesh_takes_names_and_millimetres_of_its_pattern() {
        let mesh = pattern(PATTERN).unwrap().unwrap().fit(mesh()).unwrap();
        assert_eq!(mesh.names, ["sleeve", "front"]);
        assert_eq!(mesh.faces.iter().map(|face| face.label).collect::<Vec<_>>(), [0, 1, 1]);
        let far = mesh.texture[6].truncate();
        assert!((far - DVec2::new(800.0, 200.0)).length() < 1e-3, "{far}");
        assert!(pattern("{\"asset\":{}}").unwrap().is_none());
    }

    #[test]
    fn an_edge_bulges_as_far_as_its_curve() {
        let size = |curvature: &str| {
            let text = format!(
                "{{\"vertices\":[[0,0],[10,0],[10,4],[0,4]],\"edges\":[{{\"endpoints\":[0,1],\
                 \"curvature\":{curvature}}},{{\"endpoints\":[2,3]}}]}}"
            );
            super::size(&Json::parse(text.as_bytes()).unwrap())
        };
        let near =
            |own: Option<DVec2>, y: f64| (own.unwrap() - DVec2::new(10.0, y)).length() < 0.02;
        assert!(near(size("null"), 4.0));
        assert!(near(size("[0.5,-0.2]"), 5.0));
        assert!(near(size(r#"{"type":"cubic","params":[[0.3,-0.4],[0.7,-0.4]]}"#), 7.0));
        // Half a circle below, and one above that leaves the box as it is.
        assert!(near(size(r#"{"type":"circle","params":[5,0,1]}"#), 9.0));
        assert!(near(size(r#"{"type":"circle","params":[6.25,false,true]}"#), 6.5));
        assert!(near(size(r#"{"type":"circle","params":[13,0,0]}"#), 4.0));
        for wrong in ["3", "{}", r#"{"type":"spiral","params":[]}"#, "[1]"] {
            assert_eq!(size(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn what_is_wrong_is_one_line() {
        let wrong = [
            ("[40,20]", "[80,20]", "size"),
            ("\"sleeve\",\"front\"", "\"front\",\"sleeve\"", "size"),
            ("[40,20]", "[40]", "front"),
            ("[1,2]", "[1,9]", "front"),
            (
                "\"sleeve\":{",
                "\"s\":{\"vertices\":[[0,0],[9,9]],\"edges\":[{\"endpoints\":[0,1]}]},\"sleeve\":{",
                "3 panels",
            ),
            (":100}", ":0}", "units_in_meter"),
        ];
        for (from, to, says) in wrong {
            assert!(PATTERN.contains(from), "{from}");
            let text = PATTERN.replacen(from, to, 1);
            let fitted = pattern(&text).and_then(|own| own.unwrap().fit(mesh()));
            let message = fitted.unwrap_err();
            assert!(message.contains(says) && !message.contains('\n'), "{to}: {message}");
        }
        let bare =
            obj::parse(&b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"[..], Path::new("a")).unwrap();
        assert!(pattern(PATTERN).unwrap().unwrap().fit(bare).unwrap_err().contains("vt"));
    }
}
