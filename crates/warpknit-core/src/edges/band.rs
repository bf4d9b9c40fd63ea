//! The cloth that a finished edge turns in, as a panel of its own.
//!
//! In: a [`Sheet`], the [`Rail`] of a run, and the depth at each station. Out: a [`Panel`] that lies
//! behind the cloth, with its technical face away from it. Its flat pattern goes on where the panel
//! ends, so its wales run as if the cloth were folded.
//!
//! Cost: linear in its triangles, some 2 µs each.

use glam::{DVec2, DVec3};

use super::rail::{Rail, Sheet, SheetPlace, Station};
use crate::garment::Panel;
use crate::ids::{FaceId, index32};
use crate::number::{double, whole_f64};

/// Distance between rows of vertices at most, mm.
const ROW: f64 = 2.5;
/// Distance from the border of the places at the fold, mm.
const WITHIN: f64 = 1e-3;
/// Smallest flat area of a triangle, mm². On tight bends the pattern folds over itself; what lies there
/// is left out.
const SMALLEST: f64 = 1e-4;

/// A vertex of a band.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    uv: DVec2,
    draped: DVec3,
    normal: DVec3,
}

/// The band behind a sheet's panel, `gap` mm away, and `depths` mm wide. `None` where nothing of it is
/// left.
pub(super) fn band(sheet: &Sheet<'_>, rail: &Rail, depths: &[f64], gap: f64) -> Option<Panel> {
    let deepest = depths.iter().copied().fold(0.0, f64::max);
    let rows = whole_f64((deepest / ROW).ceil()).max(2);
    let columns = rail.stations.iter().zip(depths);
    let vertices: Vec<Vec<Option<Vertex>>> = columns
        .map(|(station, &depth)| column(sheet, rail.triangle, station, (depth, gap), rows))
        .collect();
    let mut band = BandBuilder { panel: empty(sheet), numbers: Vec::new(), rows: rows + 1 };
    band.numbers.resize(vertices.len() * band.rows, None);
    for (column, sides) in vertices.windows(2).enumerate() {
        for row in 0..rows {
            let corner = |right: usize, down: usize| {
                let vertex = sides[right][row + down]?;
                Some(((column + right) * band.rows + row + down, vertex))
            };
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            for triangle in [[a, d, c], [a, c, b]] {
                if let [Some(p), Some(q), Some(r)] = triangle {
                    band.add([p, q, r]);
                }
            }
        }
    }
    let mut panel = band.panel;
    (!panel.triangles.is_empty()).then(|| {
        panel.order_along_curve();
        panel
    })
}

/// The vertices at one station, from the edge on.
fn column(
    sheet: &Sheet<'_>,
    triangle: u32,
    station: &Station,
    (depth, gap): (f64, f64),
    rows: usize,
) -> Vec<Option<Vertex>> {
    // Cloth goes round the edge within as much cloth as is between the layers.
    let round = gap.min(depth / 2.0);
    let vertex = |row: usize| {
        let share = double(row.saturating_sub(1)) / double(rows - 1);
        let deep = if row == 0 { 0.0 } else { round + (depth - round) * share };
        // Half of the places on a slanted border are rounded off the panel.
        let within = station.flat + station.inward * deep.max(WITHIN);
        let place = sheet.at(within, triangle)?;
        let uv = station.flat + station.outward * deep;
        if row == 0 {
            let normal = out_of_edge(sheet, triangle, station, &place, round)?;
            return Some(Vertex { uv, draped: place.draped - place.normal * (gap / 2.0), normal });
        }
        let draped = place.draped - place.normal * gap;
        Some(Vertex { uv, draped, normal: -place.normal })
    };
    (0..=rows).map(vertex).collect()
}

/// The unit vector away from the cloth at its edge.
fn out_of_edge(
    sheet: &Sheet<'_>,
    triangle: u32,
    station: &Station,
    edge: &SheetPlace,
    round: f64,
) -> Option<DVec3> {
    let inner = sheet.at(station.flat + station.inward * round, triangle)?;
    Some((edge.draped - inner.draped).normalize_or(-edge.normal))
}

/// A panel without cloth behind that of a sheet.
fn empty(sheet: &Sheet<'_>) -> Panel {
    let panel = sheet.panel;
    Panel {
        uv: Vec::new(),
        draped: Vec::new(),
        normals: Vec::new(),
        triangles: Vec::new(),
        faces: Vec::new(),
        flipped: Vec::new(),
        flat_from_panel: panel.flat_from_panel,
        mirrored: panel.mirrored,
        turned_in: Some(sheet.number),
    }
}

/// A band that grows triangle by triangle.
struct BandBuilder {
    panel: Panel,
    /// The number of each vertex in the panel, once it is used.
    numbers: Vec<Option<u32>>,
    /// Vertices of a column.
    rows: usize,
}

impl BandBuilder {
    /// Adds a triangle of vertices, each with its place among all, if it has area.
    fn add(&mut self, corners: [(usize, Vertex); 3]) {
        let [a, b, c] = corners.map(|(_, vertex)| vertex.uv);
        if (b - a).perp_dot(c - a) < 2.0 * SMALLEST {
            return;
        }
        let triangle = corners.map(|(place, vertex)| self.number(place, &vertex));
        // No file has these faces. Their numbers give the triangles an order.
        self.panel.faces.push(FaceId(index32(self.panel.triangles.len())));
        self.panel.triangles.push(triangle);
    }

    fn number(&mut self, place: usize, vertex: &Vertex) -> u32 {
        let Panel { uv, draped, normals, .. } = &mut self.panel;
        *self.numbers[place].get_or_insert_with(|| {
            uv.push(vertex.uv);
            draped.push(vertex.draped);
            normals.push(vertex.normal);
            index32(uv.len() - 1)
        })
    }
}
