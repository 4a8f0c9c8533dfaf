//! Colours: 8-bit sRGB outside, OKLab inside, where equal steps look equally large.
//!
//! OKLab: B. Ottosson, "A perceptual color space for image processing" (2020).

/// A colour of a screen: 8-bit sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Rgb {
    /// Red.
    pub(crate) r: u8,
    /// Green.
    pub(crate) g: u8,
    /// Blue.
    pub(crate) b: u8,
}

impl Rgb {
    /// White.
    pub(crate) const WHITE: Self = Self::hex(0xff_ff_ff);
    /// Black.
    pub(crate) const BLACK: Self = Self::hex(0);

    /// The colour written `0xRRGGBB`; higher bits are not part of it.
    #[must_use]
    pub(crate) const fn hex(code: u32) -> Self {
        let [_, r, g, b] = code.to_be_bytes();
        Self { r, g, b }
    }

    /// This colour laid over `below`: 0 leaves `below`, 1 covers it. Mixed in sRGB, as screens and browsers do it.
    #[must_use]
    pub(crate) fn over(self, below: Self, opacity: f32) -> Self {
        let mix = |top: u8, bottom: u8| {
            let (top, bottom) = (f32::from(top), f32::from(bottom));
            (bottom + (top - bottom) * opacity.clamp(0.0, 1.0)).round() as u8
        };
        Self { r: mix(self.r, below.r), g: mix(self.g, below.g), b: mix(self.b, below.b) }
    }

    /// Perceived lightness, 0 (black) to 1 (white).
    #[must_use]
    #[cfg(test)]
    pub(crate) fn lightness(self) -> f32 {
        Oklab::from(self).l
    }
}

/// A colour by lightness (0 to 1), green-red and blue-yellow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Oklab {
    pub(super) l: f32,
    pub(super) a: f32,
    pub(super) b: f32,
}

impl Oklab {
    /// The colour at `t` (0 to 1) of the way to `other`.
    pub(super) fn lerp(self, other: Self, t: f32) -> Self {
        let mix = |from: f32, to: f32| from + (to - from) * t;
        Self { l: mix(self.l, other.l), a: mix(self.a, other.a), b: mix(self.b, other.b) }
    }

    /// The nearest colour that a screen can show: parts outside the gamut are cut off.
    pub(super) fn to_rgb(self) -> Rgb {
        let Self { l, a, b } = self;
        let cube = |x: f32| x * x * x;
        let long = cube(l + 0.396_337_78 * a + 0.215_803_76 * b);
        let medium = cube(l - 0.105_561_346 * a - 0.063_854_17 * b);
        let short = cube(l - 0.089_484_18 * a - 1.291_485_5 * b);
        Rgb {
            r: encode(4.076_741_7 * long - 3.307_711_6 * medium + 0.230_969_94 * short),
            g: encode(-1.268_438 * long + 2.609_757_4 * medium - 0.341_319_38 * short),
            b: encode(-0.004_196_086_3 * long - 0.703_418_6 * medium + 1.707_614_7 * short),
        }
    }
}

impl From<Rgb> for Oklab {
    fn from(colour: Rgb) -> Self {
        let (r, g, b) = (decode(colour.r), decode(colour.g), decode(colour.b));
        let long = (0.412_221_46 * r + 0.536_332_55 * g + 0.051_445_995 * b).cbrt();
        let medium = (0.211_903_5 * r + 0.680_699_5 * g + 0.107_396_96 * b).cbrt();
        let short = (0.088_302_46 * r + 0.281_718_85 * g + 0.629_978_7 * b).cbrt();
        Self {
            l: 0.210_454_26 * long + 0.793_617_8 * medium - 0.004_072_047 * short,
            a: 1.977_998_5 * long - 2.428_592_2 * medium + 0.450_593_7 * short,
            b: 0.025_904_037 * long + 0.782_771_77 * medium - 0.808_675_77 * short,
        }
    }
}

/// Linear light of an 8-bit sRGB channel (IEC 61966-2-1).
pub(super) fn decode(channel: u8) -> f32 {
    let c = f32::from(channel) / 255.0;
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The 8-bit sRGB channel nearest to a linear light.
pub(super) fn encode(light: f32) -> u8 {
    let c = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (c.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_survive_the_round_trip() {
        let steps = (0..=255u32).map(|v| v * 0x01_01_01);
        let cube = (0..512u32).map(|i| (((i >> 6) * 36) << 16) | (((i >> 3 & 7) * 36) << 8) | ((i & 7) * 36));
        for code in steps.chain(cube) {
            let colour = Rgb::hex(code);
            assert_eq!(Oklab::from(colour).to_rgb(), colour, "{code:06x}");
        }
    }

    #[test]
    fn published_reference_colour() {
        // sRGB red in OKLab, as the author of the space gives it: 0.628, 0.225, 0.126.
        let red = Oklab::from(Rgb::hex(0xff_00_00));
        assert!((red.l - 0.628).abs() < 1e-3 && (red.a - 0.225).abs() < 1e-3 && (red.b - 0.126).abs() < 1e-3);
        assert!((Rgb::WHITE.lightness() - 1.0).abs() < 1e-4);
    }

    #[test]
    fn laying_over_is_linear_in_opacity() {
        let (top, below) = (Rgb::hex(0x10_80_ff), Rgb::hex(0xf0_80_00));
        assert_eq!(top.over(below, 0.0), below);
        assert_eq!(top.over(below, 1.0), top);
        assert_eq!(top.over(below, 0.5), Rgb::hex(0x80_80_80));
    }
}
