//! A run of border as a rail along which cloth is turned in and threads are sewn.
//!
//! In: a panel with its [`Locator`], and a [`BorderRun`]. Out: a [`Rail`], places along the run with the way
//! into the panel at each, and how deep the panel is there.
//!
//! Method: the way in is across the run. At an end where another run begins it follows that run's
//! border, so that the hems of two panels meet along their seam.
//!
//! Cost: linear in the places, some 2 µs each, most of it for finding the depth.

use glam::{DVec2, DVec3};

use super::border::BorderRun;
use crate::garment::Panel;
use crate::locate::Locator;
use crate::map::surface::{SmoothSurface, part_of};
use crate::number::double;

/// Distance between places along the rail at most, mm.
const SPACING: f64 = 2.5;
/// Places on one edge at most: those of 250 m.
const MOST_STEPS: f64 = 1e5;
/// Smallest cosine between the way across a run and the border at its end. Where it is smaller, the
/// corner is too sharp for cloth that follows that border.
const UPRIGHT: f64 = 0.5;
/// Part by which the way in leaves the border at an end, so that it lies on the panel.
const OFF_BORDER: f64 = 0.01;
/// Steps in which the depth of a panel is searched, and halvings of the last one.
const STEPS: usize = 10;
const HALVINGS: usize = 8;

/// A draped panel on which any flat place can be found.
pub(super) struct Sheet<'a> {
    /// The panel's number in its garment.
    pub(super) number: usize,
    pub(super) panel: &'a Panel,
    locator: &'a Locator<'a>,
    surface: SmoothSurface,
}

/// A place of a draped panel.
#[derive(Clone, Copy, Debug)]
pub(super) struct SheetPlace {
    /// mm.
    pub(super) draped: DVec3,
    /// Unit normal out of the technical face.
    pub(super) normal: DVec3,
}

/// A place of a rail.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    /// Length of flat border before it, mm.
    pub(super) along: f64,
    /// On the border, mm.
    pub(super) flat: DVec2,
    /// The way into the panel for each mm of depth.
    pub(super) inward: DVec2,
    /// The same, mirrored on the border: where cloth would go on that is turned in here.
    pub(super) outward: DVec2,
    /// How deep the panel is, mm, up to the depth that was asked for.
    pub(super) reach: f64,
}

/// A run of border, from station to station.
pub(super) struct Rail {
    pub(super) stations: Vec<Station>,
    /// A triangle on it.
    pub(super) triangle: u32,
}

impl<'a> Sheet<'a> {
    pub(super) fn new(number: usize, panel: &'a Panel, locator: &'a Locator<'a>) -> Self {
        Self { number, panel, locator, surface: SmoothSurface::new(panel) }
    }

    /// The place at flat coordinates, near the triangle `hint`. `None` off the panel.
    pub(super) fn at(&self, flat: DVec2, hint: u32) -> Option<SheetPlace> {
        let at = self.locator.at(flat, hint)?;
        let patch = self.surface.patch(self.panel, at.triangle as usize);
        let frame = patch.part(part_of(at.b, at.c)).at([at.b], [at.c]);
        let [draped, normal] =
            [frame.place, frame.normal].map(|[x, y, z]| DVec3::new(x[0], y[0], z[0]));
        (draped.is_finite() && normal.is_finite()).then_some(SheetPlace { draped, normal })
    }
}

impl Rail {
    /// The rail of a run, with depths up to `deepest`. At its ends the way in turns within `turning`
    /// mm, from along the border there to across the run.
    pub(super) fn new(sheet: &Sheet<'_>, run: &BorderRun, turning: f64, deepest: f64) -> Self {
        let mut stations = along(sheet.panel, run);
        turn_ends(sheet.panel, run, turning, &mut stations);
        for station in &mut stations {
            station.reach = reach(sheet, station, run.triangle, deepest);
        }
        Self { stations, triangle: run.triangle }
    }

    /// Its length on the flat panel, mm.
    pub(super) fn length(&self) -> f64 {
        self.stations.last().map_or(0.0, |last| last.along)
    }

    /// The middle one of all depths, mm.
    pub(super) fn median_reach(&self) -> f64 {
        let mut depths: Vec<f64> = self.stations.iter().map(|station| station.reach).collect();
        depths.sort_by(f64::total_cmp);
        depths.get(depths.len() / 2).copied().unwrap_or(0.0)
    }

    /// The station at a length of border, between two of its own.
    pub(super) fn at(&self, along: f64) -> Option<Station> {
        let after = self.stations.partition_point(|station| station.along < along);
        let last = self.stations.len().checked_sub(1)?;
        let after = after.max(1).min(last);
        let [a, b] = [self.stations.get(after.checked_sub(1)?)?, self.stations.get(after)?];
        let share = ((along - a.along) / (b.along - a.along)).clamp(0.0, 1.0);
        Some(Station {
            along,
            flat: a.flat.lerp(b.flat, share),
            inward: a.inward.lerp(b.inward, share),
            outward: a.outward.lerp(b.outward, share),
            reach: a.reach.min(b.reach),
        })
    }
}

/// Stations along a run, with the way in across it.
fn along(panel: &Panel, run: &BorderRun) -> Vec<Station> {
    let places: Vec<DVec2> = run.vertices.iter().map(|&vertex| panel.uv[vertex as usize]).collect();
    // Edges of no length have no direction.
    let edges: Vec<[DVec2; 2]> =
        places.windows(2).map(|ends| [ends[0], ends[1]]).filter(|[a, b]| a != b).collect();
    let across = |[a, b]: [DVec2; 2]| (b - a).perp().normalize();
    let at_corner = |one: usize, next: usize| {
        let sum = across(edges[one]) + across(edges[next]);
        let middle = sum.normalize();
        // Longer where the run bends, so that depths are those from both edges. Runs turn by under 40
        // degrees at a time, so this divides by no small number.
        middle / middle.dot(across(edges[one]))
    };
    let last = edges.len().saturating_sub(1);
    let joint = |at: usize| match (at, run.beyond) {
        (0, None) => at_corner(last, 0),
        (0, Some(_)) => across(edges[0]),
        (at, None) if at > last => at_corner(last, 0),
        (at, Some(_)) if at > last => across(edges[last]),
        (at, _) => at_corner(at - 1, at),
    };
    let mut stations = Vec::new();
    let mut length = 0.0;
    for (number, &[a, b]) in edges.iter().enumerate() {
        let steps = (a.distance(b) / SPACING).ceil().clamp(1.0, MOST_STEPS);
        let ways = [joint(number), joint(number + 1)];
        let first = if number == 0 { 0.0 } else { 1.0 };
        let mut step = first;
        while step <= steps {
            let share = step / steps;
            let inward = ways[0].lerp(ways[1], share);
            stations.push(Station {
                along: length + a.distance(b) * share,
                flat: a.lerp(b, share),
                inward,
                outward: -inward,
                reach: 0.0,
            });
            step += 1.0;
        }
        length += a.distance(b);
    }
    stations
}

/// Turns the way in at both ends of a run until it follows the border beyond.
fn turn_ends(panel: &Panel, run: &BorderRun, turning: f64, stations: &mut [Station]) {
    let (Some(beyond), [first, .., last]) = (run.beyond, &*stations) else { return };
    let (first, last) = (*first, *last);
    for (end, vertex, sign) in [(first, beyond[0], 1.0), (last, beyond[1], -1.0)] {
        let across = end.inward.normalize();
        // Along the run, from this end to the other.
        let onward = -across.perp() * sign;
        let border = (panel.uv[vertex as usize] - end.flat).normalize_or_zero();
        let cosine = border.dot(across);
        if cosine < UPRIGHT {
            continue;
        }
        let slant = border.dot(onward) / cosine + OFF_BORDER;
        for station in &mut *stations {
            let share = 1.0 - (station.along - end.along).abs() / turning;
            if share > 0.0 {
                // Sideways alone, so that depths stay.
                let sideways = onward * (slant * share);
                station.outward += sideways;
                station.inward += sideways;
            }
        }
    }
}

/// How deep the panel is at a station, mm, up to `deepest`.
fn reach(sheet: &Sheet<'_>, station: &Station, triangle: u32, deepest: f64) -> f64 {
    let is_on =
        |depth: f64| sheet.locator.at(station.flat + station.inward * depth, triangle).is_some();
    let steps = (1..=STEPS).map(|step| deepest * double(step) / double(STEPS));
    let mut on = 0.0;
    for depth in steps {
        if is_on(depth) {
            on = depth;
            continue;
        }
        let mut off = depth;
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(on, off);
            if is_on(middle) { on = middle } else { off = middle }
        }
        return on;
    }
    on
}
