//! The sheet of a lapping diagram: what is shown, where it lies, and its labels.

use std::ops::Range;

use glam::DVec2;

use super::path::{Lane, Piece, Pitch, clipped, rounded, waypoints};
use super::{
    Anchor, Drawing, FAINT, HAIR, HEADING, INK, Layer, MARGIN, Shape, TextSize, cut, label,
    shortened,
};
use warpknit_core::fabric::lapping::Chain;
use warpknit_core::fabric::yarn::Color;
use warpknit_core::fabric::{Bar, Fabric, Lay, WarpKnit};
use warpknit_core::ids::index32;

/// The most needles, courses and bars on a sheet: a PNG of that size still takes less than 200 MB
/// to paint.
const MOST_NEEDLES: i64 = 40;
const MOST_COURSES: usize = 40;
const MOST_BARS: usize = 24;
/// The least courses: fewer do not show how laps join.
const LEAST_COURSES: usize = 4;
/// The most characters of a chain and a threading in the legend, which may have thousands.
const MOST_OF_CHAIN: usize = 48;
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

// The sheet, px.
/// Sides of the largest rounding, over the needles' pitch: as much as the widest overlap takes.
const CORNER: f64 = 0.34;
const COURSE_NUMBERS: f64 = 44.0;
const GAP_NUMBERS: f64 = 34.0;
const LEGEND_ROW: f64 = 20.0;
const NOTE_ROW: f64 = 16.0;
const SAMPLE: f64 = 26.0;
const DOT: f64 = 3.2;
const YARN: f64 = 2.4;
const NEIGHBOUR: f64 = 1.0;

/// Where things lie.
struct Sheet {
    pitch: Pitch,
    /// Gaps that are shown.
    gaps: Range<i64>,
    courses: usize,
    /// Gap 0 of guide 0 at the first course, px of the sheet.
    origin: DVec2,
    bars: usize,
    size: DVec2,
}

pub(super) fn draw(fabric: &Fabric, knit: &WarpKnit) -> Drawing {
    let bars = &knit.bars[..knit.bars.len().min(MOST_BARS)];
    let reach = reach(bars);
    let mut sheet = Sheet::new(fabric, bars, &reach);
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
        layers.push(Layer { name: format!("bar-{}", at + 1), color: bar_color(at), shapes });
    }
    layers.push(sheet.gap_numbers(bars));
    layers.push(sheet.course_numbers(fabric.repeat()));
    layers.extend(sheet.words(fabric, bars, &notes));
    Drawing { size: sheet.size, layers, notes }
}

fn bar_color(at: usize) -> Color {
    BAR_COLORS[at % BAR_COLORS.len()]
}

/// The guide whose yarn stands for its bar: the first threaded one from the drive. Wefts have none
/// and are all drawn.
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

/// The gaps that the drawn yarns pass, all bars together.
fn reach(bars: &[Bar]) -> Range<i64> {
    let gaps = bars.iter().map(|bar| {
        let ((low, high), guide) = (bar.gaps(), drawn_guide(bar));
        (guide + i64::from(low), guide + i64::from(high))
    });
    let (low, high) = gaps.fold((0, 0), |(low, high), (l, h)| (low.min(l), high.max(h)));
    low..high
}

/// Lanes in which no bar hides another.
fn lanes(bars: &[Bar], pitch: Pitch) -> Vec<Lane> {
    let number = |count: usize| f64::from(index32(count));
    let knitting = bars.iter().filter(|bar| !bar.is_inlay()).count();
    let (nearest, farthest) = (0.19 * pitch.across, CORNER * pitch.across);
    let leg_step =
        (0.09 * pitch.across).min((farthest - nearest) / number(knitting.saturating_sub(1).max(1)));
    let aside_step = (0.1 * pitch.across).min(0.24 * pitch.across / number(bars.len()));
    let mut nested = 0;
    let lane = |(at, bar): (usize, &Bar)| {
        let leg = nearest + leg_step * number(nested);
        nested += usize::from(!bar.is_inlay());
        Lane { leg, aside: aside_step * (number(at) - number(bars.len() - 1) / 2.0) }
    };
    bars.iter().enumerate().map(lane).collect()
}

fn notes(fabric: &Fabric, sheet: &Sheet, reach: &Range<i64>) -> Vec<String> {
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

impl Sheet {
    fn new(fabric: &Fabric, bars: &[Bar], reach: &Range<i64>) -> Self {
        // More bars need wider gaps between the dots.
        let roomy = 4.0 * f64::from(index32(bars.len().clamp(2, 7) - 2));
        let pitch = Pitch { across: 44.0 + roomy, along: 56.0 + roomy };
        // A needle more on each side shows where the pattern goes on.
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
        // The diagram stands in the middle of a sheet that its words make wider.
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

    /// A place of the point paper, gaps to the left and courses up.
    fn at(&self, gap: f64, course: f64) -> DVec2 {
        self.origin - DVec2::new(gap * self.pitch.across, course * self.pitch.along)
    }

    fn left(&self) -> f64 {
        self.at(whole(self.gaps.end), 0.0).x
    }

    fn right(&self) -> f64 {
        self.at(whole(self.gaps.start), 0.0).x
    }

    fn needles(&self) -> Layer {
        let row = |course: usize| {
            self.gaps.clone().map(move |gap| Shape::Dot {
                at: self.at(whole(gap) + 0.5, f64::from(index32(course))),
                radius: DOT,
            })
        };
        Layer {
            name: "needles".to_owned(),
            color: INK,
            shapes: (0..self.courses).flat_map(row).collect(),
        }
    }

    /// A hairline where one repeat ends and the next begins.
    fn repeats(&self, repeat: usize) -> Layer {
        let line = |course: usize| {
            let y = self.at(0.0, f64::from(index32(course)) - 0.5).y;
            let pieces = vec![
                Piece::Move(DVec2::new(self.left(), y)),
                Piece::Line(DVec2::new(self.right(), y)),
            ];
            Shape::Path { pieces, width: 1.0 }
        };
        let shapes = (repeat..self.courses).step_by(repeat).map(line).collect();
        Layer { name: "repeats".to_owned(), color: HAIR, shapes }
    }

    /// The yarn of one guide, as far as it lies on the sheet.
    fn yarn(&self, bar: &Bar, guide: i64, lane: Lane, width: f64) -> Vec<Shape> {
        let Lay::Lapping(chain) = &bar.lay else { return self.wefts(bar, lane, width) };
        let corners = waypoints(chain, guide, index32(self.courses).into(), self.pitch, lane);
        let corners: Vec<_> =
            corners.into_iter().map(|point| self.origin + DVec2::new(point.x, -point.y)).collect();
        let parts = clipped(&corners, self.left(), self.right());
        let pieces: Vec<_> =
            parts.iter().flat_map(|part| rounded(part, CORNER * self.pitch.across)).collect();
        if pieces.is_empty() { Vec::new() } else { vec![Shape::Path { pieces, width }] }
    }

    /// The wefts of a bar: straight through all gaps, above the needles of their course.
    fn wefts(&self, bar: &Bar, lane: Lane, width: f64) -> Vec<Shape> {
        let courses =
            (0..self.courses).filter(|&course| bar.threading.carries(i64::from(index32(course))));
        let line = |course: usize| {
            let y = self.at(0.0, f64::from(index32(course)) + 0.5).y + lane.aside;
            let pieces = vec![
                Piece::Move(DVec2::new(self.left(), y)),
                Piece::Line(DVec2::new(self.right(), y)),
            ];
            Shape::Path { pieces, width }
        };
        courses.map(line).collect()
    }

    /// The other yarns of a bar, thin and pale.
    fn neighbours(&self, at: usize, bar: &Bar, chain: &Chain, lane: Lane) -> Layer {
        let (low, high) = chain.gaps();
        let touching = self.gaps.start - i64::from(high)..=self.gaps.end - i64::from(low);
        let drawn = drawn_guide(bar);
        let others = touching.filter(|&guide| guide != drawn && bar.threading.carries(guide));
        let shapes = others.flat_map(|guide| self.yarn(bar, guide, lane, NEIGHBOUR)).collect();
        let pale = bar_color(at).0.map(|byte| 255 - (255 - byte) / 3);
        Layer { name: format!("bar-{}-neighbours", at + 1), color: Color(pale), shapes }
    }

    fn gap_numbers(&self, bars: &[Bar]) -> Layer {
        let from_left = bars.iter().all(Bar::counts_from_left);
        let number = |gap: i64| if from_left { -gap } else { gap };
        let y = self.origin.y + 0.5 * self.pitch.along + 18.0;
        let text = |gap: i64| {
            label(
                DVec2::new(self.at(whole(gap), 0.0).x, y),
                number(gap).to_string(),
                Anchor::Middle,
            )
        };
        let gaps = self.gaps.start + 1..self.gaps.end;
        let mut shapes: Vec<_> = gaps.map(text).collect();
        shapes.push(label(DVec2::new(self.left() - 14.0, y), "gap".to_owned(), Anchor::End));
        Layer { name: "gaps".to_owned(), color: FAINT, shapes }
    }

    fn course_numbers(&self, repeat: usize) -> Layer {
        let x = self.left() - 14.0;
        let place = |course: usize| DVec2::new(x, self.at(0.0, f64::from(index32(course))).y + 4.0);
        let number =
            |course: usize| label(place(course), (course % repeat + 1).to_string(), Anchor::End);
        Layer {
            name: "courses".to_owned(),
            color: FAINT,
            shapes: (0..self.courses).map(number).collect(),
        }
    }

    /// The heading and the legend.
    fn words(&self, fabric: &Fabric, bars: &[Bar], notes: &[String]) -> Vec<Layer> {
        let line = |y: f64, indent: f64, text: &str, size| {
            let at = DVec2::new(MARGIN + indent, y);
            Shape::Text { at, text: shortened(text), size, anchor: Anchor::Start }
        };
        let title = line(MARGIN + 14.0, 0.0, &fabric.name, TextSize::Title);
        let mut legend = self.origin.y + 0.5 * self.pitch.along + GAP_NUMBERS + LEGEND_ROW;
        let mut samples = Vec::new();
        let mut texts = vec![title];
        for (at, (text, indent)) in words_of(fabric, bars).enumerate() {
            let ends = [0.0, SAMPLE - 8.0].map(|x| DVec2::new(MARGIN + x, legend - 4.0));
            let pieces = vec![Piece::Move(ends[0]), Piece::Line(ends[1])];
            let name = format!("legend-{}", at + 1);
            samples.push(Layer {
                name,
                color: bar_color(at),
                shapes: vec![Shape::Path { pieces, width: YARN + 0.6 }],
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
        samples.push(Layer { name: "text".to_owned(), color: INK, shapes: texts });
        samples.push(Layer { name: "notes".to_owned(), color: FAINT, shapes: faint });
        samples
    }
}

const VIEW: &str = "seen from the technical back, course 1 below";

/// The legend's lines, with how far they are set in.
fn words_of<'a>(fabric: &'a Fabric, bars: &'a [Bar]) -> impl Iterator<Item = (String, f64)> + 'a {
    let widest = bars.iter().map(|bar| bar.lapping().len().min(MOST_OF_CHAIN)).max().unwrap_or(0);
    let several = fabric.yarn_systems() > 9;
    bars.iter().enumerate().map(move |(at, bar)| {
        let number = if several { format!("{:2}", at + 1) } else { (at + 1).to_string() };
        let drive = if bar.counts_from_left() { "  drive left" } else { "" };
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
