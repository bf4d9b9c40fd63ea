//! `layout.toml`: the cell and its segments, which a person may change and give back.
//!
//! In: text, or [`Captured`]. Out: [`GivenLayout`] with each error at its line, or text that reads
//! back as the same.
//!
//! Not promised: a check that a given layout suits the photo; its fit and its warnings tell that.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::Captured;
use super::segment::Segment;

/// Segments of a given layout, at most.
const MOST_SEGMENTS: usize = 64;
/// The longest segment, in lengths of the cell's longer vector.
const MOST_CELLS: f64 = 10.0;
/// Largest absolute value of lengths and places, pixels.
const MOST_LENGTH: f64 = 16_384.0;
/// Largest absolute value of lightness, in units of the photo's contrast.
const MOST_LIGHT: f64 = 1000.0;

/// A cell and its segments as a person gives them, pixels of the photo.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenLayout {
    /// Both vectors.
    pub cell: [DVec2; 2],
    /// Lightness of the ground.
    pub ground: f64,
    /// One copy of each, relative to a cell's corner.
    pub segments: Vec<Segment>,
}

/// Why a layout file can't be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct GivenLayoutError {
    /// The line of the file, from 1.
    pub line: usize,
    /// What is wrong there, in one line.
    pub what: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LayoutFile {
    cell: toml::Spanned<CellTable>,
    #[serde(default)]
    segments: Vec<toml::Spanned<SegmentTable>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CellTable {
    a: [f64; 2],
    b: [f64; 2],
    ground: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SegmentTable {
    center: [f64; 2],
    angle_deg: f64,
    width: f64,
    length: f64,
    top: f64,
    round: f64,
    sag: f64,
    #[serde(default)]
    tilt: f64,
    #[serde(default)]
    bow: f64,
    #[serde(default)]
    sway: f64,
}

impl GivenLayout {
    /// Reads a layout.
    ///
    /// ```
    /// use warpknit_photo::capture::GivenLayout;
    /// let text = "[cell]\na = [20, 0]\nb = [0, 10]\nground = -1\n[[segments]]\n\
    ///     center = [5, 5]\nangle_deg = 90\nwidth = 4\nlength = 9\n\
    ///     top = 1\nround = 0.5\nsag = 0.2\n";
    /// assert_eq!(GivenLayout::parse(text)?.segments.len(), 1);
    /// assert_eq!(GivenLayout::parse("[cell]\na = 3\n").unwrap_err().line, 2);
    /// # Ok::<(), warpknit_photo::capture::GivenLayoutError>(())
    /// ```
    ///
    /// # Errors
    /// [`GivenLayoutError`], with its line.
    pub fn parse(text: &str) -> Result<Self, GivenLayoutError> {
        let file: LayoutFile = toml::from_str(text).map_err(|error| GivenLayoutError {
            line: error.span().map_or(1, |span| line_at(text, span.start)),
            what: error.message().split_whitespace().collect::<Vec<_>>().join(" "),
        })?;
        if file.segments.len() > MOST_SEGMENTS {
            let what = format!(
                "{} segments are too many: at most {MOST_SEGMENTS} lie in a cell",
                file.segments.len()
            );
            let first_too_many = file.segments[MOST_SEGMENTS].span().start;
            return Err(GivenLayoutError { line: line_at(text, first_too_many), what });
        }
        let &CellTable { a, b, ground } = file.cell.get_ref();
        file.cell.get_ref().check().map_err(|what| GivenLayoutError {
            line: line_at(text, file.cell.span().start),
            what: what.to_owned(),
        })?;
        let longer = DVec2::from(a).length().max(DVec2::from(b).length());
        let mut segments = Vec::with_capacity(file.segments.len());
        for table in &file.segments {
            table.get_ref().check(longer).map_err(|what| GivenLayoutError {
                line: line_at(text, table.span().start),
                what: what.to_owned(),
            })?;
            segments.push(table.get_ref().segment());
        }
        Ok(Self { cell: [a.into(), b.into()], ground, segments })
    }
}

/// The line of a byte of a text, from 1.
fn line_at(text: &str, byte: usize) -> usize {
    1 + text[..byte.min(text.len())].matches('\n').count()
}

/// Whether a number is no lightness that a layout may have, NaN included.
fn is_no_light(light: f64) -> bool {
    light.is_nan() || light.abs() > MOST_LIGHT
}

impl CellTable {
    /// What is wrong with the cell, if anything is.
    fn check(&self) -> Result<(), &'static str> {
        if ![self.a, self.b].concat().iter().all(|number| number.abs() <= MOST_LENGTH) {
            return Err("the cell's numbers are no pixels of a photo");
        }
        if is_no_light(self.ground) {
            return Err("ground is to be a share of the picture's contrast, -1000 to 1000 and \
                        mostly about -1");
        }
        Ok(())
    }
}

impl SegmentTable {
    /// What is wrong with a segment in a cell whose longer vector has that length, if anything is.
    /// The comparisons are such that NaN fails each of them.
    fn check(&self, longer: f64) -> Result<(), &'static str> {
        let mut places = self.center.iter().chain([&self.angle_deg]);
        if !places.all(|number| number.abs() <= MOST_LENGTH) {
            return Err("a segment lies nowhere near the cell");
        }
        let most_size = MOST_CELLS * longer;
        if ![self.width, self.length].iter().all(|size| *size > 0.0 && *size <= most_size) {
            return Err(
                "a segment's width and length are to be over 0 pixels, and under ten cells",
            );
        }
        let mut shares = [self.top, self.round, self.sag].into_iter();
        if !shares.all(|light| (0.0..=MOST_LIGHT).contains(&light)) || is_no_light(self.tilt) {
            return Err(
                "top, round and sag are shares of the picture's contrast, 0 to a few, and \
                        tilt may be under 0",
            );
        }
        if ![self.bow, self.sway].iter().all(|offset| offset.abs() <= self.length) {
            return Err(
                "bow and sway are pixels, and a segment bends less far aside than it is long",
            );
        }
        Ok(())
    }

    pub(super) fn new(segment: &Segment) -> Self {
        let Segment { centre, angle, width, length, top, round, sag, tilt, bow, sway } = *segment;
        let degrees = angle.to_degrees().rem_euclid(360.0);
        // The conversion rounds. One of the neighbouring numbers usually reads back as exactly this
        // angle, so that a layout which is given back stays as it was.
        let angle_deg = [degrees, degrees.next_up(), degrees.next_down()]
            .into_iter()
            .find(|degrees| degrees.to_radians() == angle)
            .unwrap_or(degrees);
        Self {
            center: centre.to_array(),
            angle_deg,
            width,
            length,
            top,
            round,
            sag,
            tilt,
            bow,
            sway,
        }
    }

    fn segment(&self) -> Segment {
        let Self { center, angle_deg, width, length, top, round, sag, tilt, bow, sway } = *self;
        Segment {
            centre: center.into(),
            angle: angle_deg.to_radians(),
            width,
            length,
            top,
            round,
            sag,
            tilt,
            bow,
            sway,
        }
    }
}

impl Captured {
    /// The text of `layout.toml`. Its numbers read back as the same.
    ///
    /// # Panics
    /// Never: numbers are TOML.
    #[must_use]
    pub fn layout_text(&self) -> String {
        let Self { unit, layout, .. } = self;
        let cell = CellTable {
            a: unit.lattice.a.to_array(),
            b: unit.lattice.b.to_array(),
            ground: layout.ground,
        };
        let cell = toml::Spanned::new(0..0, cell);
        let segments = layout
            .segments
            .iter()
            .map(|segment| toml::Spanned::new(0..0, SegmentTable::new(segment)))
            .collect();
        let tables = toml::to_string(&LayoutFile { cell, segments }).expect("numbers are TOML");
        format!(
            "# The yarns of a cloth's cell, by warpknit capture. Pixels of the photo, y down; top, \
         round, sag, tilt and ground are lightness, 1 about the photo's contrast.\n\
         # Segments go on below others, and the grid shows what is seen of them. Change, add or \
         delete some and give this file to capture with --layout.\n{tables}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WHOLE: &str = "[cell]\na = [20, 0]\nb = [0, 10]\nground = -1\n[[segments]]\n\
        center = [5, 5]\nangle_deg = 90\nwidth = 4\nlength = 9\ntop = 1\nround = 0.5\nsag = 0.2\n";

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (from, to, line, part) in [
            ("width = 4", "width = 0", 5, "over 0 pixels"),
            ("length = 9", "length = 900", 5, "ten cells"),
            ("center = [5, 5]", "center = [5, nan]", 5, "nowhere near"),
            ("top = 1", "top = 1e9", 5, "0 to a few"),
            ("sag = 0.2", "sag = -30", 5, "0 to a few"),
            ("sag = 0.2", "sag = 0.2\ntilt = nan", 5, "tilt may be"),
            ("sag = 0.2", "sag = inf", 5, "0 to a few"),
            ("sag = 0.2", "sag = 0.2\nbow = 1e300", 5, "bow and sway"),
            ("sag = 0.2", "sag = 0.2\nsway = nan", 5, "bow and sway"),
            ("a = [20, 0]", "a = [inf, 0]", 1, "no pixels"),
            ("sag", "sga", 12, "sga"),
            ("[cell]", "[cel]", 1, "cel"),
        ] {
            let error = GivenLayout::parse(&WHOLE.replace(from, to)).unwrap_err();
            assert!(
                error.line == line && error.what.contains(part) && !error.what.contains('\n'),
                "{to}: {error}"
            );
        }
        let many = WHOLE.to_owned() + &WHOLE[WHOLE.find("[[").unwrap()..].repeat(MOST_SEGMENTS);
        assert!(GivenLayout::parse(&many).unwrap_err().what.starts_with("65 segments"));
    }

    proptest! {
        #[test]
        fn garbage_is_an_error_in_one_line(at in 0..WHOLE.len(), garbage in "[\\x00-\\x7f]{0,8}") {
            let mut text = WHOLE.to_owned();
            text.replace_range(at..(at + garbage.len()).min(text.len()), &garbage);
            if let Err(error) = GivenLayout::parse(&text) {
                let lines = 1 + text.matches('\n').count();
                prop_assert!(!error.to_string().contains(['\n', '\r']) && error.line <= lines);
            }
        }
    }
}
