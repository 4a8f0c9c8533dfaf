//! The types that a stored number can have.

/// Signedness or floating point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberKind {
    Unsigned,
    Signed,
    Float,
}

/// A number's type: integers of 1, 2, 4 or 8 bytes, floats of 2, 4 or 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NumberType {
    kind: NumberKind,
    size: usize,
}

impl NumberType {
    pub(super) const U8: Self = Self { kind: NumberKind::Unsigned, size: 1 };
    pub(super) const U16: Self = Self { kind: NumberKind::Unsigned, size: 2 };
    pub(super) const I16: Self = Self { kind: NumberKind::Signed, size: 2 };

    /// `None` when there is no such type.
    pub(super) fn new(kind: NumberKind, size: usize) -> Option<Self> {
        let exists = matches!(size, 2 | 4 | 8) || (size == 1 && kind != NumberKind::Float);
        exists.then_some(Self { kind, size })
    }

    /// Bytes of a number.
    pub(super) const fn size(self) -> usize {
        self.size
    }

    /// Rust's name for it.
    pub(super) const fn name(self) -> &'static str {
        match (self.kind, self.size) {
            (NumberKind::Unsigned, 1) => "u8",
            (NumberKind::Unsigned, 2) => "u16",
            (NumberKind::Unsigned, 4) => "u32",
            (NumberKind::Unsigned, _) => "u64",
            (NumberKind::Signed, 1) => "i8",
            (NumberKind::Signed, 2) => "i16",
            (NumberKind::Signed, 4) => "i32",
            (NumberKind::Signed, _) => "i64",
            (NumberKind::Float, 2) => "f16",
            (NumberKind::Float, 4) => "f32",
            (NumberKind::Float, _) => "f64",
        }
    }

    /// Calls `place` with the position and the value of every number in `raw`; bytes left over are ignored.
    pub(super) fn each(self, raw: &[u8], big_endian: bool, place: impl FnMut(usize, f64)) {
        match (self.kind, self.size) {
            (NumberKind::Unsigned, 1) => each(raw, big_endian, |[x]| f64::from(x), place),
            (NumberKind::Unsigned, 2) => each(raw, big_endian, |x| f64::from(u16::from_le_bytes(x)), place),
            (NumberKind::Unsigned, 4) => each(raw, big_endian, |x| f64::from(u32::from_le_bytes(x)), place),
            (NumberKind::Unsigned, _) => each(raw, big_endian, |x| u64::from_le_bytes(x) as f64, place),
            (NumberKind::Signed, 1) => each(raw, big_endian, |x| f64::from(i8::from_le_bytes(x)), place),
            (NumberKind::Signed, 2) => each(raw, big_endian, |x| f64::from(i16::from_le_bytes(x)), place),
            (NumberKind::Signed, 4) => each(raw, big_endian, |x| f64::from(i32::from_le_bytes(x)), place),
            (NumberKind::Signed, _) => each(raw, big_endian, |x| i64::from_le_bytes(x) as f64, place),
            (NumberKind::Float, 2) => each(raw, big_endian, |x| half(u16::from_le_bytes(x)), place),
            (NumberKind::Float, 4) => each(raw, big_endian, |x| f64::from(f32::from_le_bytes(x)), place),
            (NumberKind::Float, _) => each(raw, big_endian, f64::from_le_bytes, place),
        }
    }
}

fn each<const N: usize>(
    raw: &[u8],
    big_endian: bool,
    value: impl Fn([u8; N]) -> f64,
    mut place: impl FnMut(usize, f64),
) {
    let (numbers, _) = raw.as_chunks::<N>();
    for (i, &number) in numbers.iter().enumerate() {
        let mut number = number;
        if big_endian {
            number.reverse();
        }
        place(i, value(number));
    }
}

/// A 16-bit float (IEEE 754 binary16).
fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves() {
        for (bits, value) in [(0, 0.0), (0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65504.0), (1, 2f64.powi(-24))]
        {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7e00).is_nan() && half(0xfc00) == f64::NEG_INFINITY);
    }

    #[test]
    fn both_byte_orders() {
        let list = |kind, raw: &[u8], big_endian| {
            let mut found = Vec::new();
            NumberType::new(kind, 2).unwrap().each(raw, big_endian, |i, v| found.push((i, v)));
            found
        };
        assert_eq!(list(NumberKind::Signed, &[0xff, 0xfe, 0, 1, 9], true), [(0, -2.0), (1, 1.0)]);
        assert_eq!(list(NumberKind::Unsigned, &[0xff, 0xfe, 0, 1], false), [(0, 65279.0), (1, 256.0)]);
        assert_eq!(NumberType::new(NumberKind::Float, 1), None);
        assert_eq!(NumberType::new(NumberKind::Signed, 3), None);
    }
}
