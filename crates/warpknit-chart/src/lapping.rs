//! The lapping diagram of a warp knit: which needles, courses and bars are shown, where they lie on
//! the sheet, and the labels.
//!
//! In: a [`Fabric`] with guide bars. Out: a [`Drawing`] with a layer for each bar. Two repeats are
//! shown, within the limits of needles, courses and bars below; a note says what is left out.
//! `path` gives the line of each yarn. Cost: some thousand shapes at most.

use std::ops::Range;

use glam::DVec2;

use super::path::{Lane, PathSegment, Pitch, clipped, rounded, waypoints};
use super::{
    Anchor, Drawing, DrawingLayer, DrawingShape, FAINT, HAIR, HEADING, INK, MARGIN, TextSize, cut,
    label, shortened,
};
use warpknit_core::fabric::lapping::Chain;
use warpknit_core::fabric::yarn::Color;
use warpknit_core::fabric::{Bar, Fabric, Lay, WarpKnit};
use warpknit_core::ids::index32;

/// The most needles on a sheet. A PNG of a sheet with all three limits still takes less than 200 MB
/// to paint.
const MOST_NEEDLES: i64 = 40;
/// The most courses on a sheet.
const MOST_COURSES: usize = 40;
/// The most bars on a sheet.
const MOST_BARS: usize = 24;
/// The fewest courses on a sheet. Fewer would not show how laps join.
const LEAST_COURSES: usize = 4;
/// The most characters of a chain in the legend; chains may have thousands.
const MOST_OF_CHAIN: usize = 48;
/// The most characters of a threading in the legend.
const MOST_OF_THREADING: usize = 16;

/// Colours of bars, front first: far apart from each other and dark enough for white paper.
const BAR_COLORS: [Color; 10] = [
    Color([0xc6, 0x1f, 0x32]),
    Color([0x12, 0x5d, 0xa8]),
    Color([0x1d, 0x83, 0x48]),
    Color([0xd9, 0x7a, 0x06]),
    Color([0x7a, 0x3d, 0xa3]),
    Color([0x0a, 0x8a, 0x94]),
    Color([0xd2, 0x1c, 0x7c]),
    Color([0x8a, 0x52, 0x2a]),
    Color([0x66, 0x73, 0x0b]),
    Color([0x3f, 0x48, 0x52]),
];

/// Length of a rounded corner's sides over the needle pitch: as much as the widest overlap takes.
const CORNER: f64 = 0.34;
/// Room for the course numbers, px.
const COURSE_NUMBERS: f64 = 44.0;
/// Room for the gap numbers, px.
const GAP_NUMBERS: f64 = 34.0;
/// Height of a line of the legend, px.
const LEGEND_ROW: f64 = 20.0;
/// Height of a note, px.
const NOTE_ROW: f64 = 16.0;
/// Room for the sample of a bar's line in the legend, px.
const SAMPLE: f64 = 26.0;
/// Radius of a needle's dot, px.
const DOT: f64 = 3.2;
/// Line width of a bar's yarn, px.
const YARN: f64 = 2.4;
/// Line width of a bar's other yarns, px.
const NEIGHBOUR: f64 = 1.0;

/// The layout of the sheet.
struct LappingSheet {
    pitch: Pitch,
    /// The gaps between needles that are shown.
    gaps: Range<i64>,
    courses: usize,
    /// The place of gap 0 of guide 0 at the first course, px of the sheet.
    origin: DVec2,
    bars: usize,
    size: DVec2,
}

/// Draws the diagram.
pub(super) fn draw(fabric: &Fabric, knit: &WarpKnit) -> Drawing {
    let bars = &knit.bars[..knit.bars.len().min(MOST_BARS)];
    let reach = reach(bars);
    let mut sheet = LappingSheet::new(fabric, bars, &reach);
    let notes = notes(fabric, &sheet, &reach);
    sheet.size.y += NOTE_ROW * f64::from(index32(notes.len()));
    let widest = notes.iter().map(|note| TextSize::Small.width(note)).fold(0.0, f64::max);
    sheet.size.x = sheet.size.x.max(widest + 2.0 * MARGIN);
    let mut layers = vec![sheet.repeats(fabric.repeat()), sheet.needles()];
    let lanes = lanes(bars, sheet.pitch);
    // The front bar is knitted last and lies uppermost on the technical back.
    for (at, (bar, lane)) in bars.iter().zip(lanes).enumerate().rev() {
        if let Lay::Lapping(chain) = &bar.lay
            && bars.len() <= 2
        {
            layers.push(sheet.neighbours(at, bar, chain, lane));
        }
        let shapes = sheet.yarn(bar, drawn_guide(bar), lane, YARN);
        layers.push(DrawingLayer { name: format!("bar-{}", at + 1), color: bar_color(at), shapes });
    }
    layers.push(sheet.gap_numbers(bars));
    layers.push(sheet.course_numbers(fabric.repeat()));
    layers.extend(sheet.words(fabric, bars, &notes));
    Drawing { size: sheet.size, layers, notes }
}

/// The colour of the bar with that index.
fn bar_color(at: usize) -> Color {
    BAR_COLORS[at % BAR_COLORS.len()]
}

/// The guide whose yarn stands for its bar: the first threaded one, counted from the drive. A weft
/// has no guide, and all wefts are drawn.
fn drawn_guide(bar: &Bar) -> i64 {
    if bar.lay == Lay::Weft {
        return 0;
    }
    let step = if bar.counts_from_left() { -1 } else { 1 };
    (0..i64::from(index32(bar.threading.repeat())))
        .map(|guide| guide * step)
        .find(|&guide| bar.threading.carries(guide))
        .expect("a threading holds a yarn")
}

/// The range of gaps that the drawn yarns of all bars pass.
fn reach(bars: &[Bar]) -> Range<i64> {
    let gaps = bars.iter().map(|bar| {
        let ((low, high), guide) = (bar.gaps(), drawn_guide(bar));
        (guide + i64::from(low), guide + i64::from(high))
    });
    let (low, high) = gaps.fold((0, 0), |(low, high), (l, h)| (low.min(l), high.max(h)));
    low..high
}

/// Lanes that keep the bars' paths apart, so that none hides another.
fn lanes(bars: &[Bar], pitch: Pitch) -> Vec<Lane> {
    let number = |count: usize| f64::from(index32(count));
    // Overlaps of several bars are nested around the same dot, each a step farther out. The steps
    // shrink with the number of bars, since the outermost must not reach the next needle.
    let knitting = bars.iter().filter(|bar| !bar.is_inlay()).count();
    let (nearest, farthest) = (0.19 * pitch.across, CORNER * pitch.across);
    let leg_step =
        (0.09 * pitch.across).min((farthest - nearest) / number(knitting.saturating_sub(1).max(1)));
    let aside_step = (0.1 * pitch.across).min(0.24 * pitch.across / number(bars.len()));
    let mut nested = 0;
    let mut lanes = Vec::with_capacity(bars.len());
    for (at, bar) in bars.iter().enumerate() {
        let leg = nearest + leg_step * number(nested);
        nested += usize::from(!bar.is_inlay());
        // In gaps and bands the paths lie side by side, centred on the middle.
        let aside = aside_step * (number(at) - number(bars.len() - 1) / 2.0);
        lanes.push(Lane { leg, aside });
    }
    lanes
}

/// One line for each thing that is left out.
fn notes(fabric: &Fabric, sheet: &LappingSheet, reach: &Range<i64>) -> Vec<String> {
    let mut notes = Vec::new();
    let repeat = fabric.repeat();
    if sheet.courses < 2 * repeat {
        notes.push(format!(
            "the first {} courses of two repeats of {repeat} are drawn",
            sheet.courses
        ));
    }
    if reach.start < sheet.gaps.start || reach.end > sheet.gaps.end {
        let gaps = reach.end - reach.start + 1;
        notes.push(format!(
            "the lapping reaches over {gaps} gaps; {} are drawn",
            sheet.gaps.end - sheet.gaps.start + 1
        ));
    }
    if sheet.bars < fabric.yarn_systems() {
        notes.push(format!("the first {} of {} bars are drawn", sheet.bars, fabric.yarn_systems()));
    }
    notes
}

impl LappingSheet {
    /// Lays out the sheet for some bars whose yarns pass the gaps of `reach`.
    fn new(fabric: &Fabric, bars: &[Bar], reach: &Range<i64>) -> Self {
        // More bars need wider gaps between the dots.
        let roomy = 4.0 * f64::from(index32(bars.len().clamp(2, 7) - 2));
        let pitch = Pitch { across: 44.0 + roomy, along: 56.0 + roomy };
        // One more needle on each side shows how the pattern continues.
        let (mut low, mut high) = (reach.start - 1, reach.end + 1);
        if high - low > MOST_NEEDLES {
            (low, high) =
                if high > 1 { (low, low + MOST_NEEDLES) } else { (high - MOST_NEEDLES, high) };
        }
        let courses = (2 * fabric.repeat()).clamp(LEAST_COURSES, MOST_COURSES);
        let heading =
            TextSize::Title.width(&shortened(&fabric.name)).max(TextSize::Small.width(VIEW));
        let words = words_of(fabric, bars)
            .map(|(text, indent)| TextSize::Normal.width(&text) + indent)
            .fold(heading, f64::max);
        let diagram = whole(high - low) * pitch.across + COURSE_NUMBERS;
        let width = 2.0 * MARGIN + diagram.max(words);
        let first_course =
            MARGIN + HEADING + whole(index32(courses).into()) * pitch.along - 0.5 * pitch.along;
        let lines = f64::from(index32(bars.len()));
        let height = first_course + 0.5 * pitch.along + GAP_NUMBERS + lines * LEGEND_ROW + MARGIN;
        // Long words make the sheet wider than the diagram, which then stands in its middle.
        let left = MARGIN + COURSE_NUMBERS + (width - 2.0 * MARGIN - diagram) / 2.0;
        let origin = DVec2::new(left + whole(high) * pitch.across, first_course);
        Self {
            pitch,
            gaps: low..high,
            courses,
            origin,
            bars: bars.len(),
            size: DVec2::new(width, height),
        }
    }

    /// A place of the point paper on the sheet. Gaps count to the left, courses upward.
    fn at(&self, gap: f64, course: f64) -> DVec2 {
        self.origin - DVec2::new(gap * self.pitch.across, course * self.pitch.along)
    }

    /// x of the diagram's left side.
    fn left(&self) -> f64 {
        self.at(whole(self.gaps.end), 0.0).x
    }

    /// x of the diagram's right side.
    fn right(&self) -> f64 {
        self.at(whole(self.gaps.start), 0.0).x
    }

    /// The needles' dots.
    fn needles(&self) -> DrawingLayer {
        let row = |course: usize| {
            self.gaps.clone().map(move |gap| DrawingShape::Dot {
                at: self.at(whole(gap) + 0.5, f64::from(index32(course))),
                radius: DOT,
            })
        };
        DrawingLayer {
            name: "needles".to_owned(),
            color: INK,
            shapes: (0..self.courses).flat_map(row).collect(),
        }
    }

    /// A line across the whole diagram.
    fn level_line(&self, y: f64, width: f64) -> DrawingShape {
        let segments = vec![
            PathSegment::Move(DVec2::new(self.left(), y)),
            PathSegment::Line(DVec2::new(self.right(), y)),
        ];
        DrawingShape::Path { segments, width }
    }

    /// A thin line where one repeat ends and the next begins.
    fn repeats(&self, repeat: usize) -> DrawingLayer {
        let shapes = (repeat..self.courses)
            .step_by(repeat)
            .map(|course| self.at(0.0, f64::from(index32(course)) - 0.5).y)
            .map(|y| self.level_line(y, 1.0))
            .collect();
        DrawingLayer { name: "repeats".to_owned(), color: HAIR, shapes }
    }

    /// The part of a guide's yarn that lies on the sheet.
    fn yarn(&self, bar: &Bar, guide: i64, lane: Lane, width: f64) -> Vec<DrawingShape> {
        let Lay::Lapping(chain) = &bar.lay else { return self.wefts(bar, lane, width) };
        let corners = waypoints(chain, guide, index32(self.courses).into(), self.pitch, lane);
        let corners: Vec<_> =
            corners.into_iter().map(|point| self.origin + DVec2::new(point.x, -point.y)).collect();
        let parts = clipped(&corners, self.left(), self.right());
        let segments: Vec<_> =
            parts.iter().flat_map(|part| rounded(part, CORNER * self.pitch.across)).collect();
        if segments.is_empty() { Vec::new() } else { vec![DrawingShape::Path { segments, width }] }
    }

    /// The wefts of a bar: straight lines through all gaps, above the needles of their course. A
    /// weft's threading says which courses have one.
    fn wefts(&self, bar: &Bar, lane: Lane, width: f64) -> Vec<DrawingShape> {
        (0..self.courses)
            .filter(|&course| bar.threading.carries(i64::from(index32(course))))
            .map(|course| self.at(0.0, f64::from(index32(course)) + 0.5).y + lane.aside)
            .map(|y| self.level_line(y, width))
            .collect()
    }

    /// The other yarns of a bar, thin and pale.
    fn neighbours(&self, at: usize, bar: &Bar, chain: &Chain, lane: Lane) -> DrawingLayer {
        let (low, high) = chain.gaps();
        let touching = self.gaps.start - i64::from(high)..=self.gaps.end - i64::from(low);
        let drawn = drawn_guide(bar);
        let others = touching.filter(|&guide| guide != drawn && bar.threading.carries(guide));
        let shapes = others.flat_map(|guide| self.yarn(bar, guide, lane, NEIGHBOUR)).collect();
        let pale = bar_color(at).0.map(|byte| 255 - (255 - byte) / 3);
        DrawingLayer { name: format!("bar-{}-neighbours", at + 1), color: Color(pale), shapes }
    }

    /// The numbers of the gaps, counted from the drive.
    fn gap_numbers(&self, bars: &[Bar]) -> DrawingLayer {
        let from_left = bars.iter().all(Bar::counts_from_left);
        let y = self.origin.y + 0.5 * self.pitch.along + 18.0;
        let mut shapes = Vec::new();
        for gap in self.gaps.start + 1..self.gaps.end {
            let number = if from_left { -gap } else { gap };
            let at = DVec2::new(self.at(whole(gap), 0.0).x, y);
            shapes.push(label(at, number.to_string(), Anchor::Middle));
        }
        shapes.push(label(DVec2::new(self.left() - 14.0, y), "gap".to_owned(), Anchor::End));
        DrawingLayer { name: "gaps".to_owned(), color: FAINT, shapes }
    }

    /// The numbers of the courses within their repeat.
    fn course_numbers(&self, repeat: usize) -> DrawingLayer {
        let mut shapes = Vec::new();
        for course in 0..self.courses {
            let y = self.at(0.0, f64::from(index32(course))).y + 4.0;
            let at = DVec2::new(self.left() - 14.0, y);
            shapes.push(label(at, (course % repeat + 1).to_string(), Anchor::End));
        }
        DrawingLayer { name: "courses".to_owned(), color: FAINT, shapes }
    }

    /// The heading and the legend.
    fn words(&self, fabric: &Fabric, bars: &[Bar], notes: &[String]) -> Vec<DrawingLayer> {
        let line = |y: f64, indent: f64, text: &str, size| {
            let at = DVec2::new(MARGIN + indent, y);
            DrawingShape::Text { at, text: shortened(text), size, anchor: Anchor::Start }
        };
        let title = line(MARGIN + 14.0, 0.0, &fabric.name, TextSize::Title);
        let mut legend = self.origin.y + 0.5 * self.pitch.along + GAP_NUMBERS + LEGEND_ROW;
        let mut samples = Vec::new();
        let mut texts = vec![title];
        for (at, (text, indent)) in words_of(fabric, bars).enumerate() {
            let ends = [0.0, SAMPLE - 8.0].map(|x| DVec2::new(MARGIN + x, legend - 4.0));
            let segments = vec![PathSegment::Move(ends[0]), PathSegment::Line(ends[1])];
            let name = format!("legend-{}", at + 1);
            samples.push(DrawingLayer {
                name,
                color: bar_color(at),
                shapes: vec![DrawingShape::Path { segments, width: YARN + 0.6 }],
            });
            texts.push(line(legend, indent, &text, TextSize::Normal));
            legend += LEGEND_ROW;
        }
        let view = line(MARGIN + 34.0, 0.0, VIEW, TextSize::Small);
        let mut faint = vec![view];
        for (at, note) in notes.iter().enumerate() {
            faint.push(line(
                legend + f64::from(index32(at)) * NOTE_ROW,
                0.0,
                note,
                TextSize::Small,
            ));
        }
        samples.push(DrawingLayer { name: "text".to_owned(), color: INK, shapes: texts });
        samples.push(DrawingLayer { name: "notes".to_owned(), color: FAINT, shapes: faint });
        samples
    }
}

const VIEW: &str = "seen from the technical back, course 1 below";

/// The legend's lines, each with its indent in px.
fn words_of<'a>(fabric: &'a Fabric, bars: &'a [Bar]) -> impl Iterator<Item = (String, f64)> + 'a {
    let widest = bars.iter().map(|bar| bar.lapping().len().min(MOST_OF_CHAIN)).max().unwrap_or(0);
    let several = fabric.yarn_systems() > 9;
    bars.iter().enumerate().map(move |(at, bar)| {
        let number = if several { format!("{:2}", at + 1) } else { (at + 1).to_string() };
        let drive = if bar.counts_from_left() { "  drive left" } else { "" };
        // Gap numbers hold for guide 0; another guide's gaps are shifted by its number.
        let guide = match drawn_guide(bar).abs() {
            0 => String::new(),
            guide => format!("  (guide {}: gaps + {guide})", guide + 1),
        };
        let chain = cut(&bar.lapping(), MOST_OF_CHAIN);
        let threading = cut(&bar.written_threading().to_string(), MOST_OF_THREADING);
        (shortened(&format!("bar {number}  {chain:widest$}  {threading}{guide}{drive}")), SAMPLE)
    })
}

#[expect(clippy::cast_precision_loss, reason = "gaps and courses of a sheet are few")]
fn whole(number: i64) -> f64 {
    number as f64
}
