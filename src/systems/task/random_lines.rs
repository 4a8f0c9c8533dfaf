//! Random lines around a drawing that are as steep as a style.

use crate::error::Result;
use crate::extract::random::{RandomSketchConfig, enhance, enhance_around};
use crate::interpolation::harmonic;
use crate::seed::Seed;
use crate::sketch::Sketch;
use serde::{Deserialize, Serialize};

/// The most that a random line is above or below the surface, in mean distances of nodes times the slope of the style. Chosen so that
/// 10 to 160 nodes give the slopes of moon, alps and grand-canyon (`experiments/full/random.toml`).
const RISE: f64 = 0.6;

/// Where random lines lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RandomHeights {
    /// Ridges a little above the surface through the drawn strokes, valleys a little below, as steep as the style.
    #[default]
    Style,
    /// Ridges anywhere in the upper half of the range, valleys in the lower (Liu & Benes 2025, 5.2).
    Range,
}

/// What random lines are measured by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground {
    /// Lowest and highest height, in the unit of the sketch.
    pub(crate) range: (f64, f64),
    /// Mean slope of the style's exemplar, in the unit of the sketch a cell; unknown in styles of older versions.
    pub(crate) slope: Option<f64>,
}

/// The sketch with `nodes` nodes of random ridges and valleys. Where nothing is drawn or the slope is not known, heights come
/// from the range whatever is asked.
///
/// # Errors
/// As [`enhance`].
pub(crate) fn with_random_lines(
    sketch: &Sketch,
    nodes: usize,
    heights: RandomHeights,
    ground: Ground,
    seed: Seed,
) -> Result<Sketch> {
    let config = RandomSketchConfig { nodes, height_range: Some(ground.range), ..Default::default() };
    let slope = ground.slope.filter(|_| heights == RandomHeights::Style && !sketch.strokes.is_empty());
    let Some(slope) = slope else { return enhance(sketch, &config, seed) };
    let drawn = sketch.rasterize();
    let surface = harmonic(&drawn.mask(), &drawn.heights().map(|z| f64::from(*z)))?;
    let spacing = ((sketch.rows * sketch.cols) as f64 / nodes.max(1) as f64).sqrt();
    enhance_around(sketch, &config, &surface, RISE * slope * spacing, seed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::samples;

    #[test]
    fn random_lines_are_as_steep_as_asked() {
        let sketch = samples::load("lambda-ring").unwrap().sketch;
        let ground = |slope| Ground { range: (0.0, 1.0), slope };
        let make = |heights, slope| with_random_lines(&sketch, 40, heights, ground(slope), Seed(1)).unwrap();
        let paper = make(RandomHeights::Range, Some(0.01));
        assert_eq!(make(RandomHeights::Style, None), paper);
        // Mean step from one end of a random line to the other.
        let step = |sketch: &Sketch| {
            let steps: Vec<f64> = sketch
                .strokes
                .iter()
                .filter(|s| s.vertices.len() == 2)
                .map(|s| (s.vertices[0].z - s.vertices[1].z).abs())
                .collect();
            steps.iter().sum::<f64>() / steps.len() as f64
        };
        let [gentle, steep] = [0.01, 0.03].map(|slope| step(&make(RandomHeights::Style, Some(slope))));
        assert!(gentle < steep && steep < step(&paper), "{gentle} {steep} {}", step(&paper));
        let empty = Sketch::new(64, 64, Vec::new()).unwrap();
        assert!(with_random_lines(&empty, 9, RandomHeights::Style, ground(Some(0.01)), Seed(1)).is_ok());
    }
}
