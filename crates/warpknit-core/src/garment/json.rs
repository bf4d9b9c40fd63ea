//! JSON text to a tree (RFC 8259).
//!
//! In: text. Out: [`Json`]. Numbers are 64-bit floats, as the values of glTF are. A parser of its
//! own, since serde_json would bring four crates into a core that has few. Cost: linear. Not
//! promised: that text is refused for what a stricter reader minds, such as a name given twice.

/// How deep lists and objects may lie in each other. glTF needs some ten.
const DEEPEST: usize = 64;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Json {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Self>),
    Object(Vec<(String, Self)>),
}

impl Json {
    /// Parses a whole text.
    ///
    /// # Errors
    /// The line of the first fault.
    pub(super) fn parse(text: &[u8]) -> Result<Self, String> {
        let mut parser = Parser { text, at: 0 };
        let value = parser.value(0);
        parser.blanks();
        match value {
            Some(value) if parser.at == text.len() => Ok(value),
            _ => {
                let before = &text[..parser.at.min(text.len())];
                let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
                Err(format!("its JSON is cut off or wrong in line {line}: export it again"))
            }
        }
    }

    /// What an object has of that name.
    pub(super) fn get(&self, name: &str) -> Option<&Self> {
        let Self::Object(entries) = self else { return None };
        entries.iter().find(|(own, _)| own == name).map(|(_, value)| value)
    }

    /// The items of the list of that name; none where there is no such list.
    pub(super) fn list(&self, name: &str) -> &[Self] {
        match self.get(name) {
            Some(Self::List(items)) => items,
            _ => &[],
        }
    }

    /// The text of that name.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.get(name)?.as_text()
    }

    /// The text that this is.
    pub(super) fn as_text(&self) -> Option<&str> {
        let Self::Text(text) = self else { return None };
        Some(text)
    }

    /// The number that this is.
    pub(super) fn as_number(&self) -> Option<f64> {
        let Self::Number(number) = self else { return None };
        Some(*number)
    }

    /// The count or index that this is.
    pub(super) fn as_index(&self) -> Option<usize> {
        // The largest whole number to which a float counts without gaps.
        const MOST: f64 = 9_007_199_254_740_992.0;
        let number = self.as_number()?;
        let is_index = number.fract() == 0.0 && (0.0..MOST).contains(&number);
        is_index.then(|| crate::number::whole_f64(number))
    }

    /// The count or index of that name.
    pub(super) fn index(&self, name: &str) -> Option<usize> {
        self.get(name)?.as_index()
    }
}

struct Parser<'a> {
    text: &'a [u8],
    at: usize,
}

impl Parser<'_> {
    fn blanks(&mut self) {
        while self
            .text
            .get(self.at)
            .is_some_and(|byte| matches!(byte, b' ' | b'\t' | b'\r' | b'\n'))
        {
            self.at += 1;
        }
    }

    /// Passes over blanks and a word, or stays behind the blanks.
    fn takes(&mut self, word: &[u8]) -> bool {
        self.blanks();
        let is_next = self.text[self.at..].starts_with(word);
        if is_next {
            self.at += word.len();
        }
        is_next
    }

    fn value(&mut self, depth: usize) -> Option<Json> {
        if depth > DEEPEST {
            return None;
        }
        if self.takes(b"{") {
            let mut entries = Vec::new();
            self.items(b"}", |parser| {
                let name = parser.takes(b"\"").then(|| parser.rest_of_text())??;
                let value = parser.takes(b":").then(|| parser.value(depth + 1))??;
                entries.push((name, value));
                Some(())
            })?;
            return Some(Json::Object(entries));
        }
        if self.takes(b"[") {
            let mut items = Vec::new();
            self.items(b"]", |parser| {
                items.push(parser.value(depth + 1)?);
                Some(())
            })?;
            return Some(Json::List(items));
        }
        if self.takes(b"\"") {
            return self.rest_of_text().map(Json::Text);
        }
        for (word, value) in
            [("true", Json::Bool(true)), ("false", Json::Bool(false)), ("null", Json::Null)]
        {
            if self.takes(word.as_bytes()) {
                return Some(value);
            }
        }
        self.number()
    }

    /// Items with commas between them, up to the closing mark.
    fn items(&mut self, end: &[u8], mut item: impl FnMut(&mut Self) -> Option<()>) -> Option<()> {
        if self.takes(end) {
            return Some(());
        }
        loop {
            item(self)?;
            if self.takes(end) {
                return Some(());
            }
            self.takes(b",").then_some(())?;
        }
    }

    fn number(&mut self) -> Option<Json> {
        let rest = &self.text[self.at..];
        let is_part = |byte: &u8| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E');
        let length = rest.iter().position(|byte| !is_part(byte)).unwrap_or(rest.len());
        let number = std::str::from_utf8(&rest[..length]).ok()?.parse().ok()?;
        self.at += length;
        Some(Json::Number(number))
    }

    /// A text whose first quote is read.
    fn rest_of_text(&mut self) -> Option<String> {
        let mut bytes = Vec::new();
        loop {
            let byte = *self.text.get(self.at)?;
            self.at += 1;
            match byte {
                b'"' => return String::from_utf8(bytes).ok(),
                b'\\' => {
                    let escape = *self.text.get(self.at)?;
                    self.at += 1;
                    let character = match escape {
                        b'b' => '\u{8}',
                        b'f' => '\u{C}',
                        b'n' => '\n',
                        b'r' => '\r',
                        b't' => '\t',
                        b'u' => self.unicode()?,
                        b'"' | b'\\' | b'/' => char::from(escape),
                        _ => return None,
                    };
                    bytes.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
                }
                byte => bytes.push(byte),
            }
        }
    }

    /// The four digits behind `\u`, or the two fours of a character that UTF-16 writes as a pair.
    fn unicode(&mut self) -> Option<char> {
        let first = self.hexadecimal()?;
        if !(0xD800..0xDC00).contains(&first) {
            return char::from_u32(first);
        }
        let is_pair = self.text[self.at..].starts_with(b"\\u");
        self.at += 2;
        let second = is_pair.then(|| self.hexadecimal())??;
        let low = second.checked_sub(0xDC00).filter(|low| *low < 0x400)?;
        char::from_u32(0x1_0000 + ((first - 0xD800) << 10) + low)
    }

    fn hexadecimal(&mut self) -> Option<u32> {
        let digits = self.text.get(self.at..self.at + 4)?;
        self.at += 4;
        u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_text_is_a_tree_and_its_start_is_none() {
        let text =
            r#" {"a": [1, -2.5e3, true, null], "b\n\u00e4\ud83d\ude00": {"c": "\"/"}, "d": []} "#;
        let json = Json::parse(text.as_bytes()).unwrap();
        assert_eq!(json.list("a")[1].as_number(), Some(-2500.0));
        assert_eq!(json.list("a")[0].as_index(), Some(1));
        assert_eq!(json.list("a")[1].as_index(), None);
        assert_eq!(json.get("b\nä😀").unwrap().text("c"), Some("\"/"));
        assert_eq!(json.list("d"), []);
        for end in 0..text.len() - 1 {
            assert!(Json::parse(&text.as_bytes()[..end]).unwrap_err().contains("line 1"));
        }
        assert!(Json::parse(b"[1,\n,2]").unwrap_err().contains("line 2"));
        for wrong in ["[1 2]", "{1:2}", "[tru]", "\"\\x\"", "\"\\ud800\"", "1 2", "[+]"] {
            assert!(Json::parse(wrong.as_bytes()).is_err(), "{wrong}");
        }
        assert!(Json::parse("[".repeat(1_000_000).as_bytes()).is_err());
    }

    proptest! {
        #[test]
        fn anything_is_read_or_refused(text in "[\\[\\]{}\",:0-9eEu\\\\trufalsn.+ -]{0,80}") {
            let _tree = Json::parse(text.as_bytes());
        }
    }
}
