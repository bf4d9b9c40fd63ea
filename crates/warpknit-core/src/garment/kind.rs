//! The kind of a garment's file, by its content and not by its name.
//!
//! In: the first bytes of a file. Out: how it is read, or the name of a kind that isn't.

use super::usd::package;

/// The kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Wavefront OBJ, and whatever is not known: its reader has the messages.
    Obj,
    /// Binary glTF.
    Glb,
    /// JSON, which glTF may be.
    Json,
    /// USD as text, as a crate file, or in a package.
    Usd,
    /// Polygon file format.
    Ply,
    /// A kind that isn't read, by its name.
    Other(&'static str),
}

impl Kind {
    /// The kind of a file that begins with these bytes.
    pub(super) fn of(first: &[u8]) -> Self {
        const OTHERS: [(&[u8], &str); 10] = [
            (b"Kaydara FBX Binary", "FBX"),
            (b"; FBX", "FBX"),
            (b"BLENDER", "a Blender file"),
            (b"Ogawa", "Alembic"),
            (b"\x89HDF", "Alembic or another HDF5 file"),
            (b"PK\x03\x04", "a zip archive, such as .zprj or .3mf"),
            (b"\x89PNG", "a picture"),
            (b"\xFF\xD8\xFF", "a picture"),
            (b"solid ", "STL, which has no UVs"),
            (b"<?xml", "XML, such as COLLADA"),
        ];
        match first {
            [b'#', b'u', b's', b'd', b'a', ..] => Self::Usd,
            [b'P', b'X', b'R', b'-', b'U', b'S', b'D', b'C', ..] => Self::Usd,
            _ if package::is_package(first) => Self::Usd,
            [b'g', b'l', b'T', b'F', ..] => Self::Glb,
            // No record of OBJ begins so.
            [b'{', ..] | [0xEF, 0xBB, 0xBF, b'{', ..] => Self::Json,
            [b'p', b'l', b'y', b'\r' | b'\n', ..] => Self::Ply,
            _ => match OTHERS.iter().find(|(magic, _)| first.starts_with(magic)) {
                Some((_, name)) => Self::Other(name),
                None if is_binary(first) => {
                    Self::Other("a binary file of a kind that is not known")
                }
                None => Self::Obj,
            },
        }
    }
}

/// Whether a file that begins so is no text: among its first bytes are several that no text has. UTF-16
/// and UTF-32 have zeros among their letters, and the reader of OBJ says so.
fn is_binary(first: &[u8]) -> bool {
    const LOOKED_AT: usize = 512;
    const FEW: usize = 4;
    let is_control = |byte: &u8| matches!(byte, 1..=8 | 14..=26 | 28..=31);
    first.iter().take(LOOKED_AT).filter(|byte| is_control(byte)).count() > FEW
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_content() {
        assert_eq!(Kind::of(b"glTF\x02\0\0\0"), Kind::Glb);
        assert_eq!(Kind::of(b"ply\nformat ascii 1.0\n"), Kind::Ply);
        assert_eq!(Kind::of(b"Kaydara FBX Binary  \0"), Kind::Other("FBX"));
        assert_eq!(Kind::of(b"{\"asset\":{}}"), Kind::Json);
        assert_eq!(Kind::of(b"#usda 1.0\n"), Kind::Usd);
        assert_eq!(Kind::of(b"PXR-USDC\0\x08"), Kind::Usd);
        let noise: Vec<u8> = (0..=255_u8).map(|byte| byte.wrapping_mul(157) ^ 0x5a).collect();
        assert!(matches!(Kind::of(&noise), Kind::Other(_)));
        let utf16: Vec<u8> = "v 1 2 3\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(Kind::of(&utf16), Kind::Obj);
        for obj in [&b"# made by\nv 0 0 0"[..], b"", b"plyv", b"v 1 2 3"] {
            assert_eq!(Kind::of(obj), Kind::Obj);
        }
    }
}
