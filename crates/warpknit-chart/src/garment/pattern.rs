//! The flat panels of a garment, side by side at one scale: outline, number, size, and an arrow
//! along the wales.
//!
//! In: panels. Out: layers of a drawing. A panel is shown as it lies in the flat file, seen from
//! its technical face; a mirrored panel is turned over, and the arrow is inclined where the grain
//! was turned. The outline consists of the edges that belong to a single triangle. Panels are
//! packed in rows by decreasing height (shelf packing; Coffman, Garey, Johnson and Tarjan 1980,
//! "Performance bounds for level-oriented two-dimensional packing algorithms"), at the largest
//! scale that fits, found by bisection.
//!
//! Not promised: more than [`MOST`] panels (a line says how many smaller ones are left out), and
//! the densest packing.

use std::collections::HashMap;

use glam::DVec2;

use super::{DEFECT, closed, layer};
use crate::{Anchor, DrawingLayer, DrawingShape, FAINT, INK, PathSegment, TextSize, label};
use warpknit_core::fabric::yarn::Color;
use warpknit_core::garment::{Garment, Panel};

/// The most panels that are drawn, the largest ones.
const MOST: usize = 40;
/// Colour of the panels' areas.
const CLOTH: Color = Color([0xee, 0xf1, 0xf4]);
/// Colour of the arrows.
const GRAIN: Color = Color([0x12, 0x5d, 0xa8]);
/// Space between panels, px.
const GAP: f64 = 14.0;
/// Room for the two lines below a panel, clear of an arrow that is longer than the panel, px.
const WORDS: f64 = 36.0;
/// Line width of outlines, px.
const OUTLINE: f64 = 1.6;
/// An arrow's length over that of the chord it lies on.
const ARROW: f64 = 0.6;
/// Least length of an arrow, px, even where it is longer than a narrow panel.
const SHORTEST: f64 = 16.0;
/// Greatest length of an arrow, px.
const LONGEST: f64 = 110.0;
/// Length of an arrow's head, px.
const HEAD: f64 = 7.0;
/// The longest scale bar, px.
const SCALE_BAR: f64 = 200.0;

/// A flat panel as it was cut, mm, y up.
struct FlatPanel {
    number: usize,
    points: Vec<DVec2>,
    /// Lower corner of its bounding box.
    low: DVec2,
    /// Size of its bounding box.
    size: DVec2,
    /// The border and the holes as closed lines of vertices.
    outlines: Vec<Vec<u32>>,
    /// The two lines below it.
    words: [String; 2],
}

/// A panel with its place on the sheet.
struct PlacedPanel<'a> {
    piece: &'a FlatPanel,
    /// Its upper left corner, px.
    at: DVec2,
    /// px a mm.
    scale: f64,
}

/// The layers of the panels in a box of size `room` at `corner`, with the scale bar in the `strip`
/// px below the box. `covered` are the triangles of each panel that lie under other cloth of it.
pub(super) fn draw(
    garment: &Garment,
    covered: &[Vec<usize>],
    corner: DVec2,
    room: DVec2,
    strip: f64,
) -> Vec<DrawingLayer> {
    let mut pieces: Vec<_> = garment
        .panels
        .iter()
        .enumerate()
        .map(|(number, panel)| FlatPanel::new(number, panel))
        .collect();
    pieces.sort_by(|a, b| {
        garment.panels[b.number].area().total_cmp(&garment.panels[a.number].area())
    });
    let left_out = pieces.len().saturating_sub(MOST);
    pieces.truncate(MOST);
    pieces.sort_by(|a, b| b.size.y.total_cmp(&a.size.y).then(a.number.cmp(&b.number)));
    let (scale, places) = packed(&pieces, room);
    let placed: Vec<_> = pieces
        .iter()
        .zip(places)
        .map(|(piece, at)| PlacedPanel { piece, at: corner + at, scale })
        .collect();

    let mut layers = vec![layer(
        "cloth",
        CLOTH,
        placed.iter().map(|placed| DrawingShape::Area { segments: placed.outline() }).collect(),
    )];
    let mut words = Vec::new();
    for placed in &placed {
        let (number, panel) = (placed.piece.number, &garment.panels[placed.piece.number]);
        layers.extend(placed.defects(panel, &covered[number]));
        layers.push(layer(
            &format!("panel-{number}"),
            INK,
            vec![DrawingShape::Path { segments: placed.outline(), width: OUTLINE }],
        ));
        layers.push(layer(
            &format!("grain-{number}"),
            GRAIN,
            vec![DrawingShape::Path { segments: placed.arrow(panel.grain()), width: OUTLINE }],
        ));
        words.extend(placed.words());
    }
    layers.push(layer("labels", INK, words));
    layers.extend(scale_bar(scale, corner + DVec2::new(0.0, room.y + strip), left_out));
    layers
}

impl FlatPanel {
    fn new(number: usize, panel: &Panel) -> Self {
        // The panel's own plane has the wales along y. Turning by the grain brings back the pose of
        // the flat file.
        let turn = DVec2::from_angle(panel.grain());
        let points: Vec<_> = panel.uv.iter().map(|&uv| turn.rotate(uv)).collect();
        let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let size = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max) - low;
        let mirrored = if panel.mirrored { ", mirrored" } else { "" };
        let words =
            [format!("panel {number}{mirrored}"), format!("{:.0} \u{d7} {:.0} mm", size.x, size.y)];
        Self {
            number,
            points,
            low,
            size,
            outlines: loops(&edges(panel, |count| count == 1)),
            words,
        }
    }

    /// The size of its cell in the packing, px.
    fn cell(&self, scale: f64) -> DVec2 {
        let words = self.words.iter().map(|text| TextSize::Small.width(text)).fold(0.0, f64::max);
        DVec2::new((self.size.x * scale).max(words) + GAP, self.size.y * scale + WORDS + GAP)
    }
}

/// The edges whose number of adjacent triangles satisfies `wanted` (1: border, more than 2:
/// non-manifold), flipped triangles included, in the order of the triangles.
fn edges(panel: &Panel, wanted: impl Fn(u32) -> bool) -> Vec<[u32; 2]> {
    let all = || {
        panel.triangles.iter().chain(&panel.flipped).flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
    };
    let mut counts: HashMap<[u32; 2], u32> = HashMap::new();
    all().for_each(|edge| *counts.entry(undirected(edge)).or_default() += 1);
    // Removing the count returns each edge only once.
    all()
        .filter(|&edge| {
            counts.get(&undirected(edge)).is_some_and(|&count| wanted(count))
                && counts.remove(&undirected(edge)).is_some()
        })
        .collect()
}

/// An edge without its direction.
fn undirected([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Joins edges to lines, each continued by any unused edge at its end. The edges of a border give
/// closed lines: in a manifold panel every border vertex has an even number of them.
fn loops(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    // For each vertex the edges that meet there; in reverse, so that `pop` takes the first one.
    let mut at: HashMap<u32, Vec<usize>> = HashMap::new();
    for (number, [a, b]) in edges.iter().enumerate().rev() {
        at.entry(*a).or_default().push(number);
        at.entry(*b).or_default().push(number);
    }
    let mut used = vec![false; edges.len()];
    let mut loops = Vec::new();
    for (number, &[start, next]) in edges.iter().enumerate() {
        if std::mem::replace(&mut used[number], true) {
            continue;
        }
        let (mut line, mut here) = (vec![start], next);
        while here != start {
            line.push(here);
            let left = at.get_mut(&here).and_then(|there| {
                there.retain(|&edge| !used[edge]);
                there.pop()
            });
            let Some(edge) = left else { break };
            used[edge] = true;
            let [a, b] = edges[edge];
            here = if a == here { b } else { a };
        }
        loops.push(line);
    }
    loops
}

/// The largest scale at which the pieces' cells fit into the room in rows, and the place of each
/// piece, found by bisection. 40 halvings reach the precision of an f64's leading 12 digits.
fn packed(pieces: &[FlatPanel], room: DVec2) -> (f64, Vec<DVec2>) {
    let largest = pieces.iter().map(|piece| piece.size).fold(DVec2::ZERO, DVec2::max);
    let mut fits = (0.0, rows(pieces, 0.0, room.x).0);
    let mut too_large = (room / largest.max(DVec2::splat(f64::MIN_POSITIVE))).min_element();
    for _ in 0..40 {
        let scale = 0.5 * (fits.0 + too_large);
        let (places, used) = rows(pieces, scale, room.x);
        if used.x <= room.x && used.y <= room.y {
            fits = (scale, places);
        } else {
            too_large = scale;
        }
    }
    fits
}

/// Packs pieces into rows at a scale: the place of each piece, centred in its cell, and the room
/// that all take.
fn rows(pieces: &[FlatPanel], scale: f64, width: f64) -> (Vec<DVec2>, DVec2) {
    let (mut cursor, mut row, mut used) = (DVec2::ZERO, 0.0_f64, DVec2::ZERO);
    let mut places = Vec::new();
    for piece in pieces {
        let cell = piece.cell(scale);
        if cursor.x > 0.0 && cursor.x + cell.x > width {
            cursor = DVec2::new(0.0, cursor.y + row);
            row = 0.0;
        }
        places.push(cursor + DVec2::new(0.5 * (cell.x - GAP - piece.size.x * scale), 0.0));
        row = row.max(cell.y);
        cursor.x += cell.x;
        used = used.max(DVec2::new(cursor.x, cursor.y + row));
    }
    (places, used)
}

impl PlacedPanel<'_> {
    /// The place on the sheet of a point of the panel, mm.
    fn place(&self, point: DVec2) -> DVec2 {
        let from_low = (point - self.piece.low) * self.scale;
        self.at + DVec2::new(from_low.x, self.piece.size.y * self.scale - from_low.y)
    }

    fn vertex(&self, vertex: u32) -> DVec2 {
        self.place(self.piece.points[vertex as usize])
    }

    /// The border and the holes on the sheet.
    fn outline(&self) -> Vec<PathSegment> {
        let mut segments = Vec::new();
        for vertices in &self.piece.outlines {
            let points: Vec<_> = vertices.iter().map(|&vertex| self.vertex(vertex)).collect();
            segments.extend(closed(&points));
        }
        segments
    }

    /// The panel's defects: flipped triangles, each with a dot so that the smallest one is visible,
    /// non-manifold edges, and the cloth of the triangles that are `covered`.
    fn defects(&self, panel: &Panel, covered: &[usize]) -> Vec<DrawingLayer> {
        let mut layers = Vec::new();
        if !covered.is_empty() {
            // Each by itself: in one area, two that lie over each other would leave a hole.
            let shapes = covered.iter().map(|&triangle| {
                let corners = panel.triangles[triangle].map(|vertex| self.vertex(vertex));
                DrawingShape::Area { segments: closed(&corners) }
            });
            layers.push(layer(&format!("covered-{}", self.piece.number), DEFECT, shapes.collect()));
        }
        if !panel.flipped.is_empty() {
            let shapes = panel.flipped.iter().flat_map(|corners| {
                let corners = corners.map(|vertex| self.vertex(vertex));
                let at = corners.iter().sum::<DVec2>() / 3.0;
                [
                    DrawingShape::Area { segments: closed(&corners) },
                    DrawingShape::Dot { at, radius: 2.0 },
                ]
            });
            layers.push(layer(&format!("flipped-{}", self.piece.number), DEFECT, shapes.collect()));
        }
        let shared = edges(panel, |count| count > 2);
        if !shared.is_empty() {
            let pieces = shared
                .iter()
                .flat_map(|&[a, b]| {
                    [PathSegment::Move(self.vertex(a)), PathSegment::Line(self.vertex(b))]
                })
                .collect();
            layers.push(layer(
                &format!("non-manifold-{}", self.piece.number),
                DEFECT,
                vec![DrawingShape::Path { segments: pieces, width: 4.0 }],
            ));
        }
        layers
    }

    /// An arrow along the wales. It lies on the panel's cloth if there is room for it.
    fn arrow(&self, grain: f64) -> Vec<PathSegment> {
        let along = DVec2::from_angle(grain).perp();
        let [tail, tip] = self.longest_chord(along).map(|end| self.place(end));
        let (middle, length) = (0.5 * (tail + tip), (tip - tail).length());
        let along = DVec2::new(along.x, -along.y);
        let half = along * 0.5 * (ARROW * length).clamp(SHORTEST, LONGEST);
        let head = |side: f64| {
            middle + half - (along + side * 0.5 * along.perp()) * HEAD.min(0.8 * half.length())
        };
        let tip = middle + half;
        vec![
            PathSegment::Move(middle - half),
            PathSegment::Line(tip),
            PathSegment::Move(head(1.0)),
            PathSegment::Line(tip),
            PathSegment::Line(head(-1.0)),
        ]
    }

    /// The longest chord in a direction that stays on the cloth, mm. Some parallel lines across the
    /// panel are tried; chords near its middle are preferred, since an arrow looks best there.
    fn longest_chord(&self, along: DVec2) -> [DVec2; 2] {
        const LINES: i32 = 4;
        let FlatPanel { points, outlines, low, size, .. } = self.piece;
        let across = -along.perp();
        let sides = points.iter().map(|p| across.dot(*p));
        let (left, right) = sides.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        let mut best = ([*low + 0.5 * *size; 2], 0.0);
        for number in -LINES..=LINES {
            let aside = f64::from(number) / f64::from(LINES);
            // The small offset keeps the line off the vertices of a symmetric panel.
            let at = 0.5 * (left + right) + 0.35 * (right - left) * (aside + 1e-3);
            // Where the line crosses the outlines: between each odd crossing and the next one lies
            // cloth (even-odd rule), holes left out.
            let mut heights: Vec<f64> = Vec::new();
            for line in outlines {
                for (end, &b) in line.iter().enumerate() {
                    let [a, b] = [line[(end + line.len() - 1) % line.len()], b]
                        .map(|vertex| points[vertex as usize]);
                    let (here, there) = (across.dot(a) - at, across.dot(b) - at);
                    if (here < 0.0) != (there < 0.0) {
                        heights.push(along.dot(a + (b - a) * (here / (here - there))));
                    }
                }
            }
            heights.sort_by(f64::total_cmp);
            for pair in heights.chunks_exact(2) {
                let worth = (pair[1] - pair[0]) * (1.0 - 0.4 * aside.abs());
                if worth > best.1 {
                    best = ([pair[0], pair[1]].map(|height| across * at + along * height), worth);
                }
            }
        }
        best.0
    }

    /// The panel's name and size, below it.
    fn words(&self) -> [DrawingShape; 2] {
        let FlatPanel { size, words: [name, extent], .. } = self.piece;
        let below = self.at + DVec2::new(0.5 * size.x, size.y) * self.scale;
        let line = |down: f64, text: &str| {
            label(below + DVec2::new(0.0, down), text.to_owned(), Anchor::Middle)
        };
        [line(18.0, name), line(31.0, extent)]
    }
}

/// The scale bar above `corner`, the meaning of the arrows, and how many panels are left out.
fn scale_bar(scale: f64, corner: DVec2, left_out: usize) -> Vec<DrawingLayer> {
    // The longest of 1, 2 or 5 times a power of ten that fits.
    let longest = SCALE_BAR / scale.max(f64::MIN_POSITIVE);
    let decade = 10.0_f64.powf(longest.log10().floor());
    let length = [5.0, 2.0, 1.0]
        .map(|times| times * decade)
        .into_iter()
        .find(|length| *length <= longest)
        .unwrap_or(decade);
    let (from, to) =
        (corner + DVec2::new(1.0, -20.0), corner + DVec2::new(1.0 + length * scale, -20.0));
    let up = DVec2::new(0.0, 5.0);
    let mut pieces = vec![
        PathSegment::Move(from - up),
        PathSegment::Line(from + up),
        PathSegment::Move(from),
        PathSegment::Line(to),
    ];
    pieces.extend([PathSegment::Move(to - up), PathSegment::Line(to + up)]);
    let mut words = vec![label(to + DVec2::new(8.0, 4.0), format!("{length} mm"), Anchor::Start)];
    let meaning = "seen from the technical face; arrows: along the wales (warp)";
    words.push(label(corner + DVec2::new(0.0, -40.0), meaning.to_owned(), Anchor::Start));
    if left_out > 0 {
        let text = format!("{left_out} smaller panels are left out");
        words.push(label(corner + DVec2::new(0.0, -56.0), text, Anchor::Start));
    }
    vec![
        layer("scale-bar", INK, vec![DrawingShape::Path { segments: pieces, width: OUTLINE }]),
        layer("scale", FAINT, words),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_are_closed_lines_and_holes_are_lines_of_their_own() {
        // A square ring: eight vertices, the outer four first.
        let ring = |k: u32| [[k, (k + 1) % 4, 4 + k], [4 + k, (k + 1) % 4, 4 + (k + 1) % 4]];
        let mut panel = Garment::rectangle(3.0, 3.0).panels.remove(0);
        panel.uv.extend([(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)].map(DVec2::from));
        panel.triangles = (0..4).flat_map(ring).collect();
        let mut found = loops(&edges(&panel, |count| count == 1));
        assert_eq!(found.len(), 2);
        found.iter_mut().for_each(|line| line.sort_unstable());
        assert_eq!(found, [[0, 1, 2, 3], [4, 5, 6, 7]]);
        // The arrow keeps out of the hole: left or right of it, or shorter.
        let piece = FlatPanel::new(0, &panel);
        let placed = PlacedPanel { piece: &piece, at: DVec2::ZERO, scale: 1.0 };
        let [a, b] = placed.longest_chord(DVec2::Y);
        assert!(
            (a.x - b.x).abs() < 1e-9
                && !(1.0..=2.0).contains(&a.x)
                && (b.y - a.y - 3.0).abs() < 1e-9,
            "{a} {b}"
        );
    }

    #[test]
    fn cells_fill_the_room_and_none_lies_on_another() {
        let sizes = [
            (300.0, 500.0),
            (280.0, 500.0),
            (40.0, 200.0),
            (500.0, 90.0),
            (3.0, 3.0),
            (320.0, 140.0),
        ];
        let panel = |(width, height)| Garment::rectangle(width, height).panels.remove(0);
        let pieces: Vec<_> = sizes
            .into_iter()
            .enumerate()
            .map(|(number, size)| FlatPanel::new(number, &panel(size)))
            .collect();
        let room = DVec2::new(700.0, 500.0);
        let (scale, places) = packed(&pieces, room);
        assert!(scale > 0.3, "{scale}");
        let boxes: Vec<_> = pieces
            .iter()
            .zip(&places)
            .map(|(piece, at)| (*at, *at + piece.size * scale + DVec2::new(0.0, WORDS)))
            .collect();
        for (number, (low, high)) in boxes.iter().enumerate() {
            assert!(low.cmpge(DVec2::ZERO).all() && high.cmple(room).all());
            let apart = |(l, h): &(DVec2, DVec2)| {
                high.x <= l.x || h.x <= low.x || high.y <= l.y || h.y <= low.y
            };
            assert!(boxes[..number].iter().all(apart));
        }
    }

    #[test]
    fn the_arrow_leans_with_the_grain() {
        let mut garment = Garment::rectangle(100.0, 100.0);
        garment.turn_grain(0, 0.5);
        let piece = FlatPanel::new(0, &garment.panels[0]);
        assert!((piece.size - 100.0).length() < 1e-9, "the piece lies as cut");
        let placed = PlacedPanel { piece: &piece, at: DVec2::ZERO, scale: 1.0 };
        let arrow = placed.arrow(garment.panels[0].grain());
        let (tail, tip) = (arrow[0].end(), arrow[1].end());
        // Down the sheet is +y; counter-clockwise is to the left.
        assert!(
            ((tip - tail).normalize() - DVec2::new(-0.5_f64.sin(), -0.5_f64.cos())).length() < 1e-9
        );
    }
}
