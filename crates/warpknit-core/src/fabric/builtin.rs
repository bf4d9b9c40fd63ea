//! The fabrics that come with the program, one TOML file each, embedded in the binary.

/// Name and text of each: the default first, then cloths of two bars, single bars, nets and inlays,
/// and weft knits.
const FABRICS: &[(&str, &str)] = &[
    ("tricot", include_str!("builtin/tricot.toml")),
    ("locknit", include_str!("builtin/locknit.toml")),
    ("reverse-locknit", include_str!("builtin/reverse-locknit.toml")),
    ("satin", include_str!("builtin/satin.toml")),
    ("velour", include_str!("builtin/velour.toml")),
    ("sharkskin", include_str!("builtin/sharkskin.toml")),
    ("queenscord", include_str!("builtin/queenscord.toml")),
    ("double-cord", include_str!("builtin/double-cord.toml")),
    ("double-atlas", include_str!("builtin/double-atlas.toml")),
    ("pillar-tricot", include_str!("builtin/pillar-tricot.toml")),
    ("pillar-open", include_str!("builtin/pillar-open.toml")),
    ("pillar-closed", include_str!("builtin/pillar-closed.toml")),
    ("tricot-closed", include_str!("builtin/tricot-closed.toml")),
    ("tricot-open", include_str!("builtin/tricot-open.toml")),
    ("cord", include_str!("builtin/cord.toml")),
    ("satin-lap", include_str!("builtin/satin-lap.toml")),
    ("velvet-lap", include_str!("builtin/velvet-lap.toml")),
    ("atlas-4", include_str!("builtin/atlas-4.toml")),
    ("atlas", include_str!("builtin/atlas.toml")),
    ("tulle-3", include_str!("builtin/tulle-3.toml")),
    ("tulle-5", include_str!("builtin/tulle-5.toml")),
    ("marquisette", include_str!("builtin/marquisette.toml")),
    ("marquisette-3", include_str!("builtin/marquisette-3.toml")),
    ("square-net", include_str!("builtin/square-net.toml")),
    ("atlas-net", include_str!("builtin/atlas-net.toml")),
    ("hex-net-3", include_str!("builtin/hex-net-3.toml")),
    ("hex-net-5", include_str!("builtin/hex-net-5.toml")),
    ("power-net", include_str!("builtin/power-net.toml")),
    ("tricot-inlay", include_str!("builtin/tricot-inlay.toml")),
    ("weft-inserted", include_str!("builtin/weft-inserted.toml")),
    ("jersey", include_str!("builtin/jersey.toml")),
    ("rib-1x1", include_str!("builtin/rib-1x1.toml")),
    ("rib-2x2", include_str!("builtin/rib-2x2.toml")),
    ("garter", include_str!("builtin/garter.toml")),
    ("cable", include_str!("builtin/cable.toml")),
];

/// The names, in the order in which they are listed.
pub fn names() -> impl Iterator<Item = &'static str> {
    FABRICS.iter().map(|(name, _)| *name)
}

/// The TOML text of a built-in fabric, comments included.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    FABRICS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
