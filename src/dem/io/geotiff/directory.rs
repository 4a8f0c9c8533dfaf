//! The image file directories of a TIFF, every entry checked against the file's length.
//!
//! In: the bytes of a file. Out: tag -> values. Cost: the entries once; values are decoded only when asked for, and
//! never take more than eight times their bytes in the file. Source: TIFF 6.0, section 2; BigTIFF.

use super::tag;
use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// A tag's values as they lie in the file.
#[derive(Clone, Copy, Debug)]
struct Entry {
    kind: u16,
    count: usize,
    start: usize,
}

/// Bytes of a value, by TIFF type code; 0 for a type that does not exist.
const SIZES: [usize; 19] = [0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8, 8, 8];
const ASCII: u16 = 2;

/// The entries of an image.
#[derive(Debug)]
pub(super) struct Directory<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    big_endian: bool,
    entries: BTreeMap<u16, Entry>,
    /// Where the next directory begins; 0 after the last.
    next: u64,
}

impl<'a> Directory<'a> {
    /// Reads the header and the entries of the first image.
    pub(super) fn parse(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let big_endian = bytes.first() == Some(&b'M');
        let file = Self { path, bytes, big_endian, entries: BTreeMap::new(), next: 0 };
        let big = file.number("version", 2, 2)? == 43;
        if big && (file.number("offset size", 4, 2)?, file.number("offset size", 6, 2)?) != (8, 0) {
            return Err(Error::file(path, "BigTIFF offset size", "not 8", "allowed: 8 bytes"));
        }
        let (first, pointer) = if big { (8, 8) } else { (4, 4) };
        let start = file.number("position of the directory", first, pointer)?;
        file.at(start, big)
    }

    /// The directory after this one.
    pub(super) fn following(&self) -> Result<Option<Self>> {
        if self.next == 0 {
            return Ok(None);
        }
        let big = self.number("version", 2, 2)? == 43;
        let file = Self { entries: BTreeMap::new(), next: 0, ..*self };
        file.at(self.next, big).map(Some)
    }

    /// Reads the entries of the directory at `start`.
    fn at(mut self, start: u64, big: bool) -> Result<Self> {
        let (path, bytes) = (self.path, self.bytes);
        let file = &mut self;
        let pointer = if big { 8 } else { 4 };
        let start = usize::try_from(start).unwrap_or(usize::MAX);
        let (count_size, entry_size) = if big { (8, 20) } else { (2, 12) };
        let count = file.number("directory", start, count_size)?;
        let room = bytes.len().saturating_sub(start.saturating_add(count_size)) / entry_size;
        let entries = usize::try_from(count).ok().filter(|&n| n <= room).ok_or_else(|| {
            Error::file(
                path,
                "number of tags",
                count,
                format!("the file has room for {room} after the directory"),
            )
        })?;
        for i in 0..entries {
            file.read_entry(start + count_size + i * entry_size, pointer)?;
        }
        // Absent in files that were cut off after the last entry: no more images then.
        self.next =
            self.number("next directory", start + count_size + entries * entry_size, pointer).unwrap_or(0);
        Ok(self)
    }

    /// Adds the entry at `at`; types from the future are skipped, as TIFF asks.
    fn read_entry(&mut self, at: usize, pointer: usize) -> Result<()> {
        let (tag, kind) = (self.number("tag", at, 2)? as u16, self.number("type", at + 2, 2)? as u16);
        let count = self.number("count", at + 4, pointer)?;
        let size = SIZES.get(usize::from(kind)).copied().unwrap_or(0);
        if size == 0 {
            return Ok(());
        }
        let outside = || {
            let claimed = format!("{count} values of {size} bytes");
            let length = self.bytes.len();
            Error::file(
                self.path,
                tag::name(tag),
                claimed,
                format!("they must lie inside the {length} bytes"),
            )
        };
        let count = usize::try_from(count).map_err(|_| outside())?;
        let bytes = count.checked_mul(size).ok_or_else(outside)?;
        let start = if bytes <= pointer {
            at + 4 + pointer
        } else {
            usize::try_from(self.number("offset", at + 4 + pointer, pointer)?).map_err(|_| outside())?
        };
        if start.checked_add(bytes).is_none_or(|end| end > self.bytes.len()) {
            return Err(outside());
        }
        self.entries.insert(tag, Entry { kind, count, start });
        Ok(())
    }

    /// An unsigned number of `size` (1, 2, 4, 8) bytes.
    fn number(&self, what: &str, at: usize, size: usize) -> Result<u64> {
        let raw = at.checked_add(size).and_then(|end| self.bytes.get(at..end));
        let raw = raw.ok_or_else(|| {
            Error::file(
                self.path,
                what,
                format!("at byte {at}"),
                format!("the file ends at {}: truncated?", self.bytes.len()),
            )
        })?;
        Ok(self.raw(raw))
    }

    fn raw(&self, raw: &[u8]) -> u64 {
        let join = |value: u64, &byte: &u8| value << 8 | u64::from(byte);
        if self.big_endian { raw.iter().fold(0, join) } else { raw.iter().rev().fold(0, join) }
    }

    /// The raw values of a tag as (type, one slice a value).
    fn values(&self, tag: u16) -> Option<(u16, impl Iterator<Item = u64> + '_)> {
        let Entry { kind, count, start } = *self.entries.get(&tag)?;
        let size = SIZES[usize::from(kind)];
        let values = self.bytes[start..start + count * size].chunks_exact(size);
        Some((kind, values.map(|raw| self.raw(raw))))
    }

    fn wrong_type(&self, tag: u16, kind: u16, wanted: &str) -> Error {
        Error::file(self.path, tag::name(tag), format!("of TIFF type {kind}"), format!("allowed: {wanted}"))
    }

    /// The byte order of the file's numbers.
    pub(super) fn is_big_endian(&self) -> bool {
        self.big_endian
    }

    /// Whether the tag is there.
    pub(super) fn has(&self, tag: u16) -> bool {
        self.entries.contains_key(&tag)
    }

    /// How many values a tag has; 0 when it is absent.
    pub(super) fn count(&self, tag: u16) -> usize {
        self.entries.get(&tag).map_or(0, |e| e.count)
    }

    /// All values of an unsigned tag.
    pub(super) fn unsigned(&self, tag: u16) -> Result<Option<Vec<u64>>> {
        let Some((kind, values)) = self.values(tag) else { return Ok(None) };
        match kind {
            1 | 3 | 4 | 13 | 16 | 18 => Ok(Some(values.collect())),
            _ => Err(self.wrong_type(tag, kind, "an unsigned integer type")),
        }
    }

    /// The single value of an unsigned tag; several are fine when they agree.
    pub(super) fn one(&self, tag: u16) -> Result<Option<u64>> {
        let Some(values) = self.unsigned(tag)? else { return Ok(None) };
        match values.split_first() {
            Some((&first, rest)) if rest.iter().all(|&v| v == first) => Ok(Some(first)),
            _ => {
                let shown = format!("{:?}", &values[..values.len().min(8)]);
                Err(Error::file(
                    self.path,
                    tag::name(tag),
                    shown,
                    "allowed: one value, the same for all bands",
                ))
            }
        }
    }

    /// The single value of a tag that must be there.
    pub(super) fn required(&self, tag: u16) -> Result<u64> {
        self.one(tag)?.ok_or_else(|| Error::file(self.path, tag::name(tag), "absent", "the tag is required"))
    }

    /// All values of a floating-point tag, which must be finite.
    pub(super) fn floats(&self, tag: u16) -> Result<Option<Vec<f64>>> {
        let Some((kind, values)) = self.values(tag) else { return Ok(None) };
        let values: Vec<f64> = match kind {
            11 => values.map(|v| f64::from(f32::from_bits(v as u32))).collect(),
            12 => values.map(f64::from_bits).collect(),
            _ => return Err(self.wrong_type(tag, kind, "float or double")),
        };
        match values.iter().find(|v| !v.is_finite()) {
            Some(bad) => Err(Error::file(self.path, tag::name(tag), bad, "allowed: finite numbers")),
            None => Ok(Some(values)),
        }
    }

    /// A text tag up to its first NUL; bytes that are not UTF-8 become replacement characters.
    pub(super) fn text(&self, tag: u16) -> Result<Option<String>> {
        let Some(&Entry { kind, count, start }) = self.entries.get(&tag) else { return Ok(None) };
        if kind != ASCII {
            return Err(self.wrong_type(tag, kind, "ASCII"));
        }
        let raw = &self.bytes[start..start + count];
        let end = raw.iter().position(|&b| b == 0).unwrap_or(raw.len());
        Ok(Some(String::from_utf8_lossy(&raw[..end]).into_owned()))
    }
}
