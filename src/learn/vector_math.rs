//! Functions without branches, so that a loop over a slice becomes vector code.

use std::f32::consts::{LN_2, LOG2_E};

/// Adding this rounds a small number to an integer, which then stands in the low bits.
const ROUND: f32 = 12_582_912.0;
/// Few digits, so that its product with a small integer is exact.
const LN_2_HIGH: f32 = 355.0 / 512.0;
const LN_2_LOW: f32 = LN_2 - LN_2_HIGH;

/// e^x to a relative 1e-6 for x in [-87, 88]; arguments outside are cut there.
#[inline(always)]
#[must_use]
pub(crate) fn exp(x: f32) -> f32 {
    let x = x.clamp(-87.0, 88.0);
    let rounded = x * LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    // Taylor's series to r^7: |r| <= ln 2 / 2 leaves a relative error of 5e-9.
    let mut p = 1.0 / 5040.0;
    for c in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        p = p * r + c;
    }
    let power = f32::from_bits((rounded.to_bits() << 23).wrapping_add(127 << 23));
    p * power
}

/// Natural logarithm to 1e-7 of the larger of its value and 1, for positive normal x.
#[inline(always)]
#[must_use]
pub(crate) fn ln(x: f32) -> f32 {
    // x = m 2^n with m in [2/3, 4/3)
    let offset = 0x3f2a_aaab;
    let bits = x.to_bits();
    let n = (bits.wrapping_sub(offset) as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((n as u32) << 23));
    // ln m = 2 artanh(s), s = (m - 1) / (m + 1), |s| <= 1/5
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let mut p = 2.0 / 11.0;
    for c in [2.0 / 9.0, 2.0 / 7.0, 2.0 / 5.0, 2.0 / 3.0, 2.0] {
        p = p * q + c;
    }
    p * s + n as f32 * LN_2
}

/// Hyperbolic tangent to 2e-7.
#[inline(always)]
#[must_use]
pub(crate) fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

/// Sine and cosine of `x` quarter turns to 2e-7, for |x| below 2^20.
#[inline(always)]
#[must_use]
pub(crate) fn sin_cos_quarter_turns(x: f32) -> (f32, f32) {
    let rounded = x + ROUND;
    let quadrant = rounded.to_bits();
    let r = (x - (rounded - ROUND)) * std::f32::consts::FRAC_PI_2;
    let q = r * r;
    // Taylor's series to r^9 and r^10: |r| <= pi / 4 leaves 2e-9.
    let (mut s, mut c) = (1.0 / 362_880.0, -1.0 / 3_628_800.0);
    for k in [-1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0] {
        s = s * q + k;
    }
    for k in [1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5, 1.0] {
        c = c * q + k;
    }
    s *= r;
    let (sin, cos) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    let sign = |odd: u32| (odd & 2) << 30;
    let flip = |v: f32, sign: u32| f32::from_bits(v.to_bits() ^ sign);
    (flip(sin, sign(quadrant)), flip(cos, sign(quadrant.wrapping_add(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_equal_the_library() {
        for i in -86_000..88_000 {
            let x = i as f32 * 1e-3;
            let exact = f64::from(x).exp();
            assert!((f64::from(exp(x)) / exact - 1.0).abs() < 1e-6, "exp {x}");
            let x = exact as f32;
            let exact = f64::from(x).ln();
            assert!((f64::from(ln(x)) - exact).abs() < 3e-7 * exact.abs().max(1.0), "ln {x}");
        }
        for i in -40_000..40_000 {
            let x = i as f32 * 1e-3;
            let exact = (f64::from(x) * std::f64::consts::FRAC_PI_2).sin_cos();
            let (s, c) = sin_cos_quarter_turns(x);
            assert!(
                (f64::from(s) - exact.0).abs() < 2e-7 && (f64::from(c) - exact.1).abs() < 2e-7,
                "turns {x}"
            );
            assert!((f64::from(tanh(x)) - f64::from(x).tanh()).abs() < 2e-7, "tanh {x}");
        }
        assert!(exp(f32::NEG_INFINITY) < 2e-38 && exp(1e9) > 1e38);
    }
}
