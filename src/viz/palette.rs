//! Colour ramps, interpolated in OKLab so that they are smooth to the eye.
//!
//! Hypsometric ramps keep a narrow range of lightness below the summits: lightness belongs to the hill shading, hue to
//! the height.

use super::color::{Oklab, Rgb};

/// A colour for every number from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Palette {
    /// Height in a temperate or alpine landscape: deep green valleys, meadow, ochre, warm grey rock, white summits.
    #[default]
    Alpine,
    /// Height in a desert or canyon: umber depths, terracotta, sand, pale limestone.
    Arid,
    /// Height on a body without air or plants: cool grey plains to warm pale highlands.
    Lunar,
    /// No hue and no height: every height the same light grey, for pure shading.
    Grey,
    /// Signed difference: blue (below 0.5), paper white (0.5), red (above). Lightness falls linearly on both arms.
    Difference,
    /// Height by tone alone: black to white with even steps of lightness.
    Tone,
}

impl Palette {
    /// The control colours: (position, colour), positions rising from 0 to 1.
    fn stops(self) -> &'static [(f32, u32)] {
        match self {
            Self::Alpine => &[
                (0.00, 0x62_8c_72),
                (0.14, 0x8f_ab_7e),
                (0.30, 0xbc_bf_8a),
                (0.46, 0xd6_c7_96),
                (0.62, 0xcd_b5_94),
                (0.76, 0xc6_ba_ad),
                (0.88, 0xdd_da_d6),
                (1.00, 0xf8_f8_f8),
            ],
            Self::Arid => &[
                (0.00, 0x8f_6d_63),
                (0.22, 0xb5_84_6a),
                (0.45, 0xd3_a6_7c),
                (0.68, 0xe4_c8_9c),
                (0.86, 0xeb_dd_c0),
                (1.00, 0xf6_f1_e6),
            ],
            Self::Lunar => &[(0.00, 0x84_88_8f), (0.35, 0xa2_a3_a5), (0.70, 0xc6_c3_be), (1.00, 0xea_e6_df)],
            Self::Grey => &[(0.00, 0xc8_c8_c8), (1.00, 0xc8_c8_c8)],
            Self::Difference => &[
                (0.00, 0x1f_4e_8c),
                (0.25, 0x7c_9d_cb),
                (0.50, 0xf6_f4_f0),
                (0.75, 0xd5_84_74),
                (1.00, 0x93_2c_2b),
            ],
            Self::Tone => &[(0.00, 0x00_00_00), (1.00, 0xff_ff_ff)],
        }
    }

    /// The colour at `t`; numbers outside 0 to 1 get the colour of the nearer end.
    #[must_use]
    pub(crate) fn color(self, t: f32) -> Rgb {
        self.at(t).to_rgb()
    }

    /// The colour at `t` in OKLab, by monotone cubic interpolation of the control colours (no kink, no overshoot).
    pub(super) fn at(self, t: f32) -> Oklab {
        let stops = self.stops();
        let t = t.clamp(0.0, 1.0);
        let upper = stops.iter().position(|&(x, _)| x >= t).unwrap_or(stops.len() - 1).max(1);
        let lab = |i: usize| Oklab::from(Rgb::hex(stops[i].1));
        let part = |pick: fn(Oklab) -> f32| {
            let slope = |i: usize| monotone_slope(stops, i, pick);
            let (x0, x1) = (stops[upper - 1].0, stops[upper].0);
            let (width, u) = (x1 - x0, (t - x0) / (x1 - x0));
            let (u2, u3) = (u * u, u * u * u);
            (2.0 * u3 - 3.0 * u2 + 1.0) * pick(lab(upper - 1))
                + (u3 - 2.0 * u2 + u) * width * slope(upper - 1)
                + (3.0 * u2 - 2.0 * u3) * pick(lab(upper))
                + (u3 - u2) * width * slope(upper)
        };
        Oklab { l: part(|c| c.l), a: part(|c| c.a), b: part(|c| c.b) }
    }

    /// 1024 colours from 0 to 1 in OKLab: [`at`](Self::at) for a whole picture, finer than 8 bits can show.
    pub(super) fn table(self) -> Vec<Oklab> {
        (0..1024).map(|i| self.at(i as f32 / 1023.0)).collect()
    }
}

/// Slope at control colour `i` by the weighted harmonic mean of its neighbours' slopes, 0 at turning points (Fritsch &
/// Butland 1984).
fn monotone_slope(stops: &[(f32, u32)], i: usize, pick: fn(Oklab) -> f32) -> f32 {
    let value = |i: usize| pick(Oklab::from(Rgb::hex(stops[i].1)));
    let width = |i: usize| stops[i + 1].0 - stops[i].0;
    let secant = |i: usize| (value(i + 1) - value(i)) / width(i);
    if i == 0 {
        return secant(0);
    }
    if i + 1 == stops.len() {
        return secant(i - 1);
    }
    let (before, after) = (secant(i - 1), secant(i));
    if before * after <= 0.0 {
        return 0.0;
    }
    let (w1, w2) = (2.0 * width(i) + width(i - 1), width(i) + 2.0 * width(i - 1));
    (w1 + w2) / (w1 / before + w2 / after)
}

/// The entry of a table from [`Palette::table`] for `t`; numbers outside 0 to 1 get the nearer end.
pub(super) fn look_up(table: &[Oklab], t: f32) -> Oklab {
    let last = table.len() - 1;
    table[((t.clamp(0.0, 1.0) * last as f32).round() as usize).min(last)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Palette; 6] =
        [Palette::Alpine, Palette::Arid, Palette::Lunar, Palette::Grey, Palette::Difference, Palette::Tone];

    #[test]
    fn control_colours_are_hit_and_the_ramp_never_jumps() {
        for palette in ALL {
            for &(t, code) in palette.stops() {
                assert_eq!(palette.color(t), Rgb::hex(code), "{palette:?} at {t}");
            }
            let table = palette.table();
            for pair in table.windows(2) {
                let step = ((pair[1].l - pair[0].l).powi(2)
                    + (pair[1].a - pair[0].a).powi(2)
                    + (pair[1].b - pair[0].b).powi(2))
                .sqrt();
                assert!(step < 0.004, "{palette:?} jumps by {step}");
            }
        }
    }

    #[test]
    fn the_difference_palette_is_balanced() {
        for i in 0..50 {
            let (near, far) = (i as f32 / 100.0, (i + 1) as f32 / 100.0);
            for sign in [-1.0, 1.0] {
                let l = |d: f32| Palette::Difference.at(0.5 + sign * d).l;
                assert!(l(far) < l(near), "lightness must fall with the size of the difference");
            }
            let arms = Palette::Difference.at(0.5 - far).l - Palette::Difference.at(0.5 + far).l;
            assert!(arms.abs() < 0.03, "arms differ by {arms} at {far}");
        }
    }

    #[test]
    fn out_of_range_numbers_get_the_ends() {
        assert_eq!(Palette::Alpine.color(-3.0), Palette::Alpine.color(0.0));
        assert_eq!(Palette::Alpine.color(7.0), Palette::Alpine.color(1.0));
    }
}
