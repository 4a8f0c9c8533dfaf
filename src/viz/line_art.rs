//! Ridges and valleys as a pen would draw them.
//!
//! [`LineMap`] or [`Sketch`] -> [`LineArt`] -> lines over a picture, or on paper. Anti-aliased by the distance to each
//! segment; every layer (casing, valleys, ridges) keeps its highest coverage per pixel and is laid on once, so the order
//! of strokes does not matter. Colours as in Liu & Benes 2025, figure 6: ridges yellow, valleys blue. Cost: O(total
//! line length x width) pixels, whatever the number of vertices.

use super::color::Oklab;
use super::upsample::check_scale;
use super::{Picture, Rgb};
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::grid::d8;
use crate::sketch::{LineMap, Sketch, StrokeKind};

/// How lines are drawn over a picture. Widths are in cells of the map, so that they grow with the picture's scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LineStyle {
    /// Colour of ridges.
    pub(crate) ridge: Rgb,
    /// Colour of valleys.
    pub(crate) valley: Rgb,
    /// Width in cells; never thinner than 1.1 pixels.
    pub(crate) width: f64,
    /// Colour of the rim on both sides.
    pub(crate) casing: Rgb,
    /// Opacity of the rim, 0 to 1.
    pub(crate) casing_opacity: f32,
    /// Width of the rim on each side in cells; never thinner than 0.6 pixels. 0: no rim.
    pub(crate) casing_width: f64,
}

impl Default for LineStyle {
    fn default() -> Self {
        Self {
            ridge: Rgb::hex(0xff_c8_1f),
            valley: Rgb::hex(0x2f_86_ec),
            width: 0.6,
            casing: Rgb::hex(0x1a_1c_24),
            casing_opacity: 0.62,
            casing_width: 0.2,
        }
    }
}

/// The paper under a plain sketch.
const PAPER: Rgb = Rgb::hex(0xf7_f4_ec);
/// Lowest and highest tone of ridges and of valleys on paper.
const RIDGE_TONES: (Rgb, Rgb) = (Rgb::hex(0x7a_3d_0e), Rgb::hex(0xf0_9c_12));
const VALLEY_TONES: (Rgb, Rgb) = (Rgb::hex(0x0e_2c_66), Rgb::hex(0x62_a8_ea));

/// A straight piece of line: ends (x, y) in cells, heights there. Both ends may be one point, which is drawn as a dot.
#[derive(Clone, Copy, Debug)]
struct Segment {
    kind: StrokeKind,
    from: (f64, f64),
    to: (f64, f64),
    heights: (f64, f64),
}

/// Lines ready to be drawn on a map of `rows` x `cols` cells.
#[derive(Clone, Debug)]
pub(crate) struct LineArt {
    rows: usize,
    cols: usize,
    segments: Vec<Segment>,
}

impl From<&LineMap> for LineArt {
    /// Joins neighbouring cells of one kind. The steps of the raster are rounded off: a cell with two neighbours on its
    /// line is drawn up to half a cell towards the middle of them.
    fn from(lines: &LineMap) -> Self {
        let (rows, cols) = lines.shape();
        let kinds = lines.kinds();
        let same = |cell: Cell, code: u8| {
            d8::neighbour(cell, code, rows, cols).filter(|&there| kinds[there] == kinds[cell])
        };
        // Diagonal steps count only where no straight detour joins the two cells: no triangles at bends.
        let joined = |cell: Cell, code: u8| {
            let detour =
                code % 2 == 1 && (same(cell, (code + 1) % 8).or(same(cell, (code + 7) % 8)).is_some());
            if detour { None } else { same(cell, code) }
        };
        let links = |cell: Cell| (0..8).filter_map(move |code| joined(cell, code));
        let line_cells: Vec<Cell> =
            kinds.cells().filter(|(_, kind)| kind.is_some()).map(|(cell, _)| cell).collect();
        let mut place = kinds.map(|_| (0.0, 0.0));
        for &cell in &line_cells {
            place[cell] = (cell.col as f64, cell.row as f64);
        }
        for _ in 0..2 {
            let before = place.clone();
            for &cell in &line_cells {
                let mut ends = links(cell);
                if let (Some(a), Some(b), None) = (ends.next(), ends.next(), ends.next()) {
                    let ((x, y), (xa, ya), (xb, yb)) = (before[cell], before[a], before[b]);
                    place[cell] = ((2.0 * x + xa + xb) / 4.0, (2.0 * y + ya + yb) / 4.0);
                }
            }
        }
        let height = |cell: Cell| f64::from(lines.heights()[cell]);
        let mut segments = Vec::new();
        for &cell in &line_cells {
            let Some(kind) = kinds[cell] else { continue };
            let mut alone = true;
            for there in links(cell) {
                alone = false;
                if there > cell {
                    let heights = (height(cell), height(there));
                    segments.push(Segment { kind, from: place[cell], to: place[there], heights });
                }
            }
            if alone {
                let heights = (height(cell), height(cell));
                segments.push(Segment { kind, from: place[cell], to: place[cell], heights });
            }
        }
        Self { rows, cols, segments }
    }
}

impl TryFrom<&Sketch> for LineArt {
    type Error = Error;

    /// Strokes as they are; what lies off the map will not be seen.
    fn try_from(sketch: &Sketch) -> Result<Self> {
        let mut segments = Vec::new();
        for (number, stroke) in sketch.strokes.iter().enumerate() {
            if let Some((i, bad)) = stroke
                .vertices
                .iter()
                .enumerate()
                .find(|(_, v)| !(v.x.is_finite() && v.y.is_finite() && v.z.is_finite()))
            {
                let name = format!("stroke {number}, vertex {i}");
                return Err(Error::value(name, format!("{bad:?}"), "allowed: finite coordinates and height"));
            }
            let kind = stroke.kind;
            match stroke.vertices.as_slice() {
                [only] => segments.push(Segment {
                    kind,
                    from: (only.x, only.y),
                    to: (only.x, only.y),
                    heights: (only.z, only.z),
                }),
                many => segments.extend(many.windows(2).map(|pair| Segment {
                    kind,
                    from: (pair[0].x, pair[0].y),
                    to: (pair[1].x, pair[1].y),
                    heights: (pair[0].z, pair[1].z),
                })),
            }
        }
        Ok(Self { rows: sketch.rows, cols: sketch.cols, segments })
    }
}

impl LineArt {
    /// Draws the lines over `picture`, whose sides are the map's times one whole number.
    ///
    /// # Errors
    /// When the picture is of another shape, or a width is negative or not finite.
    pub(crate) fn overlay(&self, picture: &mut Picture, style: &LineStyle) -> Result<()> {
        let scale = self.scale_of(picture)?;
        for (name, width) in [("line width", style.width), ("width of the rim", style.casing_width)] {
            if !(width.is_finite() && width >= 0.0) {
                return Err(Error::value(name, width, "allowed: 0 or more cells"));
            }
        }
        let radius = (style.width * scale).max(1.1) / 2.0;
        if style.casing_width > 0.0 {
            let rim = radius + (style.casing_width * scale).max(0.6);
            let layer = self.layer(picture.shape(), scale, rim, |_| true);
            layer.lay_on(picture, style.casing_opacity, |_| style.casing);
        }
        for (kind, colour) in [(StrokeKind::Valley, style.valley), (StrokeKind::Ridge, style.ridge)] {
            self.layer(picture.shape(), scale, radius, |k| k == kind).lay_on(picture, 1.0, |_| colour);
        }
        Ok(())
    }

    /// The lines alone on light paper, `scale` pixels per cell; low lines are dark, high ones bright.
    ///
    /// # Errors
    /// When `scale` or a side of the map is out of range.
    pub(crate) fn on_paper(&self, scale: usize) -> Result<Picture> {
        check_scale(self.rows, self.cols, scale)?;
        if self.rows == 0 || self.cols == 0 {
            let found = format!("{}x{}", self.rows, self.cols);
            return Err(Error::value("map of the sketch", found, "allowed: at least 1x1"));
        }
        let mut picture = Picture::filled(self.rows * scale, self.cols * scale, PAPER);
        let heights = self.segments.iter().flat_map(|s| [s.heights.0, s.heights.1]);
        let (low, high) =
            heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), z| (lo.min(z), hi.max(z)));
        let radius = (0.6 * scale as f64).max(1.2) / 2.0;
        for (kind, (dark, bright)) in [(StrokeKind::Valley, VALLEY_TONES), (StrokeKind::Ridge, RIDGE_TONES)] {
            let (dark, bright) = (Oklab::from(dark), Oklab::from(bright));
            self.layer(picture.shape(), scale as f64, radius, |k| k == kind).lay_on(&mut picture, 1.0, |z| {
                let t = if high > low { (f64::from(z) - low) / (high - low) } else { 0.5 };
                dark.lerp(bright, t.clamp(0.0, 1.0) as f32).to_rgb()
            });
        }
        Ok(picture)
    }

    fn scale_of(&self, picture: &Picture) -> Result<f64> {
        let (rows, cols) = picture.shape();
        let scale = rows.checked_div(self.rows).unwrap_or(0);
        if scale == 0 || rows != self.rows * scale || cols != self.cols * scale {
            return Err(Error::value(
                "picture under the lines",
                format!("{rows}x{cols}"),
                format!("allowed: a whole multiple of the map's {}x{}", self.rows, self.cols),
            ));
        }
        Ok(scale as f64)
    }

    fn layer(
        &self,
        (rows, cols): (usize, usize),
        scale: f64,
        radius: f64,
        wanted: impl Fn(StrokeKind) -> bool,
    ) -> Layer {
        let mut layer =
            Layer { cols, rows, coverage: vec![0.0; rows * cols], heights: vec![0.0; rows * cols] };
        let to_pixels = |(x, y): (f64, f64)| ((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5);
        for segment in self.segments.iter().filter(|s| wanted(s.kind)) {
            layer.add(to_pixels(segment.from), to_pixels(segment.to), segment.heights, radius);
        }
        layer
    }
}

/// How much of every pixel the lines cover, and the height of the line that covers it most.
struct Layer {
    rows: usize,
    cols: usize,
    coverage: Vec<f32>,
    heights: Vec<f32>,
}

impl Layer {
    /// Adds a round-ended segment: steps along its longer axis and, at each step, across its width only.
    fn add(&mut self, from: (f64, f64), to: (f64, f64), heights: (f64, f64), radius: f64) {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let steep = dy.abs() > dx.abs();
        let (start, run, rise) = if steep { (from.1, dy, dx) } else { (from.0, dx, dy) };
        let origin_across = if steep { from.0 } else { from.1 };
        let (length, width) = if steep { (self.rows, self.cols) } else { (self.cols, self.rows) };
        let reach = radius + 1.0;
        let squared = dx * dx + dy * dy;
        for along in pixels(start.min(start + run) - reach, start.max(start + run) + reach, length) {
            let t = if run == 0.0 { 0.0 } else { ((along as f64 - start) / run).clamp(0.0, 1.0) };
            let middle = origin_across + t * rise;
            let half = reach * std::f64::consts::SQRT_2;
            for across in pixels(middle - half, middle + half, width) {
                let (row, col) = if steep { (along, across) } else { (across, along) };
                let (px, py) = (col as f64 - from.0, row as f64 - from.1);
                let s = if squared == 0.0 { 0.0 } else { ((px * dx + py * dy) / squared).clamp(0.0, 1.0) };
                let distance = (px - s * dx).hypot(py - s * dy);
                let coverage = (radius + 0.5 - distance).clamp(0.0, 1.0) as f32;
                let i = row * self.cols + col;
                let height = (heights.0 + s * (heights.1 - heights.0)) as f32;
                // Equal coverage: the higher line wins, whichever came first.
                if coverage > self.coverage[i] || (coverage == self.coverage[i] && height > self.heights[i]) {
                    self.coverage[i] = coverage;
                    self.heights[i] = height;
                }
            }
        }
    }

    fn lay_on(&self, picture: &mut Picture, opacity: f32, colour: impl Fn(f32) -> Rgb) {
        let pixels = picture.pixels_mut().as_mut_slice().iter_mut();
        for ((pixel, &coverage), &height) in pixels.zip(&self.coverage).zip(&self.heights) {
            if coverage > 0.0 {
                *pixel = colour(height).over(*pixel, coverage * opacity);
            }
        }
    }
}

/// The pixels from `low` to `high` that lie in a picture `side` pixels long.
fn pixels(low: f64, high: f64, side: usize) -> std::ops::Range<usize> {
    let first = low.floor().max(0.0) as usize;
    let last = (high.ceil() + 1.0).clamp(0.0, side as f64) as usize;
    first..last
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::{Stroke, Vertex};

    const GROUND: Rgb = Rgb::hex(0x88_90_80);

    fn stroke(kind: StrokeKind, points: &[(f64, f64, f64)]) -> Stroke {
        Stroke { kind, vertices: points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect() }
    }

    fn sketch(strokes: Vec<Stroke>) -> Sketch {
        Sketch { rows: 20, cols: 30, strokes }
    }

    #[test]
    fn a_line_covers_its_pixels_and_has_a_dark_rim() {
        let lines = sketch(vec![stroke(StrokeKind::Ridge, &[(4.0, 10.0, 1.0), (25.0, 10.0, 1.0)])]);
        let mut picture = Picture::filled(80, 120, GROUND);
        let style = LineStyle { width: 1.0, casing_width: 0.5, ..LineStyle::default() };
        LineArt::try_from(&lines).unwrap().overlay(&mut picture, &style).unwrap();
        let at = |row, col| picture.pixels()[Cell::new(row, col)];
        // Row 10 is centred between pixels 41 and 42; 4 pixels wide, then 2 pixels of rim.
        for row in 40..44 {
            assert_eq!(at(row, 60), style.ridge, "row {row}");
        }
        for row in [38, 39, 44, 45] {
            assert!(at(row, 60).lightness() < GROUND.lightness() - 0.2, "row {row}: {:?}", at(row, 60));
        }
        for (row, col) in [(36, 60), (47, 60), (41, 5), (41, 118), (0, 0)] {
            assert_eq!(at(row, col), GROUND, "{row},{col}");
        }
    }

    #[test]
    fn a_diagonal_line_has_soft_edges() {
        let lines = sketch(vec![stroke(StrokeKind::Valley, &[(2.0, 2.0, 0.0), (17.0, 14.0, 0.0)])]);
        let mut picture = Picture::filled(80, 120, Rgb::WHITE);
        let style = LineStyle { casing_width: 0.0, ..LineStyle::default() };
        LineArt::try_from(&lines).unwrap().overlay(&mut picture, &style).unwrap();
        let between = |p: &&Rgb| **p != Rgb::WHITE && **p != style.valley;
        assert!(picture.pixels().as_slice().iter().filter(between).count() > 40);
    }

    #[test]
    fn the_order_of_strokes_does_not_matter() {
        let strokes = vec![
            stroke(StrokeKind::Ridge, &[(2.0, 2.0, 5.0), (27.0, 17.0, 9.0)]),
            stroke(StrokeKind::Ridge, &[(2.0, 17.0, 1.0), (27.0, 2.0, 3.0)]),
            stroke(StrokeKind::Valley, &[(15.0, 1.0, 0.0), (15.0, 18.0, 2.0)]),
        ];
        let reversed = sketch(strokes.iter().rev().cloned().collect());
        let (a, b) = (LineArt::try_from(&sketch(strokes)).unwrap(), LineArt::try_from(&reversed).unwrap());
        assert_eq!(a.on_paper(4).unwrap(), b.on_paper(4).unwrap());
    }

    #[test]
    fn cells_of_a_map_are_drawn_where_they_are() {
        let mut lines = LineMap::empty(12, 12);
        for i in 2..10 {
            lines.set(Cell::new(i, i), StrokeKind::Ridge, 1.0);
        }
        lines.set(Cell::new(2, 9), StrokeKind::Valley, 0.0);
        let style = LineStyle::default();
        let mut picture = Picture::filled(60, 60, GROUND);
        LineArt::from(&lines).overlay(&mut picture, &style).unwrap();
        let at = |row: usize, col: usize| picture.pixels()[Cell::new(5 * row + 2, 5 * col + 2)];
        for i in 2..10 {
            assert_eq!(at(i, i), style.ridge, "cell {i}");
        }
        assert_eq!(at(2, 9), style.valley, "a single cell is a dot");
        assert_eq!(at(6, 2), GROUND);
    }

    #[test]
    fn a_bend_makes_no_triangle() {
        let mut lines = LineMap::empty(5, 5);
        for (row, col) in [(1, 1), (1, 2), (2, 2)] {
            lines.set(Cell::new(row, col), StrokeKind::Ridge, 1.0);
        }
        assert_eq!(LineArt::from(&lines).segments.len(), 2);
    }

    #[test]
    fn high_lines_are_brighter_on_paper() {
        let lines = sketch(vec![
            stroke(StrokeKind::Ridge, &[(2.0, 5.0, 0.0), (27.0, 5.0, 100.0)]),
            stroke(StrokeKind::Valley, &[(2.0, 15.0, 0.0), (27.0, 15.0, 100.0)]),
        ]);
        let picture = LineArt::try_from(&lines).unwrap().on_paper(4).unwrap();
        for row in [21, 61] {
            let at = |col: usize| picture.pixels()[Cell::new(row, col)].lightness();
            assert!(at(100) > at(60) + 0.05 && at(60) > at(20) + 0.05);
        }
    }

    #[test]
    fn bad_input_is_named_and_far_strokes_are_cheap() {
        let broken = sketch(vec![stroke(StrokeKind::Ridge, &[(2.0, 5.0, 0.0), (f64::NAN, 5.0, 100.0)])]);
        let message = LineArt::try_from(&broken).unwrap_err().to_string();
        assert!(message.contains("stroke 0, vertex 1"), "{message}");
        let far = sketch(vec![stroke(StrokeKind::Ridge, &[(-1e12, -1e12, 0.0), (1e12, 1e12, 1.0)])]);
        let far = LineArt::try_from(&far).unwrap();
        let mut picture = Picture::filled(40, 60, GROUND);
        far.overlay(&mut picture, &LineStyle::default()).unwrap();
        assert_ne!(picture.pixels()[Cell::new(21, 21)], GROUND);
        let wrong = far.overlay(&mut Picture::filled(41, 60, GROUND), &LineStyle::default());
        assert!(wrong.unwrap_err().to_string().contains("41x60"));
    }
}
