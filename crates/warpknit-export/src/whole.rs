//! A whole cloth in one call: knitted, mapped and written.

use std::io::{Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{
    ClothInfo, Companion, Destination, Expected, ExportError, Facts, Format, InpDialect,
    TextureSet, UsdCurves, default_section, mtl, writer,
};
use warpknit_core::drape::{self, Block, Cloth, Totals, fibres};
use warpknit_core::fabric::Fabric;

/// Options of [`write()`]. The default is yarns as the fabric has them, without textures.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// The target's path, if it has one: see [`Destination`].
    pub path: Option<PathBuf>,
    /// How yarns are mapped and cut at panels' edges. `surface` says how fine and how thick tubes
    /// and lines are; without it they are those of [`default_section`] at the fabric's radius.
    pub drape: drape::DrapeOptions,
    /// The yarns' pictures, for `.glb` and `.obj`.
    pub textures: Arc<TextureSet>,
    /// Writes fibres of that radius, mm, in the place of yarns.
    pub fibre_radius: Option<f64>,
    /// The curves of `.usda` and `.usdc`.
    pub usd_curves: UsdCurves,
    /// Whose keywords an `.inp` has.
    pub inp: InpDialect,
}

/// What [`write()`] made besides the target's bytes.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// What was laid.
    pub totals: Totals,
    /// The files that belong beside it: an `.obj` names its `.mtl`, and that its pictures. Formats
    /// that hold all of their materials have none.
    pub companions: Vec<Companion<'static>>,
}

/// Knits a fabric as `cloth` lays it out, maps it onto the garment, and writes it.
///
/// The target is anything that is `Write + Seek`: a buffered file, or a cursor as here. A path for
/// errors and companions can be named in the options.
///
/// # Errors
/// As of [`writer`], [`super::Sink::take`] and [`super::Sink::finish`].
///
/// ```
/// use std::io::Cursor;
/// use warpknit_core::{drape, fabric::Fabric};
/// use warpknit_export::{Format, WriteOptions, write};
///
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 4, 6);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 4, 6);
/// let mut obj = Cursor::new(Vec::new());
/// let options = WriteOptions { path: Some("tricot.obj".into()), ..WriteOptions::default() };
/// let written = write(Format::Obj, &cloth, &fabric, &options, &mut obj)?;
///
/// let text = String::from_utf8(obj.into_inner())?;
/// assert!(text.contains("mtllib tricot.mtl\n"));
/// assert_eq!(text.matches("\no ").count(), written.totals.strands);
/// let mtl = &written.companions[0];
/// assert_eq!(mtl.path.to_str(), Some("tricot.mtl"));
/// assert!(mtl.bytes.starts_with(b"# yarns by warpknit\nnewmtl bar_1\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(
    format: Format,
    cloth: &Cloth<'_>,
    fabric: &Fabric,
    options: &WriteOptions,
    target: impl Write + Seek + Send,
) -> Result<Written, ExportError> {
    let section = options.drape.surface.unwrap_or_else(|| default_section(fabric.radius()));
    let info = match options.fibre_radius {
        None => ClothInfo {
            textures: Arc::clone(&options.textures),
            ..ClothInfo::from_fabric(fabric, section)
        },
        Some(fibre) => {
            let bundles = fibres::bundles(fabric, section.radius, fibre);
            ClothInfo::from_bundles(fabric, bundles, section)
        }
    };
    let expected = Expected { blocks: cloth.blocks(), yarns: cloth.yarns() };
    // Only a page has words about the fabric, and they take a repeat to measure.
    let facts = if format == Format::Html { Facts::measured(fabric) } else { Facts::default() };
    let info = ClothInfo {
        expected: Some(expected),
        facts,
        usd_curves: options.usd_curves,
        inp: options.inp,
        ..info.on_panels(&cloth.garment().panels)
    };
    let path = options.path.as_deref();
    let target = match path {
        Some(path) => Destination::named(target, path),
        None => Destination::new(target),
    };
    let mut writer = writer(format, target, &info)?;
    // Fibres get their own surfaces, so those of yarns would be made for nothing.
    let surface = (format.holds_tubes() && options.fibre_radius.is_none()).then_some(section);
    let laying = drape::DrapeOptions { surface, ..options.drape };
    let mut deliver = |blocks: &[Block]| writer.take(blocks);
    let totals = drape::run(cloth, &laying, &mut |_, _| {}, &mut deliver)?;
    writer.finish()?;
    Ok(Written { totals, companions: owned_companions(format, path, &info) })
}

/// Companions that outlive the cloth.
fn owned_companions(
    format: Format,
    path: Option<&Path>,
    cloth: &ClothInfo<'_>,
) -> Vec<Companion<'static>> {
    mtl::companions(format, path, cloth).into_iter().map(Companion::into_owned).collect()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use warpknit_core::drape::swatch_panel;

    const FORMATS: [Format; 12] = [
        Format::Glb,
        Format::Obj,
        Format::ObjLines,
        Format::Ply,
        Format::Html,
        Format::Usda,
        Format::Usdc,
        Format::Bcc,
        Format::Curves,
        Format::Inp,
        Format::Npz,
        Format::Csv,
    ];

    fn written(format: Format, options: &WriteOptions) -> Vec<u8> {
        let fabric = Fabric::named("tricot").unwrap();
        let panel = swatch_panel(&fabric, 3, 4);
        let cloth = Cloth::swatch(&panel, &fabric, 3, 4);
        let mut target = Cursor::new(b"before".to_vec());
        target.set_position(6);
        write(format, &cloth, &fabric, options, &mut target).unwrap();
        let end = target.position();
        let bytes = target.into_inner();
        assert_eq!(end, bytes.len() as u64, "the target is left behind what was written");
        assert_eq!(&bytes[..6], b"before");
        bytes[6..].to_vec()
    }

    /// A file by its path holds what memory holds.
    #[test]
    fn every_format_is_the_same_in_memory_and_in_a_file() {
        let fabric = Fabric::named("tricot").unwrap();
        let panel = swatch_panel(&fabric, 3, 4);
        let cloth = Cloth::swatch(&panel, &fabric, 3, 4);
        let section = default_section(fabric.radius());
        let folder = tempfile::tempdir().unwrap();
        for format in FORMATS {
            let path = folder.path().join(format!("yarns{}", format.ending()));
            let expected = Expected { blocks: cloth.blocks(), yarns: cloth.yarns() };
            let info = ClothInfo {
                expected: Some(expected),
                facts: Facts::measured(&fabric),
                ..ClothInfo::from_fabric(&fabric, section).on_panels(&panel.panels)
            };
            let mut writer = super::super::FileWriter::create(&path, format, &info).unwrap();
            let options =
                drape::DrapeOptions { surface: Some(section), ..drape::DrapeOptions::default() };
            let mut deliver = |blocks: &[Block]| writer.take(blocks);
            drape::run(&cloth, &options, &mut |_, _| {}, &mut deliver).unwrap();
            writer
                .finish()
                .unwrap()
                .into_iter()
                .try_for_each(super::super::Output::publish)
                .unwrap();
            let in_memory = written(format, &WriteOptions::default());
            assert!(!in_memory.is_empty());
            assert!(std::fs::read(&path).unwrap() == in_memory, "{format:?}");
        }
    }

    #[test]
    fn fibres_take_their_yarns_place() {
        let options = WriteOptions { fibre_radius: Some(0.02), ..WriteOptions::default() };
        for format in [Format::Bcc, Format::Ply] {
            let (yarns, fibres) =
                (written(format, &WriteOptions::default()), written(format, &options));
            assert!(fibres.len() > yarns.len(), "{format:?}");
        }
    }

    #[test]
    fn pictures_and_reports_hold_no_yarns() {
        let fabric = Fabric::named("tricot").unwrap();
        let panel = swatch_panel(&fabric, 3, 4);
        let cloth = Cloth::swatch(&panel, &fabric, 3, 4);
        let target = Cursor::new(Vec::new());
        let refused = write(Format::Png, &cloth, &fabric, &WriteOptions::default(), target);
        assert!(refused.unwrap_err().to_string().contains(".png"));
    }
}
