//! Text in pictures, set in Inter (SIL Open Font License 1.1, `fonts/OFL.txt`).
//!
//! The two embedded fonts are subsets: Latin with accents, Greek small letters, arrows, typographic signs. Any other
//! character appears as the font's box.

use super::{Picture, Rgb};
use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};
use std::sync::LazyLock;

static REGULAR: LazyLock<FontRef<'static>> =
    LazyLock::new(|| embedded(include_bytes!("fonts/Inter-Regular.subset.otf")));
static SEMI_BOLD: LazyLock<FontRef<'static>> =
    LazyLock::new(|| embedded(include_bytes!("fonts/Inter-SemiBold.subset.otf")));

fn embedded(bytes: &'static [u8]) -> FontRef<'static> {
    FontRef::try_from_slice(bytes).expect("the embedded font is whole")
}

/// Thickness of the strokes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weight {
    Regular,
    SemiBold,
}

/// How text is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lettering {
    /// Size of the em in pixels.
    pub(super) size: f32,
    pub(super) weight: Weight,
    pub(super) colour: Rgb,
}

/// Which way text runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    /// To the right.
    Across,
    /// Upwards, as on the spine of a chart.
    Up,
}

impl Lettering {
    pub(super) fn new(size: f32, weight: Weight, colour: Rgb) -> Self {
        Self { size, weight, colour }
    }

    fn font(self) -> &'static FontRef<'static> {
        match self.weight {
            Weight::Regular => &REGULAR,
            Weight::SemiBold => &SEMI_BOLD,
        }
    }

    fn scale(self) -> PxScale {
        let font = self.font();
        // ab_glyph counts sizes from ascent to descent; everybody else by the em.
        let em = font.units_per_em().unwrap_or(1000.0);
        PxScale::from(self.size * font.height_unscaled() / em)
    }

    /// Distance between two baselines, pixels.
    pub(super) fn line_height(self) -> usize {
        (self.size * 1.35).round() as usize
    }

    /// Width of a line, pixels.
    pub(super) fn width(self, text: &str) -> usize {
        self.layout(text).1.ceil() as usize
    }

    fn layout(self, text: &str) -> (Vec<Glyph>, f32) {
        let font = self.font().as_scaled(self.scale());
        let mut pen = 0.0;
        let mut glyphs = Vec::new();
        for letter in text.chars() {
            let mut glyph = font.scaled_glyph(letter);
            glyph.position = point(pen, 0.0);
            pen += font.h_advance(glyph.id);
            glyphs.push(glyph);
        }
        (glyphs, pen)
    }

    /// Writes a line whose baseline starts at `row`, `col`.
    pub(super) fn write(
        self,
        picture: &mut Picture,
        row: usize,
        col: usize,
        text: &str,
        direction: Direction,
    ) {
        for glyph in self.layout(text).0 {
            let Some(outline) = self.font().outline_glyph(glyph) else { continue };
            let bounds = outline.px_bounds();
            outline.draw(|x, y, coverage| {
                let (along, above) = (bounds.min.x as isize + x as isize, bounds.min.y as isize + y as isize);
                let (row, col) = (row as isize, col as isize);
                let (row, col) = match direction {
                    Direction::Across => (row + above, col + along),
                    Direction::Up => (row - along, col + above),
                };
                picture.blend(row, col, self.colour, coverage);
            });
        }
    }

    /// The text in lines no wider than `width` pixels, broken at spaces; a word that is wider keeps a line to itself.
    pub(super) fn wrap(self, text: &str, width: usize) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            if let Some(line) = lines.last_mut() {
                let longer = format!("{line} {word}");
                if self.width(&longer) <= width {
                    *line = longer;
                    continue;
                }
            }
            lines.push(word.to_owned());
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    fn plain(size: f32) -> Lettering {
        Lettering::new(size, Weight::Regular, Rgb::BLACK)
    }

    #[test]
    fn letters_stand_on_the_baseline_within_their_width() {
        let text = plain(40.0);
        let mut picture = Picture::filled(60, 200, Rgb::WHITE);
        text.write(&mut picture, 45, 10, "HEH", Direction::Across);
        let inked = |c: &Cell| picture.pixels()[*c] != Rgb::WHITE;
        let cells: Vec<Cell> = picture.pixels().cells().map(|(c, _)| c).filter(inked).collect();
        let rows = (cells.iter().map(|c| c.row).min(), cells.iter().map(|c| c.row).max());
        let right = cells.iter().map(|c| c.col).max().unwrap();
        // Capitals of Inter are 0.727 em high: 29 of 40 pixels above the baseline.
        assert_eq!(rows, (Some(15), Some(44)));
        assert!(right <= 10 + text.width("HEH") && right + 8 > 10 + text.width("HEH"), "{right}");
    }

    #[test]
    fn all_signs_that_the_program_uses_are_in_the_fonts() {
        for weight in [Weight::Regular, Weight::SemiBold] {
            let font = Lettering::new(12.0, weight, Rgb::BLACK).font();
            for sign in "AZaz09 −×±≤≥°²³µ·→–—‘’“”…éßσ".chars() {
                assert_ne!(font.glyph_id(sign).0, 0, "{sign} is missing");
            }
        }
    }

    #[test]
    fn upward_text_is_the_same_turned() {
        let (mut across, mut up) =
            (Picture::filled(100, 100, Rgb::WHITE), Picture::filled(100, 100, Rgb::WHITE));
        plain(20.0).write(&mut across, 50, 20, "Relief", Direction::Across);
        plain(20.0).write(&mut up, 79, 50, "Relief", Direction::Up);
        for (cell, &pixel) in across.pixels().cells() {
            assert_eq!(up.pixels()[Cell::new(99 - cell.col, cell.row)], pixel);
        }
    }

    #[test]
    fn wrapping_keeps_every_word_and_the_width() {
        let text = "Natural neighbour interpolation of all ridge and valley heights";
        let lines = plain(14.0).wrap(text, 120);
        assert_eq!(lines.join(" "), text);
        assert!(lines.len() > 2 && lines.iter().all(|line| plain(14.0).width(line) <= 120));
    }
}
