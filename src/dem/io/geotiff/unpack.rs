//! One strip or tile: compressed bytes to little-endian numbers.
//!
//! In: the bytes in the file, and the size they must unpack to, which [`super::layout`] has checked against their
//! length. Out: that many bytes, predictor undone. Cost: one pass and one buffer. Source: TIFF 6.0, sections 9, 13 and
//! 14; Adobe Photoshop TIFF technical note 3 (floating-point predictor).
//!
//! Not the `tiff` crate's decoder: version 0.11.3 fails on sound LZW tiles that overhang the raster ("no lzw end code
//! found"), forgets to cut the overhang of every band but the first, turns white-is-zero heights upside down, reads
//! the file header where GDAL left out a tile, and allocates tag values by their claimed count.

use super::layout::{Method, Predictor};
use flate2::read::ZlibDecoder;
use std::io::Read;
use weezl::{BitOrder, LzwStatus};

/// How the numbers of a strip or tile are packed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packing {
    pub(super) method: Method,
    pub(super) predictor: Predictor,
    pub(super) big_endian: bool,
    /// Bytes of a number: 1, 2, 4 or 8.
    pub(super) size: usize,
    /// Numbers of a cell.
    pub(super) samples: usize,
    /// Cells of a row.
    pub(super) cols: usize,
}

impl Packing {
    /// Unpacks `length` bytes, a whole number of rows. The error says what is wrong with the data.
    pub(super) fn unpack(&self, packed: &[u8], length: usize) -> Result<Vec<u8>, String> {
        let mut raw = match self.method {
            Method::None => packed.get(..length).ok_or_else(|| ended(packed.len(), length))?.to_vec(),
            Method::Deflate => {
                let mut raw = vec![0; length];
                ZlibDecoder::new(packed).read_exact(&mut raw).map_err(|e| e.to_string())?;
                raw
            }
            Method::Lzw => lzw(packed, length)?,
            Method::PackBits => pack_bits(packed, length)?,
        };
        if self.big_endian && self.size > 1 && self.predictor != Predictor::FloatingPoint {
            raw.chunks_exact_mut(self.size).for_each(<[u8]>::reverse);
        }
        let rows = raw.chunks_exact_mut(self.cols * self.samples * self.size);
        match self.predictor {
            Predictor::None => {}
            Predictor::Horizontal => rows.for_each(|row| self.sum_horizontally(row)),
            Predictor::FloatingPoint => {
                let mut shuffled = Vec::new();
                rows.for_each(|row| {
                    shuffled.clear();
                    shuffled.extend_from_slice(row);
                    self.unshuffle(&mut shuffled, row);
                });
            }
        }
        Ok(raw)
    }

    /// Each number is the difference to the same sample of the cell before.
    fn sum_horizontally(&self, row: &mut [u8]) {
        match self.size {
            1 => self.sum(row, |a: [u8; 1], b| [a[0].wrapping_add(b[0])]),
            2 => {
                self.sum(row, |a, b| u16::from_le_bytes(a).wrapping_add(u16::from_le_bytes(b)).to_le_bytes())
            }
            4 => {
                self.sum(row, |a, b| u32::from_le_bytes(a).wrapping_add(u32::from_le_bytes(b)).to_le_bytes())
            }
            _ => {
                self.sum(row, |a, b| u64::from_le_bytes(a).wrapping_add(u64::from_le_bytes(b)).to_le_bytes())
            }
        }
    }

    fn sum<const N: usize>(&self, row: &mut [u8], add: impl Fn([u8; N], [u8; N]) -> [u8; N]) {
        let (numbers, _) = row.as_chunks_mut::<N>();
        for i in self.samples..numbers.len() {
            numbers[i] = add(numbers[i], numbers[i - self.samples]);
        }
    }

    /// Bytes differenced along the row, most significant bytes of all numbers first.
    fn unshuffle(&self, shuffled: &mut [u8], row: &mut [u8]) {
        for i in self.samples..shuffled.len() {
            shuffled[i] = shuffled[i].wrapping_add(shuffled[i - self.samples]);
        }
        let numbers = self.cols * self.samples;
        for (i, number) in row.chunks_exact_mut(self.size).enumerate() {
            for (significance, byte) in number.iter_mut().rev().enumerate() {
                *byte = shuffled[significance * numbers + i];
            }
        }
    }
}

fn ended(found: usize, wanted: usize) -> String {
    format!("ended after {found} of {wanted} bytes")
}

fn lzw(packed: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let mut raw = vec![0; length];
    let mut decoder = weezl::decode::Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let (mut consumed, mut filled) = (0, 0);
    while filled < length {
        let step = decoder.decode_bytes(&packed[consumed..], &mut raw[filled..]);
        consumed += step.consumed_in;
        filled += step.consumed_out;
        match step.status {
            Ok(LzwStatus::Ok) if step.consumed_in + step.consumed_out > 0 => {}
            Ok(_) => break,
            Err(e) => return Err(e.to_string()),
        }
    }
    if filled < length { Err(ended(filled, length)) } else { Ok(raw) }
}

fn pack_bits(packed: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let mut raw = Vec::with_capacity(length);
    let mut rest = packed;
    while raw.len() < length {
        let Some((&control, tail)) = rest.split_first() else { return Err(ended(raw.len(), length)) };
        rest = tail;
        match control {
            // The next 1 to 128 bytes as they are.
            0..128 => {
                let count = usize::from(control) + 1;
                let (literal, tail) = rest.split_at_checked(count).ok_or_else(|| ended(raw.len(), length))?;
                raw.extend_from_slice(literal);
                rest = tail;
            }
            // Nothing, by definition.
            128 => {}
            // The next byte 2 to 128 times.
            129.. => {
                let (&byte, tail) = rest.split_first().ok_or_else(|| ended(raw.len(), length))?;
                raw.resize(raw.len() + 257 - usize::from(control), byte);
                rest = tail;
            }
        }
    }
    raw.truncate(length);
    Ok(raw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packbits_by_the_book() {
        // The example of TIFF 6.0, section 9.
        let packed =
            [0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7, 0xAA];
        let raw = [
            0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0xAA, 0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0x22, 0xAA, 0xAA,
            0xAA, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA,
        ];
        assert_eq!(pack_bits(&packed, raw.len()).unwrap(), raw);
        for end in 0..packed.len() {
            assert!(pack_bits(&packed[..end], raw.len()).is_err());
        }
        assert_eq!(pack_bits(&packed, 2).unwrap(), [0xAA; 2]);
    }
}
