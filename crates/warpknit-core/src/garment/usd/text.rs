//! USD text (`.usda`) to a [`UsdStage`].
//!
//! In: bytes. Out: prims with the attributes that meshes need. Everything else is passed over by
//! its brackets. Cost: linear. Not promised: that a file is refused for what usd-core minds.

use super::samples::{Between, is_smooth, mixed};
use super::{Attribute, CONVERT, DEEPEST, Prim, UsdStage, UsdValue, is_needed};

/// Reads a whole text.
///
/// # Errors
/// The first line that isn't understood.
pub(super) fn stage(bytes: &[u8], time: Option<f64>) -> Result<UsdStage, String> {
    let mut reader = Reader { bytes, at: 0, time };
    reader.layer().ok_or_else(|| {
        let before = &bytes[..reader.at.min(bytes.len())];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        format!("is cut off or no USD text in line {line}: {CONVERT}")
    })
}

/// Metadata of a stage, a prim or an attribute, as far as they count.
#[derive(Debug, Default)]
struct Metadata {
    entries: Vec<(String, UsdValue)>,
}

impl Metadata {
    fn get(&self, name: &str) -> Option<&UsdValue> {
        self.entries.iter().find(|(own, _)| own == name).map(|(_, value)| value)
    }

    fn text(&self, name: &str) -> String {
        self.get(name).and_then(|value| value.texts.first()).cloned().unwrap_or_default()
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The time whose values are wanted.
    time: Option<f64>,
}

/// Whether values of a type are floats of 32 bits: `float`, `float3`, `point3f`, `texCoord2f`.
fn is_single(kind: &str) -> bool {
    kind.starts_with("float") || kind.ends_with('f')
}

/// The nearest float of 32 bits. Text gives as many digits as tell one from the next.
#[expect(clippy::cast_possible_truncation, reason = "the nearest is meant")]
fn single(number: f64) -> f64 {
    f64::from(number as f32)
}

/// How deep lists and tuples may lie in each other.
const DEEPEST_LIST: usize = 8;

impl<'a> Reader<'a> {
    fn layer(&mut self) -> Option<UsdStage> {
        // Its version: a comment, to the eye of what follows.
        self.bytes.starts_with(b"#usda").then_some(())?;
        let metadata = self.metadata()?;
        let metres = metadata.get("metersPerUnit");
        let mut root = Prim::default();
        while self.peek().is_some() {
            self.statement(&mut root, 0)?;
        }
        let is_composed = metadata.get("subLayers").is_some();
        if is_composed {
            root.children.push(Prim { is_composed, ..Prim::default() });
        }
        Some(UsdStage {
            up: metadata.text("upAxis"),
            metres_per_unit: metres.and_then(|value| value.numbers.first().copied()),
            prims: root.children,
        })
    }

    /// The next byte that is no blank and in no comment.
    fn peek(&mut self) -> Option<u8> {
        loop {
            match self.bytes.get(self.at)? {
                b' ' | b'\t' | b'\r' | b'\n' | b';' => self.at += 1,
                b'#' => self.skip_to(b"\n")?,
                byte => return Some(*byte),
            }
        }
    }

    fn takes(&mut self, byte: u8) -> bool {
        let is_next = self.peek() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    fn expect(&mut self, byte: u8) -> Option<()> {
        self.takes(byte).then_some(())
    }

    /// Passes over everything up to the end of `mark`; over all that is left without one.
    fn skip_to(&mut self, mark: &[u8]) -> Option<()> {
        let rest = &self.bytes[self.at..];
        match rest.windows(mark.len()).position(|own| own == mark) {
            Some(place) => {
                self.at += place + mark.len();
                Some(())
            }
            None => {
                self.at = self.bytes.len();
                None
            }
        }
    }

    /// A word: a name, a type, a number.
    fn word(&mut self) -> Option<&'a str> {
        self.peek()?;
        let rest = &self.bytes[self.at..];
        let is_part = |byte: &u8| {
            matches!(byte, b'_' | b':' | b'.' | b'+' | b'-' | b'!' | b'|' | 0x80..)
                || byte.is_ascii_alphanumeric()
        };
        let length = rest.iter().position(|byte| !is_part(byte)).unwrap_or(rest.len());
        let word = std::str::from_utf8(&rest[..length]).ok()?;
        self.at += length;
        (length > 0).then_some(word)
    }

    /// A text in quotes, of which there may be three.
    fn text(&mut self) -> Option<String> {
        let quote = self.peek().filter(|byte| matches!(byte, b'"' | b'\''))?;
        let three = [quote; 3];
        let end = if self.bytes[self.at..].starts_with(&three) { &three[..] } else { &three[..1] };
        self.at += end.len();
        let mut text = Vec::new();
        while !self.bytes[self.at..].starts_with(end) {
            let mut byte = *self.bytes.get(self.at)?;
            if byte == b'\\' {
                self.at += 1;
                byte = *self.bytes.get(self.at)?;
            } else if byte == b'\n' && end.len() == 1 {
                return None;
            }
            text.push(byte);
            self.at += 1;
        }
        self.at += end.len();
        Some(String::from_utf8_lossy(&text).into_owned())
    }

    /// Passes over a bracket and everything up to its partner.
    fn skip_brackets(&mut self) -> Option<()> {
        let mut open = Vec::new();
        loop {
            match self.peek()? {
                b'"' | b'\'' => drop(self.text()?),
                b'@' => self.asset()?,
                byte @ (b'(' | b'[' | b'{' | b')' | b']' | b'}') => {
                    self.at += 1;
                    match byte {
                        b'(' => open.push(b')'),
                        b'[' => open.push(b']'),
                        b'{' => open.push(b'}'),
                        end => (open.pop() == Some(end)).then_some(())?,
                    }
                    if open.is_empty() {
                        return Some(());
                    }
                }
                _ => self.at += 1,
            }
        }
    }

    /// Passes over a path of a file: `@file@`, or `@@@file@@@`.
    fn asset(&mut self) -> Option<()> {
        let three: &[u8] = b"@@@";
        let end = if self.bytes[self.at..].starts_with(three) { three } else { &three[..1] };
        self.at += end.len();
        self.skip_to(end)
    }

    /// Metadata in parentheses, if there are any.
    fn metadata(&mut self) -> Option<Metadata> {
        let mut metadata = Metadata::default();
        if !self.takes(b'(') {
            return Some(metadata);
        }
        while !self.takes(b')') {
            if matches!(self.peek()?, b'"' | b'\'') {
                self.text()?;
                continue;
            }
            let mut name = self.word()?;
            if matches!(name, "prepend" | "append" | "add" | "delete" | "reorder") {
                name = self.word()?;
            }
            self.expect(b'=')?;
            let value = self.value()?;
            metadata.entries.push((name.to_owned(), value));
        }
        Some(metadata)
    }

    /// Any value.
    fn value(&mut self) -> Option<UsdValue> {
        let mut value = UsdValue::default();
        self.items(&mut value, 0)?;
        Some(value)
    }

    /// The numbers and texts of a value.
    fn items(&mut self, value: &mut UsdValue, depth: usize) -> Option<()> {
        match self.peek()? {
            b'[' | b'(' if depth < DEEPEST_LIST => {
                let end = if self.takes(b'[') { b']' } else { b')' };
                self.at += usize::from(end == b')');
                while !self.takes(end) {
                    self.items(value, depth + 1)?;
                    if !self.takes(b',') {
                        self.expect(end)?;
                        break;
                    }
                }
                Some(())
            }
            b'{' => self.skip_brackets(),
            b'"' | b'\'' => {
                value.texts.push(self.text()?);
                Some(())
            }
            b'@' => {
                self.asset()?;
                if self.peek() == Some(b'<') {
                    self.skip_to(b">")?;
                }
                // A reference's layer offset.
                if self.peek() == Some(b'(') { self.skip_brackets() } else { Some(()) }
            }
            b'<' => self.skip_to(b">"),
            _ => {
                let word = self.word()?;
                match word.parse() {
                    Ok(number) => value.numbers.push(number),
                    Err(_no_number) => value.texts.push(word.to_owned()),
                }
                Some(())
            }
        }
    }

    /// A prim, a variant set or a property of `prim`.
    fn statement(&mut self, prim: &mut Prim, depth: usize) -> Option<()> {
        match self.word()? {
            specifier @ ("def" | "over" | "class") => {
                let child = self.prim(specifier == "def", depth)?;
                prim.children.push(child);
            }
            "variantSet" => {
                self.text()?;
                self.expect(b'=')?;
                self.skip_brackets()?;
                prim.is_composed = true;
            }
            "reorder" => {
                self.word()?;
                self.expect(b'=')?;
                self.value()?;
            }
            first => self.property(first, prim)?,
        }
        Some(())
    }

    fn prim(&mut self, is_defined: bool, depth: usize) -> Option<Prim> {
        (depth < DEEPEST).then_some(())?;
        let kind = if self.peek()? == b'"' { "" } else { self.word()? };
        let name = self.text()?;
        let metadata = self.metadata()?;
        let is_active = metadata.text("active") != "false"
            && metadata.get("active").and_then(|value| value.numbers.first()) != Some(&0.0);
        let is_composed = ["references", "payload", "inherits", "specializes", "variantSets"]
            .iter()
            .any(|arc| metadata.get(arc).is_some());
        let mut prim = Prim {
            name,
            kind: kind.to_owned(),
            is_hidden: !is_defined || !is_active,
            is_composed,
            ..Prim::default()
        };
        self.expect(b'{')?;
        while !self.takes(b'}') {
            self.statement(&mut prim, depth + 1)?;
        }
        Some(prim)
    }

    /// A property whose first word is read.
    fn property(&mut self, first: &str, prim: &mut Prim) -> Option<()> {
        let mut kind = first;
        while matches!(
            kind,
            "custom" | "uniform" | "varying" | "config" | "prepend" | "append" | "add" | "delete"
        ) {
            kind = self.word()?;
        }
        let is_list = self.takes(b'[');
        if is_list {
            self.expect(b']')?;
        }
        let whole = self.word()?;
        let (name, part) = whole.split_once('.').unwrap_or((whole, ""));
        let (mut value, mut times) = (None, Vec::new());
        if self.takes(b'=') {
            if part == "timeSamples" {
                (times, value) = self.sample(is_smooth(name))?;
            } else {
                value = Some(self.value()?);
            }
        }
        if let Some(value) = &mut value
            && is_single(kind)
        {
            value.numbers.iter_mut().for_each(|number| *number = single(*number));
        }
        let metadata = self.metadata()?;
        if kind == "rel" || part == "connect" || !is_needed(name) {
            return Some(());
        }
        let interpolation = metadata.text("interpolation");
        let place = prim.attributes.iter().position(|own| own.name == name);
        let own = match place {
            Some(place) => &mut prim.attributes[place],
            None => {
                prim.attributes.push(Attribute {
                    name: name.to_owned(),
                    kind: if is_list { format!("{kind}[]") } else { kind.to_owned() },
                    ..Attribute::default()
                });
                prim.attributes.last_mut()?
            }
        };
        if let Some(value) = value
            && (part == "timeSamples" || own.times.is_empty())
        {
            own.times = times;
            own.value = value;
        }
        if !interpolation.is_empty() {
            own.interpolation = interpolation;
        }
        Some(())
    }

    /// The times in braces, and the value of the one that is wanted.
    fn sample(&mut self, is_smooth: bool) -> Option<(Vec<f64>, Option<UsdValue>)> {
        let mut samples = Vec::new();
        self.expect(b'{')?;
        while !self.takes(b'}') {
            samples.push((self.time()?, self.value()?));
            if !self.takes(b',') {
                self.expect(b'}')?;
                break;
            }
        }
        samples.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let (times, mut values): (Vec<_>, Vec<_>) = samples.into_iter().unzip();
        let value = Between::of(&times, self.time).map(|Between { before, after, share }| {
            let own = std::mem::take(&mut values[before]);
            if is_smooth && share > 0.0 { mixed(own, &values[after], share) } else { own }
        });
        Some((times, value))
    }

    /// A time and the colon behind it, which a word may hold.
    fn time(&mut self) -> Option<f64> {
        let word = self.word()?;
        let time = match word.split_once(':') {
            Some((time, behind)) => {
                self.at -= behind.len();
                time
            }
            None => {
                self.expect(b':')?;
                word
            }
        };
        time.parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{Unit, parse, times};

    const SQUARE: &str = r#"#usda 1.0
(
    "a comment"
    customLayerData = { string a = "}" }
    metersPerUnit = 0.01
    upAxis = "Z"
)
# a comment with "quotes
def Xform "up" (kind = "component" prepend apiSchemas = ["A"]) {
    double3 xformOp:translate = (0, 0, 5); uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </m> ( bindMaterialAs = "x" )
    def Mesh "cloth" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3,]
        point3f[] points.timeSamples = { 2: [(9,9,9)], 1.5: [(0,0,0), (1,0,0), (1,1,0), (0,1,-1e1)] }
        texCoord2f[] primvars:st = [(0,0), (1,0), (1,0.1), (0,1)] ( interpolation = "faceVarying" )
        int[] primvars:st:indices = [0, 1, 2, 3]
        asset a = @a "b"@
    }
    over "gone" { }
}
"#;

    #[test]
    fn a_square_is_read_and_its_start_refused() {
        let mesh = parse(SQUARE.as_bytes(), None).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.untextured), (4, 2, 0));
        assert_eq!(mesh.positions[3].to_array(), [0.0, -5.0, -1.0]);
        assert_eq!(mesh.texture[2].y, f64::from(0.1_f32));
        assert_eq!(mesh.unit, Some(Unit::Cm));
        assert_eq!(mesh.names, ["cloth"]);
        for end in 0..SQUARE.len() - 2 {
            let message = parse(&SQUARE.as_bytes()[..end], None).unwrap_err();
            assert!(!message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn points_and_transforms_are_those_of_the_time() {
        let moving = SQUARE.replace("[(9,9,9)]", "[(0,0,0), (1,0,0), (1,1,0), (0,1,-20)]");
        let moving = moving.replace(
            "translate = (0, 0, 5)",
            "translate.timeSamples = { 1: (0, 0, 5), 2: (0, 0, 9), 3: None }",
        );
        assert_eq!(times(moving.as_bytes()), Ok(vec![1.0, 1.5, 2.0, 3.0]));
        let corner = |time| parse(moving.as_bytes(), time).unwrap().positions[3].to_array();
        assert_eq!(corner(None), corner(Some(1.0)));
        assert_eq!(corner(Some(1.75)), [0.0, -15.0 + 8.0, -1.0]);
        assert!(parse(moving.as_bytes(), Some(9.0)).is_err());
    }

    #[test]
    fn what_is_wrong_is_one_line() {
        let wrong = [
            ("(0,0,0), ", "", "a point that isn't there"),
            ("[4]", "[5]", "face 0"),
            ("[4]", "[-1]", "face 0"),
            ("[4]", "[2, 2]", "three corners"),
            ("0, 1, 2, 3,]", "0, 1, 2, 1e30]", "face 0"),
            ("(1,0), (1,0.1)", "(1,0)", "primvars:st"),
            ("-1e1", "nan", "not finite"),
            ("translate\"]", "turn\"]", "transform"),
            ("(0, 0, 5)", "(0, 5)", "transform"),
            ("def Mesh", "over Mesh", "no mesh"),
            ("def Mesh \"cloth\"", "def \"cloth\" (references = @a.usd@</b>)", "--flatten"),
            ("}\n    over", "\n    over", "line"),
            ("[4]", "[[[[[[[[[4]]]]]]]]]", "line 13"),
        ];
        for (from, to, says) in wrong {
            assert!(SQUARE.contains(from), "{from}");
            let message = parse(SQUARE.replacen(from, to, 1).as_bytes(), None).unwrap_err();
            assert!(message.contains(says) && !message.contains('\n'), "{to}: {message}");
        }
        let deep = format!("#usda 1.0\n{}", "def \"a\" {".repeat(100_000));
        assert!(parse(deep.as_bytes(), None).is_err());
    }

    proptest! {
        #[test]
        fn anything_is_read_or_refused(
            at in any::<prop::sample::Index>(), text in "[\\[\\](){}\"'@<>:,=.#a1 \n-]{0,12}"
        ) {
            let mut file = SQUARE.to_owned();
            file.insert_str(at.index(SQUARE.len()), &text);
            let _read = parse(file.as_bytes(), None);
        }
    }
}
