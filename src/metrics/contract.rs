//! What a drawing asked for and what the terrain does.
//!
//! Terrain and lines -> [`Contract`]. Heights at the lines, each kind of line found again where water gathers (or, for ridges, where
//! it would on the terrain upside down), the flow that drawn valleys carry, pits, and large rivers and ridges that nobody asked
//! for. Where strokes are given one by one, each is judged alone. n log n for routing.

use super::lines::{check_lines, share_near};
use super::{check_one, stroke_height_error};
use crate::error::Result;
use crate::flow::{Accumulation, FlowDirections, Surface, accumulate, ponded_share, route, strahler};
use crate::grid::{Cell, Grid, Mask, d8, distance};
use crate::sketch::{Sketch, StrokeKind};
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;

/// Cells that drain through a cell of a line that is found again.
const CHANNEL: u32 = 60;
/// Cells between a line and where it is found.
const TOLERANCE: f64 = 3.0;
/// Lines of at least this Strahler order are large.
const LARGE_ORDER: u8 = 4;
/// Cells from a stroke beyond which nobody asked for a large line.
const ASKED: f64 = 8.0;
/// What was asked and what came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Contract {
    /// Root mean square height error at the lines, in the unit of the heights; none without lines on valid ground.
    pub(crate) height_error: Option<f64>,
    /// Greatest height error at a line cell.
    pub(crate) largest_height_error: f64,
    /// Every stroke, in the order of the sketch.
    pub(crate) strokes: Vec<StrokeCheck>,
    /// Share of the cells in ponds ([`ponded_share`]).
    pub(crate) pits: f64,
    /// The same of the terrain that the style was learned from; none where that is not known.
    #[serde(default)]
    pub(crate) style_pits: Option<f64>,
    /// Cells of rivers of order 4 and more that no drawn valley is near, as a share of all such cells; none without any.
    pub(crate) unasked_rivers: Option<f64>,
    /// The same of ridges.
    pub(crate) unasked_ridges: Option<f64>,
}

/// One stroke and what became of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StrokeCheck {
    /// Ridge or valley.
    pub(crate) kind: StrokeKind,
    /// Cells on valid ground.
    pub(crate) cells: usize,
    /// Share of the cells with a ridge or valley of the terrain within 3 cells.
    pub(crate) found: f64,
    /// Valleys: share of the cells with the main stem within 3 cells: the one river that is greatest along the stroke, followed
    /// upstream for as long as it stays there. None for ridges.
    pub(crate) carries: Option<f64>,
}

/// What a user will not accept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ContractBounds {
    /// Largest root mean square height error.
    pub(crate) height_error: Option<f64>,
    /// Least share of every stroke that is found again.
    pub(crate) found: Option<f64>,
    /// Least share of every valley that carries its river.
    pub(crate) carries: Option<f64>,
    /// Largest share of cells in pits.
    pub(crate) pits: Option<f64>,
    /// Largest share of large rivers and of large ridges that nobody asked for.
    pub(crate) unasked: Option<f64>,
}

impl Contract {
    /// Holds `terrain` against `sketch`; both in one unit.
    ///
    /// # Errors
    /// When the shapes differ, a valid height is not finite, or nothing is valid.
    pub(crate) fn of(terrain: &Grid<f32>, valid: &Mask, sketch: &Sketch) -> Result<Self> {
        check_one("terrain", terrain, valid)?;
        sketch.validate()?;
        let lines = sketch.rasterize();
        check_lines("sketch", &lines, terrain.shape())?;
        let surface = Surface::new(terrain.clone(), valid.clone())?;
        let (rivers, ridges) = (Network::of(&surface), Network::of(&surface.inverted()));
        let strokes = sketch.strokes.iter().map(|stroke| {
            let alone = Sketch { rows: sketch.rows, cols: sketch.cols, strokes: vec![stroke.clone()] };
            let alone = alone.rasterize();
            let cells =
                Mask::from_fn(terrain.rows(), terrain.cols(), |c| valid[c] && alone.kinds()[c].is_some());
            let network = if stroke.kind == StrokeKind::Valley { &rivers } else { &ridges };
            StrokeCheck {
                kind: stroke.kind,
                cells: cells.as_slice().iter().filter(|c| **c).count(),
                found: share_near(&cells, &network.channels, TOLERANCE),
                carries: (stroke.kind == StrokeKind::Valley).then(|| rivers.carried(&cells)),
            }
        });
        let strokes = strokes.collect();
        let errors = lines.kinds().cells().filter(|(c, kind)| kind.is_some() && valid[*c]);
        let errors = errors.map(|(c, _)| (f64::from(terrain[c]) - f64::from(lines.heights()[c])).abs());
        Ok(Self {
            height_error: stroke_height_error(terrain, valid, &lines)?,
            largest_height_error: errors.fold(0.0, f64::max),
            strokes,
            pits: ponded_share(&surface),
            style_pits: None,
            unasked_rivers: rivers.unasked(&lines.mask_of(StrokeKind::Valley)),
            unasked_ridges: ridges.unasked(&lines.mask_of(StrokeKind::Ridge)),
        })
    }

    /// The bounds that are broken, in whole sentences.
    #[must_use]
    pub(crate) fn broken(&self, bounds: &ContractBounds) -> Vec<String> {
        let mut broken = Vec::new();
        let mut most = |what: String, value: Option<f64>, bound: Option<f64>| {
            if let (Some(value), Some(bound)) = (value, bound)
                && value > bound
            {
                broken.push(format!("{what} is {value:.4}, allowed: at most {bound}."));
            }
        };
        most("Height error at the lines".into(), self.height_error, bounds.height_error);
        most("The share of cells in pits".into(), Some(self.pits), bounds.pits);
        most("The share of large rivers that nobody asked for".into(), self.unasked_rivers, bounds.unasked);
        most("The share of large ridges that nobody asked for".into(), self.unasked_ridges, bounds.unasked);
        for (i, stroke) in self.strokes.iter().enumerate().filter(|(_, stroke)| stroke.cells > 0) {
            let mut least = |what: &str, value: Option<f64>, bound: Option<f64>| {
                if let (Some(value), Some(bound)) = (value, bound)
                    && value < bound
                {
                    broken.push(format!(
                        "Stroke {} {what} on {value:.4} of its length, allowed: at least {bound}.",
                        i + 1
                    ));
                }
            };
            least("is found again", Some(stroke.found), bounds.found);
            least("carries its river", stroke.carries, bounds.carries);
        }
        broken
    }

    /// The findings as lines of text.
    #[must_use]
    pub(crate) fn table(&self) -> String {
        let share = |value: Option<f64>| value.map_or_else(|| "-".into(), |v| format!("{:.1} %", 100.0 * v));
        let mut text =
            format!("{:>7} {:7} {:>6} {:>8} {:>8}\n", "stroke", "kind", "cells", "found", "carries");
        for (i, s) in self.strokes.iter().enumerate() {
            let kind = if s.kind == StrokeKind::Ridge { "ridge" } else { "valley" };
            let (found, carries) = (share(Some(s.found)), share(s.carries));
            text += &format!("{:>7} {kind:7} {:>6} {found:>8} {carries:>8}\n", i + 1, s.cells);
        }
        let height = |value: Option<f64>| value.map_or_else(|| "-".into(), |v| format!("{v:.3}"));
        text += &format!(
            "height error at the lines  {} (largest {:.3})\n",
            height(self.height_error),
            self.largest_height_error
        );
        let of_style = self.style_pits.map(|pits| format!(" (of the style {})", share(Some(pits))));
        text += &format!(
            "cells in pits              {}{}\n",
            share(Some(self.pits)),
            of_style.unwrap_or_default()
        );
        text += &format!("large rivers not asked for {}\n", share(self.unasked_rivers));
        text + &format!("large ridges not asked for {}\n", share(self.unasked_ridges))
    }
}

/// Where water gathers.
struct Network {
    directions: FlowDirections,
    counts: Accumulation,
    channels: Mask,
    large: Mask,
}

impl Network {
    fn of(surface: &Surface) -> Self {
        let directions = route(surface);
        let counts = accumulate(&directions);
        let channels = counts.channels(CHANNEL);
        let large = strahler(&directions, &channels).orders().map(|&order| order >= LARGE_ORDER);
        Self { directions, counts, channels, large }
    }

    /// Share of the stroke's cells within reach of its main stem.
    fn carried(&self, stroke: &Mask) -> f64 {
        let (rows, cols) = stroke.shape();
        let reach = distance::squared(stroke).map(|&d| f64::from(d) <= TOLERANCE * TOLERANCE);
        let counts = self.counts.counts();
        let greatest = |cells: &mut dyn Iterator<Item = Cell>| {
            cells.filter(|c| reach[*c]).max_by_key(|c| (counts[*c], Reverse((c.row, c.col))))
        };
        let mut stem = Mask::filled(rows, cols, false);
        let mut next = greatest(&mut reach.cells().map(|(c, _)| c));
        while let Some(here) = next {
            stem[here] = true;
            let donors = (0..8).filter_map(|code| d8::neighbour(here, code, rows, cols));
            next = greatest(&mut donors.filter(|d| self.directions.receiver(*d) == Some(here)));
        }
        share_near(stroke, &stem, TOLERANCE)
    }

    fn unasked(&self, asked: &Mask) -> Option<f64> {
        let any = self.large.as_slice().contains(&true);
        any.then(|| 1.0 - share_near(&self.large, asked, ASKED))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::{Stroke, Vertex};

    /// A valley along column 30 that falls to the south, between slopes.
    fn trough() -> Grid<f32> {
        Grid::from_fn(90, 61, |c| 4.0 * c.col.abs_diff(30) as f32 + 0.5 * (90 - c.row) as f32)
    }

    fn stroke(kind: StrokeKind, points: &[(f64, f64, f64)]) -> Stroke {
        Stroke { kind, vertices: points.iter().map(|&(y, x, z)| Vertex { x, y, z }).collect() }
    }

    fn sketch(strokes: Vec<Stroke>) -> Sketch {
        Sketch::new(90, 61, strokes).unwrap()
    }

    fn checked(terrain: &Grid<f32>, sketch: &Sketch) -> Contract {
        Contract::of(terrain, &terrain.map(|_| true), sketch).unwrap()
    }

    #[test]
    fn a_valley_is_found_and_carries_its_river() {
        let axis = sketch(vec![stroke(StrokeKind::Valley, &[(80.0, 30.0, 5.0), (10.0, 30.0, 40.0)])]);
        let found = checked(&trough(), &axis);
        assert!(found.height_error.unwrap() < 1e-4 && found.largest_height_error < 1e-4);
        assert_eq!(found.strokes[0].cells, 71);
        assert!(found.strokes[0].found > 0.99 && found.strokes[0].carries.unwrap() > 0.99);
        assert!(found.pits < 1e-9 && found.broken(&ContractBounds::default()).is_empty());
    }

    #[test]
    fn one_that_is_not_there_is_neither_and_bounds_say_so() {
        let beside = sketch(vec![
            stroke(StrokeKind::Valley, &[(80.0, 44.0, 5.0), (10.0, 44.0, 40.0)]),
            stroke(StrokeKind::Ridge, &[(80.0, 20.0, 45.0), (10.0, 20.0, 80.0)]),
        ]);
        let found = checked(&trough(), &beside);
        assert!(found.strokes[0].found < 0.1 && found.strokes[1].found < 0.1);
        assert_eq!(found.strokes[1].carries, None);
        let bounds = ContractBounds {
            height_error: Some(1.0),
            found: Some(0.9),
            carries: Some(0.9),
            ..Default::default()
        };
        let broken = found.broken(&bounds);
        assert_eq!(broken.len(), 4, "{broken:?}");
        assert!(broken.iter().any(|b| b.contains("Stroke 2 is found again")), "{broken:?}");
        assert!(found.table().contains("ridge"));
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<Contract>(&text).unwrap(), found);
    }

    #[test]
    fn a_dam_ends_the_river_and_makes_a_pond() {
        let axis = sketch(vec![stroke(StrokeKind::Valley, &[(80.0, 30.0, 5.0), (10.0, 30.0, 40.0)])]);
        let dammed = Grid::from_fn(90, 61, |c| trough()[c] + if c.row == 45 { 60.0 } else { 0.0 });
        let found = checked(&dammed, &axis);
        assert!(found.pits > 0.03, "{}", found.pits);
        assert!(found.broken(&ContractBounds { pits: Some(0.01), ..Default::default() })[0].contains("pits"));
        // Two valleys side by side, the drawn one crossing from one to the other.
        let twin = Grid::from_fn(90, 61, |c| {
            4.0 * c.col.abs_diff(15).min(c.col.abs_diff(45)) as f32 + 0.5 * (90 - c.row) as f32
        });
        let crossing = sketch(vec![stroke(
            StrokeKind::Valley,
            &[(80.0, 15.0, 5.0), (50.0, 15.0, 20.0), (44.0, 45.0, 23.0), (10.0, 45.0, 40.0)],
        )]);
        let carries = checked(&twin, &crossing).strokes[0].carries.unwrap();
        assert!(carries < 0.6, "{carries}");
    }

    #[test]
    fn large_rivers_without_a_stroke_are_not_asked_for() {
        let rough = Grid::from_fn(128, 128, |c| {
            ((c.row * 37 + c.col * 61 + c.row * c.col * 7) % 101) as f32 + 0.4 * (c.row + c.col) as f32
        });
        let nothing = Sketch::new(128, 128, Vec::new()).unwrap();
        let found = checked(&rough, &nothing);
        assert_eq!(found.unasked_rivers, Some(1.0));
        assert_eq!(found.height_error, None);
        let bounds = ContractBounds { unasked: Some(0.5), ..Default::default() };
        assert!(!found.broken(&bounds).is_empty());
    }
}
