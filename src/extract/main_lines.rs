//! The few lines that a hand would draw first: the longest valleys and ridges of terrain, simplified.
//!
//! Heights and mask -> strokes, longest first. Where [`extract`](super::extract) gives every line that water has, this gives main
//! stems: from an outlet or a junction upstream along the donor that brings the most. Each is simplified (Ramer 1972, Douglas
//! & Peucker 1973) and its vertices are moved a little, as a hand would. One routing a kind; n log n.

use crate::error::{Error, Result};
use crate::flow::{self, Accumulation, FlowDirections, Surface};
use crate::grid::{Cell, Grid, Mask, gaussian};
use crate::seed::Seed;
use crate::sketch::{Stroke, StrokeKind, Vertex};
use rand::RngExt;
use rand_distr::StandardNormal;

/// How main lines are found and drawn. Lengths are in cells.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct MainLinesConfig {
    /// Standard deviation of the Gaussian that smooths the heights before routing, 0 to 100; strokes take its heights.
    pub(crate) smoothing: f64,
    /// A line cell drains at least this share of the map, above 0 to 1.
    pub(crate) share: f64,
    /// Lines with fewer cells are left out, at least 2.
    pub(crate) min_length: usize,
    /// Width of the strip along the frame that is cut off, where water follows the frame.
    pub(crate) border: usize,
    /// A vertex is dropped when the line without it stays this near, at least 0.
    pub(crate) tolerance: f64,
    /// Standard deviation by which vertices are moved along each axis, 0 to 100.
    pub(crate) jitter: f64,
}

impl Default for MainLinesConfig {
    fn default() -> Self {
        Self { smoothing: 1.0, share: 0.006, min_length: 24, border: 6, tolerance: 4.0, jitter: 1.5 }
    }
}

impl MainLinesConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of range, its value and what is allowed.
    pub(crate) fn validate(&self) -> Result<()> {
        let check = |ok: bool, name: &str, value: &dyn std::fmt::Display, allowed: &str| {
            if ok { Ok(()) } else { Err(Error::value(format!("main_lines.{name}"), value, allowed)) }
        };
        check(
            (0.0..=100.0).contains(&self.smoothing),
            "smoothing",
            &self.smoothing,
            "allowed: 0 to 100 cells",
        )?;
        check(self.share > 0.0 && self.share <= 1.0, "share", &self.share, "allowed: above 0 to 1")?;
        check(self.min_length >= 2, "min_length", &self.min_length, "allowed: at least 2 cells")?;
        check(
            self.tolerance.is_finite() && self.tolerance >= 0.0,
            "tolerance",
            &self.tolerance,
            "allowed: at least 0 cells",
        )?;
        check((0.0..=100.0).contains(&self.jitter), "jitter", &self.jitter, "allowed: 0 to 100 cells")
    }
}

/// The main lines of a map, longest first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MainLines {
    /// Valleys.
    pub(crate) valleys: Vec<Stroke>,
    /// Ridges.
    pub(crate) ridges: Vec<Stroke>,
}

impl MainLines {
    /// At most `most` lines of each kind.
    ///
    /// # Errors
    /// When `config` is out of range, shapes differ, a valid height is not finite, or no cell is valid.
    pub(crate) fn of(
        heights: &Grid<f32>,
        valid: &Mask,
        config: &MainLinesConfig,
        most: usize,
        seed: Seed,
    ) -> Result<Self> {
        config.validate()?;
        Surface::check(heights, valid)?;
        let smooth = gaussian::smooth(heights, valid, config.smoothing);
        let surface = Surface::new(smooth, valid.clone())?;
        let trace = |surface: &Surface, kind: StrokeKind, name: &str| {
            let directions = flow::route(surface);
            let accumulation = flow::accumulate(&directions);
            let least = (heights.len() as f64 * config.share).max(1.0) as u32;
            let mut lines = stems(&directions, &accumulation, least);
            lines.retain(|line| line.len() >= config.min_length);
            lines.sort_by_key(|line| std::cmp::Reverse(line.len()));
            let pen = Pen { heights: surface.heights(), valid, config, kind };
            let strokes = lines.iter().take(most).enumerate();
            strokes.filter_map(|(i, line)| pen.draw(line, seed.derive_indexed(name, i))).collect()
        };
        let (valleys, upside_down) = rayon::join(
            || trace(&surface, StrokeKind::Valley, "valley"),
            || trace(&surface.inverted(), StrokeKind::Ridge, "ridge"),
        );
        let upright = |stroke: Stroke| {
            let vertices = stroke.vertices.iter().map(|v| Vertex { z: -v.z, ..*v }).collect();
            Stroke { kind: StrokeKind::Ridge, vertices }
        };
        let ridges: Vec<Stroke> = upside_down;
        Ok(Self { valleys, ridges: ridges.into_iter().map(upright).collect() })
    }
}

/// Lines through which at least `least` cells drain, each from its lower end upstream along the greatest donors; a tributary
/// begins with the cell that it drains into.
fn stems(directions: &FlowDirections, accumulation: &Accumulation, least: u32) -> Vec<Vec<Cell>> {
    let counts = accumulation.counts();
    let (rows, cols) = counts.shape();
    let mut main_donor: Grid<Option<Cell>> = Grid::filled(rows, cols, None);
    let channels = || counts.cells().filter(|(_, count)| **count >= least).map(|(cell, _)| cell);
    for cell in channels() {
        if let Some(receiver) = directions.receiver(cell) {
            let donor = &mut main_donor[receiver];
            if donor.is_none_or(|other| counts[cell] > counts[other]) {
                *donor = Some(cell);
            }
        }
    }
    let mut lines = Vec::new();
    for cell in channels() {
        let receiver = directions.receiver(cell);
        if receiver.is_some_and(|r| main_donor[r] == Some(cell)) {
            continue;
        }
        let mut line: Vec<Cell> = receiver.into_iter().collect();
        let mut next = Some(cell);
        while let Some(here) = next {
            line.push(here);
            next = main_donor[here];
        }
        lines.push(line);
    }
    lines
}

/// What strokes are drawn with.
struct Pen<'a> {
    heights: &'a Grid<f32>,
    valid: &'a Mask,
    config: &'a MainLinesConfig,
    kind: StrokeKind,
}

impl Pen<'_> {
    /// The stroke along a line; none where little of it is left beside the frame.
    fn draw(&self, line: &[Cell], seed: Seed) -> Option<Stroke> {
        let (rows, cols) = self.heights.shape();
        let border = self.config.border;
        let inside = |i: usize, side: usize| i >= border && i + border < side;
        let kept = line.iter().filter(|c| inside(c.row, rows) && inside(c.col, cols));
        let kept: Vec<[f64; 2]> = kept.map(|c| [c.col as f64, c.row as f64]).collect();
        if kept.len() * 6 < self.config.min_length * 5 || kept.len() < 2 {
            return None;
        }
        let mut stream = seed.stream("jitter");
        let mut vertices = Vec::new();
        for [x, y] in simplified(&kept, self.config.tolerance) {
            let mut moved = |v: f64, side: usize| {
                (v + self.config.jitter * stream.sample::<f64, _>(StandardNormal))
                    .clamp(0.0, (side - 1) as f64)
            };
            let (x, y) = (moved(x, cols), moved(y, rows));
            // A vertex that jitter puts into a void has no height there.
            let z = self.height(x, y)?;
            vertices.push(Vertex { x, y, z });
        }
        Some(Stroke { kind: self.kind, vertices })
    }

    /// Bilinear; none beside a void.
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        let (rows, cols) = self.heights.shape();
        let (row, col) = (y.floor() as usize, x.floor() as usize);
        let (down, right) = (y - row as f64, x - col as f64);
        let mut sum = 0.0;
        for (row, share) in [(row, 1.0 - down), ((row + 1).min(rows - 1), down)] {
            for (col, part) in [(col, 1.0 - right), ((col + 1).min(cols - 1), right)] {
                let cell = Cell::new(row, col);
                if !self.valid[cell] {
                    return None;
                }
                sum += share * part * f64::from(self.heights[cell]);
            }
        }
        Some(sum)
    }
}

/// The fewest of the points (always the first and the last) from whose polyline none is farther than `tolerance`.
fn simplified(points: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let mut kept = vec![false; points.len()];
    let mut open = vec![(0, points.len() - 1)];
    (kept[0], kept[points.len() - 1]) = (true, true);
    while let Some((first, last)) = open.pop() {
        let (a, b) = (points[first], points[last]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = along[0].hypot(along[1]);
        let distance = |p: [f64; 2]| {
            let to = [p[0] - a[0], p[1] - a[1]];
            if length > 0.0 {
                (along[0] * to[1] - along[1] * to[0]).abs() / length
            } else {
                to[0].hypot(to[1])
            }
        };
        let between = (first + 1..last).map(|i| (i, distance(points[i])));
        let farthest = between.reduce(|best, next| if next.1 > best.1 { next } else { best });
        if let Some((middle, _)) = farthest.filter(|(_, d)| *d > tolerance) {
            kept[middle] = true;
            open.extend([(first, middle), (middle, last)]);
        }
    }
    points.iter().zip(kept).filter(|(_, kept)| *kept).map(|(p, _)| *p).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk valley to the south with a tributary from the north-west; ridges are the map's sides.
    fn valley() -> Grid<f32> {
        Grid::from_fn(96, 96, |c| {
            let (x, y) = (c.col as f32, c.row as f32);
            let trunk = (x - 48.0).abs();
            let branch = ((x - y) / 2.0f32.sqrt()).abs() + if y > 48.0 { 200.0 } else { 2.0 };
            trunk.min(branch) * 2.0 + (95.0 - y) * 0.5 + 0.01 * ((c.row * 7 + c.col * 13) % 10) as f32
        })
    }

    #[test]
    fn the_longest_valley_is_the_trunk() {
        let heights = valley();
        let valid = heights.map(|_| true);
        let config = MainLinesConfig { jitter: 0.0, ..Default::default() };
        let lines = MainLines::of(&heights, &valid, &config, 3, Seed(1)).unwrap();
        assert!(lines.valleys.len() <= 3 && lines.ridges.len() <= 3);
        let trunk = &lines.valleys[0];
        assert_eq!(trunk.kind, StrokeKind::Valley);
        let (low, high) = (&trunk.vertices[0], trunk.vertices.last().unwrap());
        assert!(low.y > 85.0 && (low.x - 48.0).abs() < 2.0, "{low:?}");
        assert!(low.z < high.z && high.y < 30.0, "{high:?}");
        for stroke in lines.ridges.iter().chain(&lines.valleys) {
            assert!(
                stroke.vertices.iter().all(|v| v.z > -10.0 && v.z < 300.0),
                "heights are those of the map"
            );
        }
        let again = MainLines::of(&heights, &valid, &config, 3, Seed(2)).unwrap();
        assert_eq!(lines, again, "without jitter no seed counts");
        let moved = MainLines::of(&heights, &valid, &MainLinesConfig::default(), 3, Seed(2)).unwrap();
        assert_ne!(lines, moved);
    }

    #[test]
    fn voids_give_no_heights() {
        let heights = valley();
        let valid = Grid::from_fn(96, 96, |c| c.row < 60 || c.col > 70);
        let spoilt = Grid::from_fn(96, 96, |c| if valid[c] { heights[c] } else { f32::NAN });
        let lines = MainLines::of(&spoilt, &valid, &MainLinesConfig::default(), 9, Seed(1)).unwrap();
        assert!(!lines.valleys.is_empty());
        for v in lines.ridges.iter().chain(&lines.valleys).flat_map(|s| &s.vertices) {
            assert!(v.z.is_finite() && valid[Cell::new(v.y.floor() as usize, v.x.floor() as usize)]);
        }
    }

    #[test]
    fn simplification_keeps_corners_only() {
        let corner: Vec<[f64; 2]> =
            (0..10).map(|i| [f64::from(i), 0.0]).chain((1..10).map(|i| [9.0, f64::from(i)])).collect();
        assert_eq!(simplified(&corner, 0.5), [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]);
        assert_eq!(simplified(&corner, 50.0).len(), 2);
    }

    #[test]
    fn bad_configuration_is_named() {
        let heights = valley();
        let config = MainLinesConfig { share: 0.0, ..Default::default() };
        let error = MainLines::of(&heights, &heights.map(|_| true), &config, 3, Seed(1)).unwrap_err();
        assert!(error.to_string().contains("main_lines.share"));
    }
}
