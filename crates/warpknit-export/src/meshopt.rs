//! Arrays of a `.glb` as `EXT_meshopt_compression` has them (Kapoulkine, "EXT_meshopt_compression", Khronos
//! 2021, appendix A: bitstream of attributes, version 0, and of triangles, version 1).
//!
//! In: vertices of equal size, or triangles. Out: bytes from which a reader gets the same vertices, and
//! the same triangles, some of which begin with another corner. Nothing is lost.
//!
//! Attributes are coded byte by byte of the vertex: differences to the vertex before, in groups of 16 with two
//! bits, four or eight each. Triangles are coded by an edge that they share with one of the last 16, and by
//! the place of their third corner among the last ones. Cost: linear. Memory: that of the bytes.

/// The largest block of vertices, and its bytes.
const MOST_VERTICES: usize = 256;
const MOST_BYTES: usize = 8192;
/// Vertices in a group.
const GROUP: usize = 16;
/// First bytes: the kind of the stream and its version.
const ATTRIBUTES: u8 = 0xA0;
const TRIANGLES: u8 = 0xE1;
/// The fewest bytes behind the last block.
const TAIL: usize = 32;

/// Codes vertices of `stride` bytes each, a multiple of 4 up to 256.
pub(super) fn attributes(bytes: &[u8], stride: usize) -> Vec<u8> {
    let mut coded = vec![ATTRIBUTES];
    let first = &bytes[..stride.min(bytes.len())];
    let mut last = first.to_vec();
    let most = (MOST_BYTES / stride / GROUP * GROUP).min(MOST_VERTICES);
    for block in bytes.chunks(most * stride) {
        for (place, before) in last.iter_mut().enumerate() {
            let mut differences = [0; MOST_VERTICES];
            let own = block[place..].iter().step_by(stride);
            for (difference, value) in differences.iter_mut().zip(own) {
                *difference = zigzag(value.wrapping_sub(*before));
                *before = *value;
            }
            let count = (block.len() / stride).next_multiple_of(GROUP);
            add_groups(&mut coded, &differences[..count]);
        }
    }
    coded.resize(coded.len() + TAIL.saturating_sub(stride), 0);
    coded.extend_from_slice(first);
    coded
}

/// A difference without its sign: small ones of either sign are small.
fn zigzag(difference: u8) -> u8 {
    let sign = if difference >= 0x80 { 0xFF } else { 0 };
    (difference << 1) ^ sign
}

/// Adds groups of 16: two bits that say how each is coded, for all of them, and then each.
fn add_groups(coded: &mut Vec<u8>, values: &[u8]) {
    let (groups, _) = values.as_chunks::<GROUP>();
    let header = coded.len();
    coded.resize(header + groups.len().div_ceil(4), 0);
    for (number, group) in groups.iter().enumerate() {
        let level = if *group == [0; GROUP] {
            0
        } else {
            [1_u8, 2, 3].into_iter().min_by_key(|level| size(group, *level)).unwrap_or(3)
        };
        coded[header + number / 4] |= level << (2 * (number % 4));
        add_group(coded, group, level);
    }
}

/// The largest value of a level, which says that the value itself follows.
fn sentinel(level: u8) -> u8 {
    if level == 1 { 3 } else { 15 }
}

/// The bytes that a group takes at a level: two bits each, four, or eight.
fn size(group: &[u8; GROUP], level: u8) -> usize {
    match level {
        3 => GROUP,
        _ => (2 << level) + group.iter().filter(|value| **value >= sentinel(level)).count(),
    }
}

fn add_group(coded: &mut Vec<u8>, group: &[u8; GROUP], level: u8) {
    match level {
        0 => {}
        3 => coded.extend_from_slice(group),
        _ => {
            let (bits, most) = (1 << level, sentinel(level));
            for values in group.chunks(8 / bits) {
                let pack = |byte: u8, value: &u8| byte << bits | (*value).min(most);
                coded.push(values.iter().fold(0, pack));
            }
            coded.extend(group.iter().filter(|value| **value >= most));
        }
    }
}

/// Codes triangles.
pub(super) fn triangles(corners: impl Iterator<Item = [u32; 3]>) -> Vec<u8> {
    let mut coder = Triangles::default();
    corners.for_each(|triangle| coder.add(triangle));
    let mut coded = vec![TRIANGLES];
    coded.append(&mut coder.codes);
    coded.append(&mut coder.data);
    // The table of common codes: all are that of three new vertices.
    coded.resize(coded.len() + GROUP, NEW);
    coded
}

/// What triangles are coded by.
#[derive(Default)]
struct Triangles {
    codes: Vec<u8>,
    data: Vec<u8>,
    edges: Recent<(u32, u32)>,
    vertices: Recent<u32>,
    /// The vertex that comes next where each is new, and the last one that was written as it is.
    next: u32,
    last: u32,
}

/// The last 16 of something.
struct Recent<T> {
    items: [Option<T>; GROUP],
    end: usize,
}

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self { items: std::array::from_fn(|_| None), end: 0 }
    }
}

impl<T: Copy + PartialEq> Recent<T> {
    fn push(&mut self, item: T) {
        self.items[self.end] = Some(item);
        self.end = (self.end + 1) % GROUP;
    }

    /// How long ago the first one came for which that is so: 0 for the last.
    fn find<R>(&self, is_it: impl Fn(T) -> Option<R>) -> Option<(u8, R)> {
        (0..16_u8).find_map(|ago| {
            let at = (self.end + 2 * GROUP - 1 - usize::from(ago)) % GROUP;
            self.items[at].and_then(&is_it).map(|found| (ago, found))
        })
    }
}

/// A corner's code: a new vertex, and one that is written as it is.
const NEW: u8 = 0;
const WRITTEN: u8 = 15;

impl Triangles {
    fn add(&mut self, [a, b, c]: [u32; 3]) {
        let shared = self.edges.find(|edge| {
            [[a, b, c], [b, c, a], [c, a, b]]
                .into_iter()
                .find(|turned| edge == (turned[0], turned[1]))
        });
        match shared.filter(|(ago, _)| *ago < 15) {
            Some((ago, turned)) => self.add_beside(ago, turned),
            None => self.add_alone([a, b, c]),
        }
    }

    /// A triangle with an edge that came before.
    fn add_beside(&mut self, ago: u8, [a, b, c]: [u32; 3]) {
        let known = self.vertices.find(|vertex| (vertex == c).then_some(()));
        let code = match known {
            // The last one is no third corner: its code is that of a new vertex.
            Some((ago, ())) if (1..13).contains(&ago) => ago,
            _ if c == self.next => NEW,
            _ if c.checked_add(1) == Some(self.last) => 13,
            _ if self.last.checked_add(1) == Some(c) => 14,
            _ => WRITTEN,
        };
        self.codes.push(ago << 4 | code);
        match code {
            NEW => self.next += 1,
            13 | 14 => self.last = c,
            WRITTEN => self.write(c),
            _ => {}
        }
        if code == NEW || code >= 13 {
            self.vertices.push(c);
        }
        self.edges.push((c, b));
        self.edges.push((a, c));
    }

    /// Any other triangle. Its first corner is a new vertex if it has one.
    fn add_alone(&mut self, [a, b, c]: [u32; 3]) {
        let turned = [[a, b, c], [b, c, a], [c, a, b]].into_iter();
        let [a, b, c] = turned.clone().find(|turned| turned[0] == self.next).unwrap_or([a, b, c]);
        let is_new = a == self.next;
        self.next += u32::from(is_new);
        let mut code = |vertex: u32| {
            let known = self.vertices.find(|own| (own == vertex).then_some(()));
            match known {
                Some((ago, ())) if ago < 14 => ago + 1,
                _ if vertex == self.next => {
                    self.next += 1;
                    NEW
                }
                _ => WRITTEN,
            }
        };
        let codes = [code(b), code(c)];
        match (is_new, codes) {
            // The first code of the table. As a byte of its own it would have readers count new
            // vertices from 0 again.
            (true, [NEW, NEW]) => self.codes.push(0xF0),
            (true, [b, c]) => {
                self.codes.push(0xFE);
                self.data.push(b << 4 | c);
            }
            (false, [b, c]) => {
                self.codes.push(0xFF);
                self.data.push(b << 4 | c);
            }
        }
        let first = if is_new { NEW } else { WRITTEN };
        for (vertex, code) in [(a, first), (b, codes[0]), (c, codes[1])] {
            if code == WRITTEN {
                self.write(vertex);
            }
        }
        for (vertex, code) in [(a, first), (b, codes[0]), (c, codes[1])] {
            if code == NEW || code == WRITTEN {
                self.vertices.push(vertex);
            }
        }
        self.edges.push((b, a));
        self.edges.push((c, b));
        self.edges.push((a, c));
    }

    /// Writes a vertex as its difference to the last one so written, seven bits a byte.
    fn write(&mut self, vertex: u32) {
        let difference = vertex.wrapping_sub(self.last);
        let sign = if difference >> 31 == 1 { u32::MAX } else { 0 };
        let mut rest = (difference << 1) ^ sign;
        while rest > 127 {
            self.data.push(rest.to_le_bytes()[0] | 0x80);
            rest >>= 7;
        }
        self.data.push(rest.to_le_bytes()[0]);
        self.last = vertex;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Reads attributes, as the extension's appendix says.
    fn read_attributes(mut coded: &[u8], count: usize, stride: usize) -> Vec<u8> {
        let mut take = |bytes: usize| {
            let (own, rest) = coded.split_at(bytes);
            coded = rest;
            own
        };
        assert_eq!(take(1), [0xA0]);
        let most = 256.min(8192 / stride / 16 * 16);
        let mut columns = vec![Vec::new(); stride];
        for first in (0..count).step_by(most) {
            let own = most.min(count - first);
            for column in &mut columns {
                let groups = own.div_ceil(16);
                let header = take(groups.div_ceil(4)).to_vec();
                let mut values = Vec::new();
                for group in 0..groups {
                    let bits =
                        [0, 2, 4, 8][usize::from(header[group / 4] >> (2 * (group % 4)) & 3)];
                    if bits == 8 || bits == 0 {
                        values.extend(if bits == 8 { take(16).to_vec() } else { vec![0; 16] });
                        continue;
                    }
                    let packed = take(2 * bits).to_vec();
                    for at in 0..16 {
                        let (byte, shift) = (at * bits / 8, 8 - bits - at * bits % 8);
                        let value = packed[byte] >> shift & ((1 << bits) - 1);
                        let is_whole = value == (1 << bits) - 1;
                        values.push(if is_whole { take(1)[0] } else { value });
                    }
                }
                column.extend_from_slice(&values[..own]);
            }
        }
        let tail = take(32.max(stride)).to_vec();
        let mut last = tail[tail.len() - stride..].to_vec();
        assert!(coded.is_empty());
        let mut bytes = vec![0; count * stride];
        for (place, (column, before)) in columns.iter().zip(&mut last).enumerate() {
            for (byte, code) in bytes[place..].iter_mut().step_by(stride).zip(column) {
                let difference = if code & 1 == 1 { !(code >> 1) } else { code >> 1 };
                *before = before.wrapping_add(difference);
                *byte = *before;
            }
        }
        bytes
    }

    /// Reads triangles, with first and first-but-one of the last 16 at the end of each list.
    fn read_triangles(coded: &[u8], count: usize) -> Vec<[u32; 3]> {
        assert_eq!(coded[0], 0xE1);
        let (codes, mut data) = (&coded[1..=count], &coded[count + 1..coded.len() - 16]);
        let (mut edges, mut vertices) = (Vec::<(u32, u32)>::new(), Vec::<u32>::new());
        let (mut next, mut last) = (0, 0_u32);
        let byte = |data: &mut &[u8]| {
            let (first, rest) = data.split_first().unwrap();
            *data = rest;
            *first
        };
        let written = |data: &mut &[u8], last: &mut u32| {
            let (mut rest, mut shift) = (0_u32, 0);
            loop {
                let own = byte(data);
                rest |= u32::from(own & 127) << shift;
                shift += 7;
                if own < 128 {
                    break;
                }
            }
            let difference = if rest & 1 == 1 { !(rest >> 1) } else { rest >> 1 };
            *last = last.wrapping_add(difference);
            *last
        };
        let mut found = Vec::new();
        for &code in codes {
            if code < 0xF0 {
                let (a, b) = edges[edges.len() - 1 - usize::from(code >> 4)];
                let c = match code & 15 {
                    0 => {
                        next += 1;
                        next - 1
                    }
                    13 => {
                        last -= 1;
                        last
                    }
                    14 => {
                        last += 1;
                        last
                    }
                    15 => written(&mut data, &mut last),
                    ago => vertices[vertices.len() - 1 - usize::from(ago)],
                };
                if code & 15 == 0 || code & 15 >= 13 {
                    vertices.push(c);
                }
                edges.extend([(c, b), (a, c)]);
                found.push([a, b, c]);
                continue;
            }
            let pair = if code < 0xFE { 0 } else { byte(&mut data) };
            assert!(code == 0xF0 || pair != 0, "this would count from 0 again");
            let own = [if code == 0xFF { 15 } else { 0 }, pair >> 4, pair & 15];
            let mut new = |code: u8| {
                next += u32::from(code == 0);
                next.wrapping_sub(1)
            };
            let mut corners = own.map(|code| match code {
                0 => new(code),
                15 => u32::MAX,
                ago => vertices[vertices.len() - usize::from(ago)],
            });
            for (corner, code) in corners.iter_mut().zip(own) {
                if code == 15 {
                    *corner = written(&mut data, &mut last);
                }
            }
            for (corner, code) in corners.iter().zip(own) {
                if code == 0 || code == 15 {
                    vertices.push(*corner);
                }
            }
            let [a, b, c] = corners;
            edges.extend([(b, a), (c, b), (a, c)]);
            found.push([a, b, c]);
        }
        assert!(data.is_empty());
        found
    }

    /// Whether triangles are the same, whatever corner they begin with.
    fn are_same(own: &[[u32; 3]], other: &[[u32; 3]]) -> bool {
        let turns = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]];
        own.len() == other.len()
            && own.iter().zip(other).all(|(own, other)| turns(*own).contains(other))
    }

    #[test]
    fn the_triangles_of_a_tube_take_two_bytes_of_six() {
        let mut tube = Vec::new();
        for ring in 0..100_u32 {
            for side in 0..6 {
                let [a, b] = [side, (side + 1) % 6].map(|side| 6 * ring + side);
                tube.extend([[a, b, b + 6], [a, b + 6, a + 6]]);
            }
        }
        let coded = triangles(tube.iter().copied());
        assert!(are_same(&read_triangles(&coded, tube.len()), &tube));
        assert!(coded.len() < tube.len() * 2 + 32, "{} of {}", coded.len(), tube.len());
    }

    proptest! {
        #[test]
        fn vertices_come_back(
            stride in (1_usize..=64).prop_map(|quarter| 4 * quarter),
            count in 1_usize..700,
            spread in 1_u32..=255,
            seed in any::<u32>(),
        ) {
            let mut state = seed | 1;
            let mut next = || {
                state ^= state << 13;
                state ^= state >> 17;
                state ^= state << 5;
                u8::try_from(state % spread).unwrap()
            };
            let bytes: Vec<u8> = (0..count * stride).map(|_| next()).collect();
            let coded = attributes(&bytes, stride);
            prop_assert_eq!(read_attributes(&coded, count, stride), bytes);
        }

        #[test]
        fn triangles_come_back(
            all in prop::collection::vec(prop::array::uniform3(0_u32..40), 1..300),
            far in 0_u32..=3_000_000_000,
        ) {
            let all: Vec<_> = all.into_iter().map(|own| own.map(|corner| corner + far)).collect();
            let coded = triangles(all.iter().copied());
            prop_assert!(are_same(&read_triangles(&coded, all.len()), &all));
        }
    }
}
