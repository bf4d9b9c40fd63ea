//! The fabrics that come with the program, one TOML file each, embedded in the binary.

/// Name and text of each, the default first.
const FABRICS: [(&str, &str); 2] =
    [("tricot", include_str!("builtin/tricot.toml")), ("locknit", include_str!("builtin/locknit.toml"))];

/// The names, in the order in which they are listed.
pub fn names() -> impl Iterator<Item = &'static str> {
    FABRICS.iter().map(|(name, _)| *name)
}

/// The TOML text of a built-in fabric, comments included.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    FABRICS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
