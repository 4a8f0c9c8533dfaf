//! An RGB picture and its PNG form.

use super::Rgb;
use crate::error::{Error, Result};
use crate::file;
use crate::grid::{Cell, Grid};
use std::path::Path;

/// A picture of `rows` x `cols` pixels, 8-bit sRGB, row 0 at the top. Never empty.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture(Grid<Rgb>);

impl Picture {
    /// One colour everywhere.
    ///
    /// # Panics
    /// When a side is 0.
    #[must_use]
    pub(crate) fn filled(rows: usize, cols: usize, colour: Rgb) -> Self {
        Self(Grid::filled(rows, cols, colour))
    }

    /// The colour of `f` at every pixel.
    ///
    /// # Panics
    /// When a side is 0.
    pub(crate) fn from_fn(rows: usize, cols: usize, f: impl FnMut(Cell) -> Rgb) -> Self {
        Self(Grid::from_fn(rows, cols, f))
    }

    /// Number of rows.
    #[must_use]
    pub(crate) fn rows(&self) -> usize {
        self.0.rows()
    }

    /// Number of columns.
    #[must_use]
    pub(crate) fn cols(&self) -> usize {
        self.0.cols()
    }

    /// (rows, columns).
    #[must_use]
    pub(crate) fn shape(&self) -> (usize, usize) {
        self.0.shape()
    }

    /// The pixels.
    #[must_use]
    pub(crate) fn pixels(&self) -> &Grid<Rgb> {
        &self.0
    }

    /// The pixels, to be changed.
    pub(crate) fn pixels_mut(&mut self) -> &mut Grid<Rgb> {
        &mut self.0
    }

    /// Lays `colour` over a pixel with an opacity of 0 to 1; positions outside the picture are left out.
    pub(super) fn blend(&mut self, row: isize, col: isize, colour: Rgb, opacity: f32) {
        let (Ok(row), Ok(col)) = (usize::try_from(row), usize::try_from(col)) else { return };
        if row < self.rows() && col < self.cols() && opacity > 0.0 {
            let pixel = &mut self.0[Cell::new(row, col)];
            *pixel = colour.over(*pixel, opacity);
        }
    }

    /// Fills the rectangle whose north-west pixel is `top`, `left`; what reaches past the frame is left out.
    pub(super) fn fill(&mut self, top: usize, left: usize, rows: usize, cols: usize, colour: Rgb) {
        for row in top..(top + rows).min(self.rows()) {
            for col in left..(left + cols).min(self.cols()) {
                self.0[Cell::new(row, col)] = colour;
            }
        }
    }

    /// Copies `picture` with its north-west pixel at `top`, `left`; what reaches past the frame is left out.
    pub(super) fn paste(&mut self, picture: &Self, top: usize, left: usize) {
        for (cell, &colour) in picture.0.cells() {
            let (row, col) = (top + cell.row, left + cell.col);
            if row < self.rows() && col < self.cols() {
                self.0[Cell::new(row, col)] = colour;
            }
        }
    }

    /// The picture with every block of `factor` x `factor` pixels averaged in linear light into one; rows and columns
    /// that do not fill a last block form a smaller block of their own.
    ///
    /// # Panics
    /// When `factor` is 0.
    #[must_use]
    pub(crate) fn shrunk(&self, factor: usize) -> Self {
        assert!(factor > 0, "a picture shrinks by a factor of at least 1");
        let (rows, cols) = (self.rows().div_ceil(factor), self.cols().div_ceil(factor));
        Self::from_fn(rows, cols, |block| {
            let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
            for row in block.row * factor..((block.row + 1) * factor).min(self.rows()) {
                for col in block.col * factor..((block.col + 1) * factor).min(self.cols()) {
                    let Rgb { r, g, b } = self.0[Cell::new(row, col)];
                    for (total, channel) in sum.iter_mut().zip([r, g, b]) {
                        *total += super::color::decode(channel);
                    }
                    count += 1.0;
                }
            }
            let [r, g, b] = sum.map(|total| super::color::encode(total / count));
            Rgb { r, g, b }
        })
    }

    /// The picture as a PNG file, 8-bit RGB, marked as sRGB, compressed well (the strongest setting saves 2 % more in three times the time).
    ///
    /// # Panics
    /// When a side is longer than 2^31 - 1 pixels, which PNG cannot hold; such a picture does not fit into memory.
    #[must_use]
    pub(crate) fn to_png(&self) -> Vec<u8> {
        let side = |n: usize| u32::try_from(n).expect("a picture's side fits into PNG");
        let bytes: Vec<u8> = self.0.as_slice().iter().flat_map(|c| [c.r, c.g, c.b]).collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, side(self.cols()), side(self.rows()));
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.set_compression(png::Compression::Balanced);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(&bytes)?;
            writer.finish()
        });
        written.expect("writing a well-formed picture to memory cannot fail");
        file
    }

    /// The picture in a PNG file that [`to_png`](Self::to_png) wrote: 8-bit RGB.
    ///
    /// # Errors
    /// When the bytes are no such file.
    pub(crate) fn from_png(bytes: &[u8]) -> Result<Self> {
        let damaged =
            |e: png::DecodingError| Error::value("PNG data", e, "allowed: a picture of this program");
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().map_err(damaged)?;
        let (colour, depth) = reader.output_color_type();
        let size = reader.output_buffer_size();
        let (Some(size), true) = (size, (colour, depth) == (png::ColorType::Rgb, png::BitDepth::Eight))
        else {
            return Err(Error::value("PNG colours", format!("{colour:?}, {depth:?}"), "allowed: 8-bit RGB"));
        };
        let mut data = vec![0; size];
        let info = reader.next_frame(&mut data).map_err(damaged)?;
        let pixels = data.as_chunks::<3>().0;
        let (rows, cols) = (info.height as usize, info.width as usize);
        Ok(Self::from_fn(rows, cols, |cell| {
            let [r, g, b] = pixels[cell.row * cols + cell.col];
            Rgb { r, g, b }
        }))
    }

    /// Writes the picture as a PNG file: whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn write_png(&self, path: &Path) -> Result<()> {
        file::write_bytes(path, &self.to_png())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colourful(rows: usize, cols: usize) -> Picture {
        Picture::from_fn(rows, cols, |c| Rgb {
            r: (c.row * 37 + c.col) as u8,
            g: (c.row ^ c.col) as u8,
            b: (c.col * 11) as u8,
        })
    }

    #[test]
    fn png_decodes_back_to_the_same_pixels() {
        for (rows, cols) in [(1, 1), (3, 70), (64, 5)] {
            let picture = colourful(rows, cols);
            assert_eq!(Picture::from_png(&picture.to_png()).unwrap(), picture);
        }
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        let whole = colourful(9, 9).to_png();
        for bad in [&b"GIF89a"[..], &whole[..whole.len() / 2]] {
            assert!(Picture::from_png(bad).unwrap_err().to_string().contains("PNG data"));
        }
    }

    #[test]
    fn the_same_picture_is_the_same_bytes() {
        assert_eq!(colourful(50, 60).to_png(), colourful(50, 60).to_png());
    }

    #[test]
    fn writing_replaces_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, "old").unwrap();
        colourful(4, 4).write_png(&path).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), colourful(4, 4).to_png());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let nowhere = folder.path().join("missing/b.png");
        let message = colourful(4, 4).write_png(&nowhere).unwrap_err().to_string();
        assert!(message.contains("b.png"), "{message}");
    }

    #[test]
    fn shrinking_averages_light() {
        let checks =
            Picture::from_fn(5, 4, |c| if (c.row + c.col) % 2 == 0 { Rgb::WHITE } else { Rgb::BLACK });
        let small = checks.shrunk(2);
        assert_eq!(small.shape(), (3, 2));
        // Half the light of white is sRGB 188, not 128.
        assert_eq!(small.pixels()[Cell::new(0, 0)], Rgb::hex(0xbc_bc_bc));
    }
}
