//! Lines that wander: a smooth random field moves them sideways, as a hand's or a river's would.
//!
//! [`Displacement`] is the field. It moves the plane, not each line for itself: lines that meet still meet, a closed line stays
//! closed, and corners move as what lies between them does. Linear in the cells of the map.

use super::Sketch;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, gaussian};
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;

/// Standard deviations of the fields of [`Sketch::wandering`], cells, and the share of the square of the amount that each has.
const FIELDS: [(f64, f64); 2] = [(12.0, 0.64), (4.0, 0.36)];
/// Cells from the frame over which wandering grows to its full amount: a line that ends at the frame still does.
const TAPER: f64 = 8.0;
/// Longest piece of a line that stays straight, cells.
const PIECE: f64 = 2.0;
/// Most that lines wander, cells.
const MOST: f64 = 16.0;

/// A smooth random displacement of every cell.
pub(crate) struct Displacement {
    down: Grid<f64>,
    right: Grid<f64>,
}

impl Displacement {
    /// A field of root mean square `amount` in either direction, smoothed by a Gaussian of `sigma`, both in cells.
    pub(crate) fn new((rows, cols): (usize, usize), sigma: f64, amount: f64, seed: Seed) -> Self {
        let field = |name: &str| {
            let mut stream = seed.stream(name);
            let noise = Grid::from_fn(rows, cols, |_| stream.sample::<f32, _>(StandardNormal));
            let smooth = gaussian::smooth(&noise, &noise.map(|_| true), sigma);
            let squares: f64 = smooth.as_slice().iter().map(|v| f64::from(*v).powi(2)).sum();
            let scale = amount / (squares / smooth.len() as f64).sqrt().max(1e-12);
            smooth.map(|v| f64::from(*v) * scale)
        };
        let (down, right) = rayon::join(|| field("displacement down"), || field("displacement right"));
        Self { down, right }
    }

    /// Moves every vertex by the field at its cell, less within `taper` cells of the frame; none leaves the map.
    pub(crate) fn apply(&self, sketch: &mut Sketch, taper: f64) {
        let (rows, cols) = self.down.shape();
        let (bottom, right) = ((rows - 1) as f64, (cols - 1) as f64);
        for v in sketch.strokes.iter_mut().flat_map(|s| &mut s.vertices) {
            let (y, x) = (v.y.clamp(0.0, bottom), v.x.clamp(0.0, right));
            let cell = Cell::new(y as usize, x as usize);
            let gap = x.min(y).min(bottom - y).min(right - x);
            let share = if gap < taper { gap / taper } else { 1.0 };
            v.y = (y + share * self.down[cell]).clamp(0.0, bottom);
            v.x = (x + share * self.right[cell]).clamp(0.0, right);
        }
    }
}

impl Sketch {
    /// The same drawing with lines that wander by `amount` cells (root mean square), between their vertices and at them. Heights
    /// go with the lines. Lines off the map stay as they are.
    ///
    /// # Errors
    /// When `amount` is negative, above 16 or not a number.
    pub fn wandering(&self, amount: f64, seed: Seed) -> Result<Self> {
        if !(0.0..=MOST).contains(&amount) {
            return Err(Error::value("cells that lines wander", amount, format!("allowed: 0 to {MOST}")));
        }
        let mut sketch = self.clone();
        if amount == 0.0 {
            return Ok(sketch);
        }
        let on_map = |s: &super::Stroke| {
            let (bottom, right) = ((self.rows - 1) as f64, (self.cols - 1) as f64);
            s.vertices.iter().all(|v| (0.0..=bottom).contains(&v.y) && (0.0..=right).contains(&v.x))
        };
        let (mut moved, off): (Vec<_>, Vec<_>) = sketch.strokes.into_iter().partition(on_map);
        for stroke in &mut moved {
            let mut fine = vec![stroke.vertices[0]];
            for pair in stroke.vertices.windows(2) {
                let [from, to] = [pair[0], pair[1]];
                let pieces = ((to.x - from.x).hypot(to.y - from.y) / PIECE).ceil().max(1.0) as usize;
                fine.extend((1..=pieces).map(|i| {
                    let t = i as f64 / pieces as f64;
                    let between = |a: f64, b: f64| if i == pieces { b } else { a + t * (b - a) };
                    super::Vertex {
                        x: between(from.x, to.x),
                        y: between(from.y, to.y),
                        z: between(from.z, to.z),
                    }
                }));
            }
            stroke.vertices = fine;
        }
        sketch = Self { rows: self.rows, cols: self.cols, strokes: moved };
        for (i, (sigma, share)) in FIELDS.into_iter().enumerate() {
            let seed = seed.derive_indexed("wandering lines", i);
            let field = Displacement::new((self.rows, self.cols), sigma, amount * share.sqrt(), seed);
            field.apply(&mut sketch, TAPER);
        }
        sketch.strokes.extend(off);
        Ok(sketch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::{Stroke, StrokeKind, Vertex};

    fn vertex(x: f64, y: f64, z: f64) -> Vertex {
        Vertex { x, y, z }
    }

    /// A river from frame to frame with a tributary, and a ring.
    fn drawing() -> Sketch {
        let stroke = |vertices| Stroke { kind: StrokeKind::Valley, vertices };
        let ring = (0..=24).map(|k| {
            let turn = std::f64::consts::TAU * f64::from(k % 24) / 24.0;
            vertex(90.0 + 20.0 * turn.cos(), 40.0 + 20.0 * turn.sin(), 7.0)
        });
        let strokes = vec![
            stroke(vec![vertex(0.0, 100.0, 9.0), vertex(60.0, 100.0, 5.0), vertex(127.0, 100.0, 1.0)]),
            stroke(vec![vertex(60.0, 20.0, 8.0), vertex(60.0, 100.0, 5.0)]),
            stroke(ring.collect()),
        ];
        Sketch::new(120, 128, strokes).unwrap()
    }

    #[test]
    fn lines_wander_and_stay_joined() {
        let drawn = drawing();
        let moved = drawn.wandering(2.0, Seed(3)).unwrap();
        assert_eq!(moved, drawn.wandering(2.0, Seed(3)).unwrap());
        assert_ne!(moved, drawn.wandering(2.0, Seed(4)).unwrap());
        assert_eq!(drawn.wandering(0.0, Seed(3)).unwrap(), drawn);
        let [river, side, ring] = &moved.strokes[..] else { panic!("three lines") };
        // Ends at the frame stay there; the confluence is one place; the ring is closed.
        assert_eq!((river.vertices[0].x, river.vertices[0].y), (0.0, 100.0));
        assert_eq!(river.vertices.last().map(|v| v.x), Some(127.0));
        let mouth = side.vertices.last().unwrap();
        assert!(river.vertices.contains(mouth), "{mouth:?}");
        assert_eq!(ring.vertices[0], *ring.vertices.last().unwrap());
        // Not straight, not round, and not far.
        let off: Vec<f64> = river.vertices.iter().map(|v| v.y - 100.0).collect();
        let radii: Vec<f64> = ring.vertices.iter().map(|v| (v.x - 90.0).hypot(v.y - 40.0) - 20.0).collect();
        for off in [off, radii] {
            let square = off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64;
            assert!((0.3..36.0).contains(&square), "{square}");
        }
        // Heights fall along the river as they did.
        assert!(river.vertices.windows(2).all(|pair| pair[0].z >= pair[1].z));
    }

    #[test]
    fn amounts_are_checked_and_strangers_left_alone() {
        let mut drawn = drawing();
        for bad in [-1.0, 17.0, f64::NAN] {
            assert!(drawn.wandering(bad, Seed(1)).unwrap_err().to_string().contains("0 to 16"));
        }
        drawn.strokes.truncate(1);
        drawn.strokes[0].vertices[0].x = -5.0;
        assert_eq!(drawn.wandering(1.0, Seed(1)).unwrap(), drawn);
    }
}
