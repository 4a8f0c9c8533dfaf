//! Shaded relief in colour, as a printed map would have it.
//!
//! Dem -> Picture: height chooses the tint ([`Palette`]), light ([`Sun`]) its lightness; shadows turn a little towards
//! blue and sunlit slopes towards yellow, the convention of Swiss relief maps (E. Imhof, *Cartographic Relief
//! Presentation*, 1965, chapters 9 and 13). Cost: O(pixels), rows in parallel.

use super::color::Oklab;
use super::hillshade::{Gradient, Sun, gradients};
use super::palette::{Palette, look_up};
use super::upsample::{check_scale, upsample};
use super::{Picture, Rgb};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use rayon::prelude::*;

/// How much heights are stretched before they are shaded (colours always follow the true height).
#[derive(Clone, Copy, Debug, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Exaggeration {
    /// So that the mean steepness becomes [`Exaggeration::TARGET`], within 0.5 to 40: a plain shows its forms and a
    /// mountain range does not drown in shadow.
    #[default]
    Auto,
    /// By this factor.
    By(f64),
}

impl Exaggeration {
    /// The mean steepness (rise over run) that [`Auto`](Self::Auto) aims at; chosen by eye on the Alps (90 m), the
    /// Grand Canyon (62 m), the Sierra Nevada (30 m), Saharan dunes (90 m) and the Moon (948 m).
    pub(crate) const TARGET: f64 = 0.5;

    fn factor(self, slopes: &Grid<Gradient>, dem: &Dem) -> f64 {
        match self {
            Self::By(factor) => factor,
            Self::Auto => {
                let known = slopes.as_slice().iter().zip(dem.valid().as_slice()).filter(|(_, ok)| **ok);
                let (sum, count) =
                    known.fold((0.0, 0.0), |(s, n), (g, _)| (s + f64::from(g.steepness()), n + 1.0));
                if sum > 0.0 { (Self::TARGET * count / sum).clamp(0.5, 40.0) } else { 1.0 }
            }
        }
    }
}

/// How terrain is drawn.
///
/// Pictures that are to be compared need one [`range`](Self::range) and one [`exaggeration`](Self::exaggeration): take
/// both from the reference with [`fixed_for`](Self::fixed_for).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Relief {
    /// Colours by height.
    pub(crate) palette: Palette,
    /// The light.
    pub(crate) sun: Sun,
    /// Light from the whole sky, 0 to 1: how far shadows are opened.
    pub(crate) ambient: f64,
    /// Stretching of heights for the shading.
    pub(crate) exaggeration: Exaggeration,
    /// Heights (metres) that get the palette's first and last colour; those beyond get the nearer one. `None`: the
    /// lowest and highest of the DEM drawn.
    pub(crate) range: Option<(f64, f64)>,
    /// Pixels a cell, along each side: 1 to 64, and no more than 2^27 in the picture. Heights are interpolated
    /// smoothly.
    pub(crate) scale: usize,
}

impl Default for Relief {
    fn default() -> Self {
        Self {
            palette: Palette::default(),
            sun: Sun::default(),
            ambient: 0.25,
            exaggeration: Exaggeration::Auto,
            range: None,
            scale: 1,
        }
    }
}

impl Relief {
    /// The default drawing with another palette.
    #[must_use]
    pub(crate) fn with_palette(palette: Palette) -> Self {
        Self { palette, ..Self::default() }
    }

    /// The same drawing at `scale` pixels per cell.
    #[must_use]
    pub(crate) fn scaled(self, scale: usize) -> Self {
        Self { scale, ..self }
    }

    /// The same drawing with height range and exaggeration set to what `dem` gets, so that other terrain drawn with it
    /// can be compared with `dem` by eye.
    #[must_use]
    pub(crate) fn fixed_for(self, dem: &Dem) -> Self {
        let slopes = gradients(dem.heights(), dem.valid(), dem.cell_size());
        let (low, high) = dem.range();
        Self {
            exaggeration: Exaggeration::By(self.exaggeration.factor(&slopes, dem)),
            range: self.range.or(Some((f64::from(low), f64::from(high)))),
            ..self
        }
    }

    /// The terrain, (rows x scale, cols x scale) pixels. Voids are hatched in light grey.
    ///
    /// # Errors
    /// When a field is out of range.
    pub(crate) fn draw(&self, dem: &Dem) -> Result<Picture> {
        self.check()?;
        check_scale(dem.shape().0, dem.shape().1, self.scale)?;
        let slopes = gradients(dem.heights(), dem.valid(), dem.cell_size());
        let k = self.exaggeration.factor(&slopes, dem) as f32;
        let part = |pick: fn(&Gradient) -> f32| {
            upsample(&slopes.map(|slope| k * pick(slope)), dem.valid(), self.scale)
        };
        let (east, north) = (part(|g| g.east), part(|g| g.north));
        let heights = upsample(dem.heights(), dem.valid(), self.scale);
        let (low, high) = self.range.unwrap_or_else(|| {
            let (low, high) = dem.range();
            (f64::from(low), f64::from(high))
        });
        let (tints, lights) = (self.palette.table(), self.sun.lights());
        let (rows, cols) = heights.shape();
        let mut picture = Picture::filled(rows, cols, Rgb::WHITE);
        picture.pixels_mut().as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, line)| {
            for (col, pixel) in line.iter_mut().enumerate() {
                let at = Cell::new(row, col);
                if !dem.valid()[Cell::new(row / self.scale, col / self.scale)] {
                    *pixel = void_color(at);
                    continue;
                }
                let height = if high > low { (f64::from(heights[at]) - low) / (high - low) } else { 0.5 };
                let slope = Gradient { east: east[at], north: north[at] };
                *pixel = self.lit(look_up(&tints, height as f32), lights.brightness(slope)).to_rgb();
            }
        });
        Ok(picture)
    }

    /// A tint under a light of 0 to 1; flat ground keeps its tint.
    fn lit(&self, tint: Oklab, brightness: f32) -> Oklab {
        let ambient = self.ambient as f32;
        let under_sky = |light: f32| ambient + (1.0 - ambient) * light;
        let ratio = under_sky(brightness) / under_sky(self.sun.flat_brightness());
        let hue_free = self.palette == Palette::Grey;
        if ratio <= 1.0 {
            let depth = 1.0 - ratio;
            let cool = if hue_free { 0.0 } else { SHADOW_COOLING * depth };
            Oklab {
                l: tint.l * ratio.powf(SHADOW_CONTRAST),
                a: tint.a * (1.0 - 0.35 * depth) + 0.25 * cool,
                b: tint.b * (1.0 - 0.35 * depth) - cool,
            }
        } else {
            let warm = if hue_free { 0.0 } else { SUNLIGHT_WARMING * (ratio - 1.0) };
            Oklab { l: 1.0 - (1.0 - tint.l) * ratio.powf(-SUNLIGHT_CONTRAST), a: tint.a, b: tint.b + warm }
        }
    }

    fn check(&self) -> Result<()> {
        let share = |name: &str, value: f64| {
            if (0.0..=1.0).contains(&value) {
                Ok(())
            } else {
                Err(Error::value(name, value, "allowed: 0 to 1"))
            }
        };
        share("ambient light", self.ambient)?;
        share("share of multidirectional light", self.sun.multidirectional)?;
        if !self.sun.azimuth.is_finite() {
            return Err(Error::value("sun azimuth", self.sun.azimuth, "allowed: a finite number of degrees"));
        }
        if !(self.sun.altitude > 0.0 && self.sun.altitude <= 90.0) {
            return Err(Error::value("sun altitude", self.sun.altitude, "allowed: above 0 up to 90 degrees"));
        }
        if let Exaggeration::By(factor) = self.exaggeration
            && !(factor.is_finite() && factor > 0.0)
        {
            return Err(Error::value("vertical exaggeration", factor, "allowed: a positive finite number"));
        }
        if let Some((low, high)) = self.range
            && !(low.is_finite() && high.is_finite() && low < high)
        {
            let found = format!("{low},{high}");
            return Err(Error::value("height range", found, "allowed: two finite heights, the lower first"));
        }
        Ok(())
    }
}

/// Exponent of the light on the lightness of shadows; 1/3 would be the physics of a matt surface.
const SHADOW_CONTRAST: f32 = 0.62;
/// The same on the distance to white for slopes brighter than flat ground.
const SUNLIGHT_CONTRAST: f32 = 1.1;
/// Shift towards blue in full shadow, OKLab units.
const SHADOW_COOLING: f32 = 0.035;
/// Shift towards yellow for twice the light of flat ground, OKLab units.
const SUNLIGHT_WARMING: f32 = 0.030;

/// The colour of a void pixel: light grey with darker diagonal lines, unlike any ground.
pub(super) fn void_color(at: Cell) -> Rgb {
    if (at.row + at.col) % 8 < 2 { Rgb::hex(0xb4_b4_b6) } else { Rgb::hex(0xe2_e2_e4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::CellSize;
    use crate::grid::Mask;

    fn hills(rows: usize, cols: usize) -> Grid<f32> {
        Grid::from_fn(rows, cols, |c| {
            (300.0 + 80.0 * (c.row as f64 / 5.0).sin() + 60.0 * (c.col as f64 / 4.0).cos()) as f32
        })
    }

    fn dem(heights: Grid<f32>) -> Dem {
        Dem::new(heights, CellSize::square(30.0).unwrap()).unwrap()
    }

    #[test]
    fn flat_terrain_is_one_colour_and_it_is_the_tint() {
        let flat = dem(Grid::filled(9, 9, 500.0));
        let picture =
            Relief { range: Some((0.0, 1000.0)), ..Relief::default() }.scaled(2).draw(&flat).unwrap();
        let tint = Palette::Alpine.color(0.5);
        for pixel in picture.pixels().as_slice() {
            let off = |a: u8, b: u8| a.abs_diff(b) <= 1;
            assert!(
                off(pixel.r, tint.r) && off(pixel.g, tint.g) && off(pixel.b, tint.b),
                "{pixel:?} {tint:?}"
            );
        }
    }

    #[test]
    fn slopes_to_the_sun_are_lighter_in_every_palette() {
        let roof = Grid::from_fn(20, 20, |c| -20.0 * (c.row as f32 + c.col as f32 - 19.0).abs());
        for palette in [Palette::Alpine, Palette::Arid, Palette::Lunar, Palette::Grey] {
            let picture = Relief::with_palette(palette).draw(&dem(roof.clone())).unwrap();
            let lit = picture.pixels()[Cell::new(5, 5)].lightness();
            let dark = picture.pixels()[Cell::new(14, 14)].lightness();
            assert!(lit > dark + 0.15, "{palette:?}: {lit} against {dark}");
        }
    }

    #[test]
    fn grey_has_no_hue() {
        let picture = Relief::with_palette(Palette::Grey).draw(&dem(hills(30, 30))).unwrap();
        for p in picture.pixels().as_slice() {
            assert!(p.r.abs_diff(p.g) <= 1 && p.g.abs_diff(p.b) <= 1, "{p:?}");
        }
    }

    #[test]
    fn voids_are_hatched_and_touch_nothing_else() {
        let heights = hills(12, 12);
        let mut valid: Mask = heights.map(|_| true);
        for col in 4..9 {
            valid[Cell::new(6, col)] = false;
        }
        let holed = Dem::with_voids(heights.clone(), valid.clone(), CellSize::square(30.0).unwrap()).unwrap();
        let style = Relief::default().fixed_for(&dem(heights.clone())).scaled(3);
        let (with, without) = (style.draw(&holed).unwrap(), style.draw(&dem(heights)).unwrap());
        for (at, &pixel) in with.pixels().cells() {
            if valid[Cell::new(at.row / 3, at.col / 3)] {
                assert_ne!(pixel, void_color(at));
                if at.row / 3 < 3 || at.row / 3 > 9 {
                    assert_eq!(pixel, without.pixels()[at], "a void reaches four cells away");
                }
            } else {
                assert_eq!(pixel, void_color(at));
            }
        }
    }

    #[test]
    fn automatic_exaggeration_reaches_its_target() {
        let hills = dem(hills(40, 40));
        let Exaggeration::By(k) = Relief::default().fixed_for(&hills).exaggeration else {
            panic!("not fixed")
        };
        let slopes = gradients(hills.heights(), hills.valid(), hills.cell_size());
        let mean =
            slopes.as_slice().iter().map(|g| f64::from(g.steepness())).sum::<f64>() / slopes.len() as f64;
        assert!((k * mean - Exaggeration::TARGET).abs() < 1e-6);
        let fixed = Relief::default().fixed_for(&hills);
        assert_eq!(fixed.draw(&hills).unwrap(), Relief::default().draw(&hills).unwrap());
    }

    #[test]
    fn fields_out_of_range_are_named() {
        let flat = dem(Grid::filled(2, 2, 1.0));
        let bad = [
            (Relief { ambient: 1.5, ..Relief::default() }, "ambient"),
            (Relief { scale: 0, ..Relief::default() }, "pixels per cell"),
            (Relief { range: Some((5.0, 5.0)), ..Relief::default() }, "height range"),
            (Relief { exaggeration: Exaggeration::By(0.0), ..Relief::default() }, "exaggeration"),
            (Relief { sun: Sun { altitude: 0.0, ..Sun::default() }, ..Relief::default() }, "altitude"),
            (Relief { sun: Sun { azimuth: f64::NAN, ..Sun::default() }, ..Relief::default() }, "azimuth"),
        ];
        for (style, name) in bad {
            let message = style.draw(&flat).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }

    #[test]
    fn the_same_terrain_is_the_same_bytes() {
        let draw = || Relief::default().scaled(3).draw(&dem(hills(33, 21))).unwrap().to_png();
        assert_eq!(draw(), draw());
    }
}
