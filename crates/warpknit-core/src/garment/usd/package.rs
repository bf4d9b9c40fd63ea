//! The stage of a `.usdz`: its first file (OpenUSD, "Usdz File Format Specification" 1.3).
//!
//! In: a package's bytes, a ZIP archive whose files are not compressed. Out: the bytes of its first
//! file. Not promised: what that file takes from others of the package.

use crate::cursor::Cursor;

/// First bytes of a file in a ZIP archive.
const MAGIC: [u8; 4] = *b"PK\x03\x04";
/// The mark of a file whose size stands behind it.
const SIZE_BEHIND: u16 = 1 << 3;
/// What to do instead.
const EXPORT: &str = "export the garment as .usdc";

/// The head of a package's first file.
struct FileHead<'a> {
    name: &'a [u8],
    marks: u16,
    method: u16,
    size: u32,
    /// What lies behind the head.
    rest: Cursor<'a>,
}

impl<'a> FileHead<'a> {
    fn of(bytes: &'a [u8]) -> Option<Self> {
        let mut file = Cursor::new(bytes);
        (file.take()? == MAGIC).then_some(())?;
        let _version = file.u16()?;
        let (marks, method) = (file.u16()?, file.u16()?);
        // Time, date and checksum.
        file.slice(8)?;
        let (_packed, size) = (file.u32()?, file.u32()?);
        let (name, extra) = (file.u16()?, file.u16()?);
        let name = file.slice(name.into())?;
        file.slice(extra.into())?;
        Some(Self { name, marks, method, size, rest: file })
    }
}

/// Whether a ZIP archive that begins with these bytes is a package: its first file is a stage.
pub(in super::super) fn is_package(first: &[u8]) -> bool {
    let ends = [&b".usdc"[..], b".usda", b".usd"];
    FileHead::of(first).is_some_and(|head| ends.iter().any(|end| head.name.ends_with(end)))
}

/// The bytes of the first file.
///
/// # Errors
/// What is wrong with the package.
pub(super) fn first(bytes: &[u8]) -> Result<&[u8], String> {
    let cut = || format!("is cut off: {EXPORT}");
    let mut head = FileHead::of(bytes).ok_or_else(cut)?;
    if head.method != 0 || head.marks & SIZE_BEHIND != 0 {
        return Err(format!("is compressed, which no .usdz may be: {EXPORT}"));
    }
    head.rest.slice(head.size.into()).ok_or_else(cut)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A package of one file, without its directory, which isn't read.
    fn package(name: &str, method: u8, body: &[u8]) -> Vec<u8> {
        let size = u32::try_from(body.len()).unwrap().to_le_bytes();
        let mut bytes = b"PK\x03\x04\x14\0\0\0".to_vec();
        bytes.extend([method, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        bytes.extend([size, size].concat());
        bytes.extend([u8::try_from(name.len()).unwrap(), 0, 3, 0]);
        bytes.extend(name.as_bytes());
        bytes.extend([0, 0, 0]);
        bytes.extend(body);
        bytes
    }

    #[test]
    fn the_first_file_is_the_stage() {
        let whole = package("a.usdc", 0, b"PXR-USDC");
        assert!(is_package(&whole) && !is_package(&package("a.png", 0, b"x")));
        assert_eq!(first(&[&whole[..], b"PK\x01\x02"].concat()), Ok(&b"PXR-USDC"[..]));
        for end in 0..whole.len() {
            assert!(first(&whole[..end]).unwrap_err().contains("cut off"), "{end}");
        }
        assert!(first(&package("a.usda", 8, b"x")).unwrap_err().contains("compressed"));
    }
}
