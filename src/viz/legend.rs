//! What explains a picture: colour bars, scale bars, keys.

use super::lettering::{Direction, Lettering, Weight};
use super::palette::Palette;
use super::ticks::{label, round_up, ticks};
use super::{Picture, Rgb};
use crate::error::{Error, Result};

/// Ink of text and lines on sheets.
pub(super) const INK: Rgb = Rgb::hex(0x26_28_2c);
/// Ink of secondary text.
pub(super) const SOFT_INK: Rgb = Rgb::hex(0x5c_60_68);

/// A palette with the numbers that it stands for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColorBar {
    palette: Palette,
    low: f64,
    high: f64,
    title: String,
    open: bool,
}

impl ColorBar {
    /// `title` names quantity and unit ("Height, m"); `low` and `high` get the first and last colour.
    ///
    /// # Errors
    /// When the numbers are not finite or not in order.
    pub(crate) fn new(palette: Palette, low: f64, high: f64, title: impl Into<String>) -> Result<Self> {
        if !(low.is_finite() && high.is_finite() && low < high) {
            let found = format!("{low},{high}");
            return Err(Error::value(
                "range of the colour bar",
                found,
                "allowed: two numbers, the lower first",
            ));
        }
        Ok(Self { palette, low, high, title: title.into(), open: false })
    }

    /// Signed differences from `-limit` to `limit`; its ends say that larger differences have the same colour.
    ///
    /// # Errors
    /// When `limit` is not positive and finite.
    pub(crate) fn difference(limit: f64, title: impl Into<String>) -> Result<Self> {
        if !(limit.is_finite() && limit > 0.0) {
            return Err(Error::value("limit of the differences", limit, "allowed: positive and finite"));
        }
        Ok(Self { open: true, ..Self::new(Palette::Difference, -limit, limit, title)? })
    }
}

/// One block under a sheet's panels.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Legend {
    Bar(ColorBar),
    /// Metres a pixel.
    Scale(f64),
    Key(Vec<(Rgb, String)>),
}

impl Legend {
    /// (height, width) in pixels when text is `size` pixels large.
    pub(super) fn shape(&self, size: f32) -> (usize, usize) {
        let text = Lettering::new(size, Weight::Regular, INK);
        let unit = size.round() as usize;
        let width = match self {
            Self::Bar(bar) => (16 * unit).max(text.width(&bar.title)),
            Self::Scale(metres) => scale_length(*metres, size).0 + 4 * unit,
            Self::Key(entries) => {
                let lengths = entries.iter().map(|(_, name)| 2 * unit + text.width(name));
                lengths.max().unwrap_or(0)
            }
        };
        let lines = match self {
            Self::Key(entries) => entries.len() * (unit * 3 / 2),
            _ => unit * 7 / 2,
        };
        (lines, width)
    }

    /// Draws the block with its north-west corner at `top`, `left`.
    pub(super) fn draw(&self, picture: &mut Picture, top: usize, left: usize, size: f32) {
        match self {
            Self::Bar(bar) => draw_bar(bar, picture, top, left, size),
            Self::Scale(metres) => draw_scale(*metres, picture, top, left, size),
            Self::Key(entries) => {
                let text = Lettering::new(size, Weight::Regular, INK);
                let unit = size.round() as usize;
                for (i, (colour, name)) in entries.iter().enumerate() {
                    let row = top + i * (unit * 3 / 2);
                    picture.fill(row + unit / 4, left, unit * 3 / 4, unit * 5 / 4, SOFT_INK);
                    picture.fill(row + unit / 4 + 1, left + 1, unit * 3 / 4 - 2, unit * 5 / 4 - 2, *colour);
                    text.write(picture, row + unit, left + 2 * unit, name, Direction::Across);
                }
            }
        }
    }
}

fn draw_bar(bar: &ColorBar, picture: &mut Picture, top: usize, left: usize, size: f32) {
    let unit = size.round() as usize;
    let text = Lettering::new(size, Weight::Regular, INK);
    let small = Lettering::new(size * 0.88, Weight::Regular, SOFT_INK);
    text.write(picture, top + unit, left, &bar.title, Direction::Across);
    let (width, height, row) = (14 * unit, unit * 4 / 5, top + unit * 3 / 2);
    let left = left + unit;
    picture.fill(row - 1, left - 1, height + 2, width + 2, SOFT_INK);
    for col in 0..width {
        let colour = bar.palette.color(col as f32 / (width - 1) as f32);
        picture.fill(row, left + col, height, 1, colour);
    }
    let (mut at, step) = ticks(bar.low, bar.high, 5);
    if bar.open {
        // The ends carry the meaning here, so they are named even when they are no round step.
        at = vec![bar.low, bar.low / 2.0, 0.0, bar.high / 2.0, bar.high];
    }
    let step = if bar.open { bar.high / 2.0 } else { step };
    let last = at.len() - 1;
    for (i, value) in at.into_iter().enumerate() {
        let col = left + ((value - bar.low) / (bar.high - bar.low) * (width - 1) as f64).round() as usize;
        picture.fill(row + height + 1, col, unit / 4, 1, SOFT_INK);
        let mut name = label(value, step);
        if bar.open && i == 0 {
            name = format!("\u{2264} {name}");
        } else if bar.open && i == last {
            name = format!("\u{2265} {name}");
        }
        let start = col.saturating_sub(small.width(&name) / 2);
        small.write(picture, row + height + unit * 5 / 4, start, &name, Direction::Across);
    }
}

/// Length of the scale bar in pixels and in metres: a round number near 10 times the text size.
fn scale_length(metres: f64, size: f32) -> (usize, f64) {
    let ground = round_up(f64::from(size) * 7.0 * metres);
    ((ground / metres).round() as usize, ground)
}

fn draw_scale(metres: f64, picture: &mut Picture, top: usize, left: usize, size: f32) {
    let unit = size.round() as usize;
    let small = Lettering::new(size * 0.88, Weight::Regular, SOFT_INK);
    let (length, ground) = scale_length(metres, size);
    let (row, height, left) = (top + unit * 3 / 2, (unit / 3).max(3), left + unit / 2);
    picture.fill(row, left, height, length, INK);
    for part in [1, 3] {
        let (from, to) = (part * length / 4, (part + 1) * length / 4);
        picture.fill(row + 1, left + from, height - 2, to - from - usize::from(part == 3), Rgb::WHITE);
    }
    let (unit_name, value) = if ground >= 1000.0 { ("km", ground / 1000.0) } else { ("m", ground) };
    let name = format!("{} {unit_name}", label(value, value));
    for (text, at) in [("0", 0), (name.as_str(), length)] {
        let start = (left + at).saturating_sub(small.width(text.trim_end_matches([' ', 'k', 'm'])) / 2);
        small.write(picture, row + height + unit * 5 / 4, start, text, Direction::Across);
    }
}
