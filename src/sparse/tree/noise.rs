//! Noise functions of the plane: gradient noise (Perlin 1985), and the ridged sums of Ebert et al., *Texturing and Modeling* (1998), chapter 16.

use serde::{Deserialize, Serialize};

/// How octaves become terrain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum NoiseKind {
    /// The sum of octaves.
    Perlin,
    /// The sum of octaves whose zeros are ridges: (1 - |n|)^2.
    Ridged,
    /// The same, each octave times the one before: rough on ridges, smooth in valleys.
    RidgedMultifractal,
}

/// Each octave has half the wavelength of the one before, and this share of its amplitude.
const GAIN: f64 = 0.5;
/// What an octave is multiplied with before it becomes the weight of the next one (Ebert et al.: the gain of the ridged multifractal).
const FEEDBACK: f64 = 2.0;
/// Mean of a ridged octave over random lattices: what is left of one that is too fine to be seen (measured, 4 million points).
const RIDGE_MEAN: f64 = 0.595;
/// Most octaves: the sum has two coefficients each, wavelength and amplitude; 16 in all (Guérin et al. 2016, Fig. 4).
pub(super) const OCTAVES: usize = 8;

/// The sum of `octaves` at a point that is measured in wavelengths of the first. Octaves below `finest`, a wavelength in the same unit, are
/// left out, and those up to twice as long fade. Waves are about two wavelengths long, which is that of the lattice: cells show those of their own side and longer.
pub(super) fn noise(kind: NoiseKind, seed: u32, [x, y]: [f64; 2], octaves: usize, finest: f64) -> f64 {
    let (mut sum, mut amplitude, mut wavelength, mut weight) = (0.0, 1.0, 1.0f64, 1.0);
    for octave in 0..octaves {
        // Whole from twice the finest wavelength on.
        let share = if finest > 0.0 { (wavelength / finest - 1.0).clamp(0.0, 1.0) } else { 1.0 };
        let n = if share > 0.0 {
            gradient_noise(seed.wrapping_add(octave as u32), x / wavelength, y / wavelength)
        } else {
            0.0
        };
        let ridge = RIDGE_MEAN + share * ((1.0 - n.abs()).powi(2) - RIDGE_MEAN);
        sum += amplitude
            * match kind {
                NoiseKind::Perlin => share * n,
                NoiseKind::Ridged => ridge,
                NoiseKind::RidgedMultifractal => {
                    let value = ridge * weight;
                    weight = (value * FEEDBACK).clamp(0.0, 1.0);
                    value
                }
            };
        amplitude *= GAIN;
        wavelength *= 0.5;
    }
    sum
}

/// Gradient noise with quintic interpolation; about -1 to 1.
fn gradient_noise(seed: u32, x: f64, y: f64) -> f64 {
    let (left, top) = (x.floor(), y.floor());
    let (u, v) = (x - left, y - top);
    let corner = |i: i64, j: i64| {
        let angle = f64::from(hash(seed, left as i64 + i, top as i64 + j)) / f64::from(u32::MAX)
            * std::f64::consts::TAU;
        (u - i as f64) * angle.cos() + (v - j as f64) * angle.sin()
    };
    let fade = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (s, t) = (fade(u), fade(v));
    let along = |j: i64| corner(0, j) + s * (corner(1, j) - corner(0, j));
    let (upper, lower) = (along(0), along(1));
    std::f64::consts::SQRT_2 * (upper + t * (lower - upper))
}

/// A number for a corner of the lattice.
fn hash(seed: u32, x: i64, y: i64) -> u32 {
    let mut h = u64::from(seed)
        ^ (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
    // The finaliser of SplitMix64 (Steele, Lea, Flood 2014).
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (h ^ (h >> 31)) as u32
}
