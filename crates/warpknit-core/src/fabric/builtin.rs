//! The fabrics that come with the program, one TOML file each, embedded in the binary.

/// Name and text of each: the default first, then cloths of two bars, of three and four, single bars,
/// nets and inlays, and weft knits.
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
    ("three-bar-tricot", include_str!("builtin/three-bar-tricot.toml")),
    ("three-bar-locknit", include_str!("builtin/three-bar-locknit.toml")),
    ("pillar-locknit", include_str!("builtin/pillar-locknit.toml")),
    ("three-bar-satin", include_str!("builtin/three-bar-satin.toml")),
    ("three-bar-queenscord", include_str!("builtin/three-bar-queenscord.toml")),
    ("plush", include_str!("builtin/plush.toml")),
    ("elastic-locknit", include_str!("builtin/elastic-locknit.toml")),
    ("ticking", include_str!("builtin/ticking.toml")),
    ("four-bar-tricot", include_str!("builtin/four-bar-tricot.toml")),
    ("pinstripe", include_str!("builtin/pinstripe.toml")),
    ("elastic-satin", include_str!("builtin/elastic-satin.toml")),
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

/// The built-in name that a misspelt one most likely means: the one of the smallest edit distance,
/// if at most a third of the letters are wrong. Upper and lower case count as the same.
///
/// ```
/// use warpknit_core::fabric::builtin;
/// assert_eq!(builtin::nearest("lokcnit"), Some("locknit"));
/// ```
#[must_use]
pub fn nearest(name: &str) -> Option<&'static str> {
    let name = name.to_lowercase();
    let most = name.chars().count() / 3;
    names()
        .map(|known| (edit_distance(&name, known), known))
        .filter(|(distance, _)| *distance <= most)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, known)| known)
}

/// The Levenshtein distance: the fewest letters to insert, delete or replace that turn `a` into
/// `b`.
fn edit_distance(a: &str, b: &str) -> usize {
    // A row of the table of Wagner and Fischer, The string-to-string correction problem, 1974:
    // `row[j]` is the distance of the letters of `a` so far to the first `j` letters of `b`.
    let mut row: Vec<usize> = (0..=b.chars().count()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in b.chars().enumerate() {
            let replaced = diagonal + usize::from(letter != other);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.chars().count()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_count_single_letters() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "cord"), 4);
        assert_eq!(edit_distance("cord", ""), 4);
        assert_eq!(edit_distance("satin", "satin"), 0);
    }

    #[test]
    fn a_misspelt_name_finds_its_fabric() {
        for (misspelt, meant) in [
            ("lokcnit", "locknit"),
            ("jersy", "jersey"),
            ("Tricot", "tricot"),
            ("hexnet-5", "hex-net-5"),
        ] {
            assert_eq!(nearest(misspelt), Some(meant), "{misspelt}");
        }
        for stranger in ["", "tweed", "x", "corduroy-velvet"] {
            assert_eq!(nearest(stranger), None, "{stranger}");
        }
    }
}
