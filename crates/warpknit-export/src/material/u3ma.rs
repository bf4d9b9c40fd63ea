//! U3MA: a U3M folder in one archive, a subset of ZIP (vizoogmbh/u3m, `u3m_additional_spec_u3ma.txt`;
//! PKWARE, "APPNOTE.TXT").
//!
//! Entries are stored: pictures are compressed already. Names are UTF-8 and say so (bit 11), times
//! are UTC, and there are no extra fields, comments, attributes, data descriptors or 64-bit sizes.
//! General writers of archives set some of these.

use std::fmt;

use flate2::Crc;

use super::MaterialFile;
use warpknit_core::ids::index32;

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
/// "Made by" of the format: FAT, version 6.3.
const MADE_BY: u16 = 0x003f;
/// Version 2.0 is needed to read it.
const NEEDED: u16 = 20;
/// Names are UTF-8.
const UTF8: u16 = 1 << 11;

/// A time of day in UTC, to a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UtcTime {
    year: i64,
    month: u8,
    day: u8,
    /// Seconds since midnight.
    seconds: u32,
}

impl UtcTime {
    /// The time so many seconds after the start of 1970, which is the earliest.
    ///
    /// ```
    /// use warpknit_export::material::UtcTime;
    /// assert_eq!(UtcTime::from_unix(951_782_400).to_string(), "2000-02-29T00:00:00Z");
    /// ```
    #[must_use]
    pub fn from_unix(seconds: u64) -> Self {
        const DAY: u64 = 86_400;
        // Days to a date (Hinnant 2013, 'chrono-compatible low-level date algorithms'): years begin
        // in March, so that the leap day is the last one, and 400 of them have 146 097 days.
        let days = i64::try_from(seconds / DAY).unwrap_or(i64::MAX / 2) + 719_468;
        let (era, in_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
        let year = (in_era - in_era / 1460 + in_era / 36_524 - in_era / 146_096) / 365;
        let in_year = in_era - (365 * year + year / 4 - year / 100);
        let month = (5 * in_year + 2) / 153;
        let day = in_year - (153 * month + 2) / 5 + 1;
        let month = if month < 10 { month + 3 } else { month - 9 };
        let small = |number: i64| u8::try_from(number).unwrap_or(1);
        Self {
            year: year + 400 * era + i64::from(month <= 2),
            month: small(month),
            day: small(day),
            seconds: u32::try_from(seconds % DAY).unwrap_or(0),
        }
    }

    /// Time and date of MS-DOS: two seconds are the unit, and 1980 is the first year.
    fn dos(self) -> [u16; 2] {
        let [hour, minute, second] = self.clock();
        let year = (self.year - 1980).clamp(0, 127);
        let date = year << 9 | i64::from(self.month) << 5 | i64::from(self.day);
        let time = hour << 11 | minute << 5 | (second / 2);
        [u16::try_from(time).unwrap_or(0), u16::try_from(date).unwrap_or(0)]
    }

    fn clock(self) -> [u32; 3] {
        [self.seconds / 3600, self.seconds / 60 % 60, self.seconds % 60]
    }
}

impl fmt::Display for UtcTime {
    /// As ISO 8601 writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [hour, minute, second] = self.clock();
        let Self { year, month, day, .. } = self;
        write!(f, "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
    }
}

/// The archive of these files.
pub(super) fn archive(files: &[MaterialFile], time: UtcTime) -> Vec<u8> {
    let (mut bytes, mut central) = (Vec::new(), Vec::new());
    for file in files {
        let offset = index32(bytes.len());
        let common = common_header(file, time);
        words(&mut bytes, LOCAL);
        bytes.extend(&common);
        bytes.extend(file.name.as_bytes());
        bytes.extend(&file.bytes);
        words(&mut central, CENTRAL);
        central.extend(MADE_BY.to_le_bytes());
        central.extend(&common);
        // Comment's length, disk, internal and external attributes.
        central.extend([0; 10]);
        words(&mut central, offset);
        central.extend(file.name.as_bytes());
    }
    let start = index32(bytes.len());
    bytes.extend(&central);
    words(&mut bytes, END);
    // This disk, and that of the directory.
    bytes.extend([0; 4]);
    let count = u16::try_from(files.len()).expect("a material has some twenty files");
    bytes.extend([count; 2].map(u16::to_le_bytes).as_flattened());
    words(&mut bytes, index32(central.len()));
    words(&mut bytes, start);
    // The comment's length.
    bytes.extend([0; 2]);
    bytes
}

/// What both headers of a file say: from the version to the length of the extra field.
fn common_header(file: &MaterialFile, time: UtcTime) -> Vec<u8> {
    let mut crc = Crc::new();
    crc.update(&file.bytes);
    let stored = 0_u16;
    let [clock, date] = time.dos();
    let mut header = Vec::new();
    for half in [NEEDED, UTF8, stored, clock, date] {
        header.extend(half.to_le_bytes());
    }
    let size = index32(file.bytes.len());
    for word in [crc.sum(), size, size] {
        words(&mut header, word);
    }
    let name = u16::try_from(file.name.len()).expect("names are short");
    header.extend(name.to_le_bytes());
    header.extend([0; 2]);
    header
}

fn words(bytes: &mut Vec<u8>, word: u32) {
    bytes.extend(word.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Read as _};

    use super::*;

    #[test]
    fn an_archive_opens_and_gives_its_files_back() {
        let files = [("a.u3m", vec![1, 2, 3]), ("textures/front_alpha.png", vec![])]
            .map(|(name, bytes)| MaterialFile { name: name.to_owned(), bytes });
        let bytes = archive(&files, UtcTime::from_unix(1_795_000_001));
        let mut opened = zip::ZipArchive::new(Cursor::new(&bytes)).unwrap();
        assert_eq!(opened.len(), 2);
        for file in &files {
            let mut entry = opened.by_name(&file.name).unwrap();
            assert_eq!(entry.compression(), zip::CompressionMethod::Stored);
            assert_eq!(entry.last_modified().unwrap().to_string(), "2026-11-18 11:06:40");
            assert_eq!(entry.extra_data().unwrap_or_default(), [0; 0]);
            let mut content = Vec::new();
            entry.read_to_end(&mut content).unwrap();
            assert_eq!(content, file.bytes);
        }
    }

    #[test]
    fn dates_follow_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_868_799, "2000-02-29T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(UtcTime::from_unix(seconds).to_string(), text);
        }
    }
}
