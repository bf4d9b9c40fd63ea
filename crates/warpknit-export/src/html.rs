//! The cloth as one web page that anyone can open: yarns to turn and to zoom into, with the fabric's
//! numbers beside them.
//!
//! In: blocks of draped yarns. Out: HTML with everything in it: the yarns' centre lines, quantised
//! and deflated (`html_lines`), the program that shows them and its shaders (`assets/`). A
//! browser of 2023 or later shows it by WebGL 2, and nothing is fetched. Tubes are made on the
//! graphics card, and from afar ribbons that face the eye, which a software driver draws three to
//! five times faster.
//!
//! The grid of the coordinates is as large as the cloth, so all points are in memory, 20 bytes each,
//! until the end. That and the browser's memory are why a page is limited.
//!
//! Not promised: textures. Yarns have their bar's colour, and section and caps don't count.

use std::io::{self, BufWriter, Seek, Write};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use glam::Vec3;
use serde_json::json;

use super::base64::Base64;
use super::html_lines::{CentreLines, PageGrid};
use super::{ClothInfo, Destination, ExportError, Facts, Sink, StrandStyle};
use warpknit_core::drape::Block;
use warpknit_core::number::narrow;

/// The most stitches of a page. A page of as many takes some 20 MB.
pub const MOST_STITCHES: u64 = 500_000;
/// The most points: what fits in a texture that every WebGL 2 has, 2048 by 8192, with room to
/// spare. Only fibres come near it.
const MOST_POINTS: u64 = 12_000_000;

/// What the page is made of, with names in double braces where something is put in.
const PAGE: &str = include_str!("../assets/page.html");
const STYLE: &str = include_str!("../assets/page.css");
const SCRIPT: &str = include_str!("../assets/page.js");
const VERTEX: &str = include_str!("../assets/yarn.vert");
const FRAGMENT: &str = include_str!("../assets/yarn.frag");

/// Writes a page.
#[derive(Debug)]
pub struct HtmlWriter<W> {
    target: Destination<W>,
    name: String,
    styles: Vec<StrandStyle>,
    facts: Facts,
    /// Whether the page has fibres in the place of yarns.
    has_fibres: bool,
    stitches: u64,
    lines: CentreLines,
}

impl<W: Write + Seek + Send> HtmlWriter<W> {
    /// Starts the page of a cloth, with its [`ClothInfo::facts`].
    ///
    /// # Errors
    /// None: nothing is written before the end.
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        Ok(Self {
            target,
            name: cloth.name.clone(),
            styles: cloth.strands.clone(),
            facts: cloth.facts.clone(),
            has_fibres: !cloth.bundles.is_empty(),
            stitches: 0,
            lines: CentreLines::default(),
        })
    }

    /// Refuses more than a page holds.
    fn check(&self) -> Result<(), ExportError> {
        let counts = [
            (self.stitches, "stitches", MOST_STITCHES),
            (self.lines.points() as u64, "points of yarn", MOST_POINTS),
        ];
        match counts.into_iter().find(|(count, _, most)| count > most) {
            Some((count, what, most)) => {
                Err(ExportError::PageTooLarge { path: self.target.error_path(), count, what, most })
            }
            None => Ok(()),
        }
    }

    /// The mean colours of what is seen of the front and of the back, linear.
    fn colors_from_afar(&self) -> [[f32; 3]; 2] {
        self.facts.visible_shares.each_ref().map(|shares| {
            let colors = self.styles.iter().map(|style| Vec3::from_array(style.color.linear()));
            let sum: Vec3 = colors.zip(shares).map(|(color, share)| color * narrow(*share)).sum();
            sum.to_array()
        })
    }

    /// What the script needs to know besides the yarns' points.
    fn cloth(&self, grid: &PageGrid) -> String {
        let bars = self.styles.iter().enumerate().map(|(bar, style)| {
            let own = self.facts.systems.get(bar);
            json!({
                "name": own.map_or(&style.name, |own| &own.name),
                "facts": own.map_or(&[][..], |own| &own.facts),
                "color": style.color.linear(),
                "shown": style.color.to_string(),
                "radius": style.radius_f32(),
            })
        });
        let cloth = json!({
            "about": self.facts.about,
            "bars": bars.collect::<Vec<_>>(),
            "facts": self.facts.cloth,
            "cover": self.facts.cover,
            // Fibres lie in yarns nearly at random.
            "optical_depth": self.facts.depth_of_yarns.filter(|_| !self.has_fibres).unwrap_or(1.0),
            "colors_from_afar": self.colors_from_afar(),
            "repeat": self.facts.repeat.filter(|_| !self.has_fibres),
            "points": self.lines.points(),
            "strands": self.lines.strands(),
            "runs": self.lines.runs(),
            "low": grid.low.to_array(),
            "step": grid.step,
            "heights": grid.heights,
        });
        // A fabric's name could end the element that holds this, if it had this letter.
        cloth.to_string().replace('<', "\\u003c")
    }
}

impl<W: Write + Seek + Send> Sink<W> for HtmlWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        for block in blocks {
            self.stitches += block.knitted.stitches.len() as u64;
            self.lines.add(block);
            self.check()?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        let radius = self.styles.iter().map(StrandStyle::radius_f32).fold(f32::INFINITY, f32::min);
        let grid = self.lines.grid(if radius.is_finite() { radius } else { 1.0 });
        let (cloth, title) = (self.cloth(&grid), escaped(&self.name));
        let lines = &self.lines;
        self.target.write_with(|target| {
            let mut target = BufWriter::new(target);
            let mut parts = PAGE.split("{{");
            target.write_all(parts.next().unwrap_or_default().as_bytes())?;
            for part in parts {
                let (name, rest) = part.split_once("}}").unwrap_or(("", part));
                match name {
                    "title" => target.write_all(title.as_bytes())?,
                    "generator" => {
                        target.write_all(
                            concat!("warpknit ", env!("CARGO_PKG_VERSION")).as_bytes(),
                        )?;
                    }
                    "style" => target.write_all(STYLE.as_bytes())?,
                    "cloth" => target.write_all(cloth.as_bytes())?,
                    "data" => write_data(lines, &grid, &mut target)?,
                    "vertex" => target.write_all(VERTEX.as_bytes())?,
                    "fragment" => target.write_all(FRAGMENT.as_bytes())?,
                    "script" => target.write_all(SCRIPT.as_bytes())?,
                    _ => {}
                }
                target.write_all(rest.as_bytes())?;
            }
            target.flush()
        })?;
        self.target.finish()
    }
}

/// The yarns' points, deflated, as text.
fn write_data(lines: &CentreLines, grid: &PageGrid, target: &mut impl Write) -> io::Result<()> {
    let mut encoder = DeflateEncoder::new(Base64::new(target), Compression::best());
    lines.write(grid, &mut encoder)?;
    encoder.finish()?.finish().map(drop)
}

/// Text as HTML has it.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Read as _};

    use glam::{DVec3, Vec3};

    use super::*;
    use crate::{Format, WriteOptions, default_section, write, writer};
    use warpknit_core::drape::{self, Cloth, swatch_panel};
    use warpknit_core::fabric::Fabric;

    /// The text between an element's begin, with that id, and its end.
    fn element<'a>(page: &'a str, id: &str) -> &'a str {
        let (_, rest) = page.split_once(&format!("id=\"{id}\">")).unwrap();
        rest.split_once("</script>").unwrap().0
    }

    /// The cloth and the strands of a page, as its script reads them: points in mm, heights.
    fn read(page: &str) -> (serde_json::Value, Vec<Vec<(Vec3, u8)>>) {
        let cloth: serde_json::Value = serde_json::from_str(element(page, "cloth")).unwrap();
        let text = element(page, "data");
        let value = |letter: u8| match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            other => panic!("{other} is no base64"),
        };
        let mut deflated = Vec::new();
        for four in text.as_bytes().chunks(4) {
            let four: Vec<u8> = four
                .iter()
                .filter(|&&letter| letter != b'=')
                .map(|&letter| value(letter))
                .collect();
            let bits = four.iter().fold(0_u32, |bits, six| bits << 6 | u32::from(*six));
            let bytes = (bits << (6 * (4 - four.len()))).to_be_bytes();
            deflated.extend_from_slice(&bytes[1..four.len()]);
        }
        let mut data = Vec::new();
        flate2::read::DeflateDecoder::new(&*deflated).read_to_end(&mut data).unwrap();
        let count = |key: &str| usize::try_from(cloth[key].as_u64().unwrap()).unwrap();
        let (points, strands) = (count("points"), count("strands"));
        assert_eq!(data.len(), 4 * strands + 9 * points);
        let (lengths, planes) = data.split_at(4 * strands);
        let mut axes = [const { Vec::new() }; 3];
        for (axis, places) in axes.iter_mut().enumerate() {
            let (low, high) = planes[2 * axis * points..][..2 * points].split_at(points);
            let mut place = 0_u16;
            places.extend(low.iter().zip(high).map(|(&low, &high)| {
                let code = u16::from_le_bytes([low, high]);
                let sign = if code & 1 == 1 { u16::MAX } else { 0 };
                place = place.wrapping_add(code >> 1 ^ sign);
                f32::from(place)
            }));
        }
        let mut height = 0_u8;
        let heights = planes[6 * points..][..points].iter().map(|difference| {
            height = height.wrapping_add(*difference);
            height
        });
        #[expect(clippy::cast_possible_truncation, reason = "it was written from f32")]
        let number = |value: &serde_json::Value| value.as_f64().unwrap() as f32;
        let step = number(&cloth["step"]);
        let low = Vec3::from_array([0, 1, 2].map(|axis| number(&cloth["low"][axis])));
        let mut all = (0..points)
            .map(|at| low + step * Vec3::new(axes[0][at], axes[1][at], axes[2][at]))
            .zip(heights);
        let lengths = lengths.as_chunks::<4>().0.iter().map(|length| u32::from_le_bytes(*length));
        let strands = lengths.map(|length| all.by_ref().take(length as usize).collect()).collect();
        (cloth, strands)
    }

    /// A swatch's page, and the points of its strands.
    fn swatch(name: &str) -> (String, Vec<Vec<DVec3>>) {
        let fabric = Fabric::named(name).unwrap();
        let panel = swatch_panel(&fabric, 9, 7);
        let cloth = Cloth::swatch(&panel, &fabric, 9, 7);
        let mut page = Cursor::new(Vec::new());
        write(Format::Html, &cloth, &fabric, &WriteOptions::default(), &mut page).unwrap();
        let mut strands = Vec::new();
        let mut keep = |blocks: &[Block]| {
            for block in blocks {
                let own = block.strands.strands.iter();
                strands.extend(own.map(|own| block.draped.positions[own.range()].to_vec()));
            }
            Ok::<_, ExportError>(())
        };
        drape::run(&cloth, &drape::DrapeOptions::default(), &mut |_, _| {}, &mut keep).unwrap();
        (String::from_utf8(page.into_inner()).unwrap(), strands)
    }

    /// The promised tolerance: half a cube of the grid, in warp knits, weft knits and laid cloth.
    #[test]
    fn points_are_read_back_to_half_a_cube() {
        for name in ["tricot", "locknit", "jersey"] {
            let (page, expected) = swatch(name);
            let (cloth, strands) = read(&page);
            let step = cloth["step"].as_f64().unwrap();
            let radius = Fabric::named(name).unwrap().radius();
            assert!(step <= 1.001 * radius / 64.0, "{name}: cubes of {step} mm");
            assert_eq!(strands.len(), expected.len());
            for (strand, expected) in strands.iter().zip(&expected) {
                assert_eq!(strand.len(), expected.len());
                for ((point, _), expected) in strand.iter().zip(expected) {
                    let off = (point.as_dvec3() - *expected).abs().max_element();
                    // f32 adds its own rounding.
                    assert!(off <= 0.5 * step + 1e-5, "{name}: {off} mm off");
                }
            }
            let heights = strands.iter().flatten().map(|(_, height)| *height);
            assert_eq!((heights.clone().min(), heights.max()), (Some(0), Some(255)));
        }
    }

    #[test]
    fn a_page_is_whole_and_fetches_nothing() {
        let (page, _) = swatch("tricot");
        assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
        assert!(!page.contains("{{") && !page.contains("http://") && !page.contains("https://"));
        assert!(page.contains("default-src 'none'") && page.contains("<title>tricot</title>"));
        let (cloth, _) = read(&page);
        assert_eq!(cloth["bars"][1]["name"], "Bar 2");
        assert_eq!(cloth["facts"][0][0], "Wales");
    }

    #[test]
    fn a_name_can_t_break_out_of_the_page() {
        let mut fabric = Fabric::named("tricot").unwrap();
        fabric.name = "</title><script>alert(1)</script>&".into();
        fabric.about = "</script><b>".into();
        let panel = swatch_panel(&fabric, 3, 3);
        let cloth = Cloth::swatch(&panel, &fabric, 3, 3);
        let mut page = Cursor::new(Vec::new());
        write(Format::Html, &cloth, &fabric, &WriteOptions::default(), &mut page).unwrap();
        let page = String::from_utf8(page.into_inner()).unwrap();
        assert!(!page.contains("alert(1)</script>") && !page.contains("</script><b>"));
        assert_eq!(read(&page).0["about"], "</script><b>");
    }

    #[test]
    fn more_than_a_page_holds_is_refused_in_one_line() {
        let fabric = Fabric::named("tricot").unwrap();
        let info = ClothInfo::from_fabric(&fabric, default_section(fabric.radius()));
        let target = Destination::named(Cursor::new(Vec::new()), "big.html");
        let mut sink = writer(Format::Html, target, &info).unwrap();
        let mut block = Block::default();
        block.knitted.stitches = vec![0; 500_001];
        let message = sink.take(&[block]).unwrap_err().to_string();
        assert!(message.starts_with("big.html: 500001 stitches are over"), "{message}");
        assert!(message.contains("--enlarge") && !message.contains('\n'));
    }

    /// A garment without a yarn is a page without one, and its script says so.
    #[test]
    fn a_cloth_without_yarns_is_a_page_too() {
        let fabric = Fabric::named("tricot").unwrap();
        let info = ClothInfo::from_fabric(&fabric, default_section(fabric.radius()));
        let sink = writer(Format::Html, Destination::new(Cursor::new(Vec::new())), &info).unwrap();
        let page = String::from_utf8(sink.finish().unwrap().into_inner()).unwrap();
        let (cloth, strands) = read(&page);
        assert!(strands.is_empty() && cloth["runs"].as_array().unwrap().is_empty());
    }
}
