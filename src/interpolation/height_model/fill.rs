//! The open heights of a sketch, as the least-squares solution of what a [`HeightModel`] says of them.
//!
//! Sketch and which of its heights are given -> the same strokes with all heights, given ones to the bit; segments with an
//! open end get the points between as vertices of their own. After the solution valleys are made to fall and ridges to stand
//! above the valleys beside them, where nothing given stands against it.

use super::equations::Equations;
use super::network::{Network, Point};
use super::{Density, HeightModel};
use crate::error::{Error, Result};
use crate::sketch::{Sketch, Stroke, StrokeKind, Vertex};

/// Least drained area, cells: where slopes were measured.
const LEAST_AREA: f64 = 30.0;
/// Cells over which the scatter of slopes was measured.
const RUN: f64 = 10.0;
/// How much less sure a ridge's height above the nearest valley is than its scatter says: neighbours err together. Chosen
/// on three of the benchmark's areas; see [`HeightModel::fill`].
const RELIEF_DOUBT: f64 = 6.0;
/// Least scatter of that height, as a share.
const LEAST_SPREAD: f64 = 0.3;
/// Points that count as one opinion about where a kind lies in the range, with and without given heights.
const POINTS_AS_ONE: [f64; 2] = [100.0, 10.0];
/// Scatter of heights that must agree, as a share of the standard deviation of all.
const AGREES: f64 = 0.01;
/// Least slope of a valley, and least height of a ridge above the valley beside it, as a share of the expected one.
const LEAST_SHARE: f64 = 0.1;

/// A sketch with all its heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Filled {
    /// The sketch; strokes in the same order.
    pub sketch: Sketch,
    /// Strokes that had no height, and those that had some of them.
    pub(crate) without: usize,
    /// Strokes of which a part was open.
    pub(crate) partly: usize,
    /// Indices of strokes at one of whose ends the water was assumed to leave the map or end, as nothing given tells.
    pub(crate) assumed_outlets: Vec<usize>,
    /// Indices of valley strokes whose given heights rise downstream; they are kept.
    pub(crate) rising: Vec<usize>,
}

impl HeightModel {
    /// Gives heights to the vertices of `sketch` (metres) that have none: where `given` is false.
    ///
    /// Deterministic. The weights were chosen on the benchmark's areas alps, grand-canyon and sahara; figures for these and
    /// the others stand in `docs/papers/classical.md`.
    ///
    /// # Errors
    /// When `given` does not fit the sketch, or the sketch is not valid.
    pub fn fill(&self, sketch: &Sketch, given: &[Vec<bool>]) -> Result<Filled> {
        sketch.validate()?;
        let fits = given.len() == sketch.strokes.len()
            && given.iter().zip(&sketch.strokes).all(|(g, s)| g.len() == s.vertices.len());
        if !fits {
            return Err(Error::value(
                "given heights",
                "of another shape",
                "one for each vertex of each stroke",
            ));
        }
        let open = |g: &&Vec<bool>| g.iter().any(|given| !given);
        let without = given.iter().filter(|g| g.iter().all(|given| !given)).count();
        let partly = given.iter().filter(open).count() - without;
        if without + partly == 0 {
            let (assumed_outlets, rising) = (Vec::new(), Vec::new());
            return Ok(Filled { sketch: sketch.clone(), without, partly, assumed_outlets, rising });
        }
        let network = Network::of(sketch, given);
        let density = self.at_spacing(network.spacing);
        let mut heights = self.solve(&network, &density);
        self.let_valleys_fall(&network, &mut heights);
        close_rings(&network, &mut heights);
        raise_ridges(&network, &density, &mut heights);
        Ok(Filled {
            sketch: with_heights(sketch, given, &network.points, &heights),
            without,
            partly,
            rising: self.rising(&network),
            assumed_outlets: network.assumed_outlets,
        })
    }

    /// Slope of a valley that drains so many cells, metres a cell.
    pub(super) fn slope(&self, drained: f64) -> f64 {
        self.valley_slope * drained.max(LEAST_AREA).powf(-self.concavity)
    }

    fn solve(&self, network: &Network, density: &Density) -> Vec<f64> {
        let points = &network.points;
        let agree = AGREES * self.deviation;
        let mut equations = Equations::default();
        for (i, next) in network.downstream.iter().enumerate() {
            let Some((next, length)) = *next else { continue };
            let slope = self.slope(network.drained[i]);
            let scatter = (self.slope_spread * slope * (length * RUN).sqrt()).max(1e-3 * agree);
            equations.add(&[(i, 1.0), (next, -1.0)], slope * length, scatter);
        }
        for link in network.links.iter().filter(|link| points[link.a].kind == StrokeKind::Ridge) {
            let scatter = if link.joins { agree } else { self.ridge_step * link.length.sqrt() };
            equations.add(&[(link.a, 1.0), (link.b, -1.0)], 0.0, scatter.max(1e-3 * agree));
        }
        for &(ridge, valley) in &network.crossings {
            equations.add(&[(ridge, 1.0), (valley, -1.0)], 0.0, agree);
        }
        for &(ridge, valley, distance) in &network.beside {
            let above = above(density, distance);
            let scatter = density.spread.max(LEAST_SPREAD) * above * RELIEF_DOUBT;
            equations.add(&[(ridge, 1.0), (valley, -1.0)], above, scatter.max(1e-3 * agree));
        }
        let any = points.iter().any(|p| p.given.is_some());
        let as_one = POINTS_AS_ONE[usize::from(!any)];
        let start: Vec<f64> = points
            .iter()
            .enumerate()
            .map(|(i, point)| {
                let [mean, deviation] = place(density, point.kind);
                equations.add(&[(i, 1.0)], mean, (deviation * as_one.sqrt()).max(1e-3 * agree));
                point.given.unwrap_or(mean)
            })
            .collect();
        let fixed: Vec<bool> = points.iter().map(|p| p.given.is_some()).collect();
        equations.solve(&start, &fixed)
    }

    /// Raises open heights of valleys to a least slope above what lies downstream, as far as given heights upstream allow.
    fn let_valleys_fall(&self, network: &Network, heights: &mut [f64]) {
        let least = |i: usize, length: f64| LEAST_SHARE * self.slope(network.drained[i]) * length;
        let given = |i: usize| network.points[i].given.is_some();
        // What given heights upstream leave room for.
        let mut room = vec![f64::INFINITY; heights.len()];
        for &i in network.upwards.iter().rev() {
            if given(i) {
                room[i] = heights[i];
            }
            if let Some((next, length)) = network.downstream[i] {
                room[next] = room[next].min(room[i] - least(i, length));
            }
        }
        for &i in &network.upwards {
            if given(i) {
                continue;
            }
            let floor = network.downstream[i]
                .map_or(f64::NEG_INFINITY, |(next, length)| heights[next] + least(i, length));
            // Where given heights leave no room at all, water has to climb, as gently as the solution lets it.
            heights[i] = heights[i].clamp(floor.min(room[i]), floor.max(room[i]));
        }
    }

    /// Strokes with a given height below one that is given downstream.
    fn rising(&self, network: &Network) -> Vec<usize> {
        let mut below = vec![f64::NEG_INFINITY; network.points.len()];
        let mut rising = Vec::new();
        for &i in &network.upwards {
            let lowest = network.downstream[i].map_or(f64::NEG_INFINITY, |(next, _)| below[next]);
            let here = network.points[i].given;
            if here.is_some_and(|z| z < lowest) {
                rising.push(network.points[i].stroke);
            }
            below[i] = here.map_or(lowest, |z| z.max(lowest));
        }
        rising.sort_unstable();
        rising.dedup();
        rising
    }
}

/// Gives points that lie at one place one height: the given one, else the lower one.
fn close_rings(network: &Network, heights: &mut [f64]) {
    let given = |i: usize| network.points[i].given.is_some();
    for link in network.links.iter().filter(|link| link.joins && link.length == 0.0) {
        let (a, b) = (link.a, link.b);
        let height = match (given(a), given(b)) {
            (true, true) => continue,
            (true, false) => heights[a],
            (false, true) => heights[b],
            (false, false) => heights[a].min(heights[b]),
        };
        (heights[a], heights[b]) = (height, height);
    }
}

/// Expected height of a ridge above the nearest valley.
fn above(density: &Density, distance: f64) -> f64 {
    density.relief * distance.powf(density.exponent)
}

fn place(density: &Density, kind: StrokeKind) -> [f64; 2] {
    match kind {
        StrokeKind::Ridge => density.ridges,
        StrokeKind::Valley => density.valleys,
    }
}

/// Lets ridges and valleys agree where they cross, and open ridges stand above the valleys beside them.
fn raise_ridges(network: &Network, density: &Density, heights: &mut [f64]) {
    for &(ridge, valley, distance) in &network.beside {
        if network.points[ridge].given.is_none() {
            heights[ridge] = heights[ridge].max(heights[valley] + LEAST_SHARE * above(density, distance));
        }
    }
    for &(ridge, valley) in &network.crossings {
        if network.points[ridge].given.is_none() {
            heights[ridge] = heights[valley];
        } else if network.points[valley].given.is_none() {
            heights[valley] = heights[ridge];
        }
    }
}

/// The strokes with the heights of their points.
fn with_heights(sketch: &Sketch, given: &[Vec<bool>], points: &[Point], heights: &[f64]) -> Sketch {
    let mut filled = Sketch { strokes: Vec::with_capacity(sketch.strokes.len()), ..sketch.clone() };
    let mut of_stroke: Vec<Vec<usize>> = vec![Vec::new(); sketch.strokes.len()];
    for (i, point) in points.iter().enumerate() {
        of_stroke[point.stroke].push(i);
    }
    for ((stroke, given), of_stroke) in sketch.strokes.iter().zip(given).zip(&of_stroke) {
        let mut vertices = Vec::with_capacity(of_stroke.len());
        for &i in of_stroke {
            let p = &points[i];
            let ends = (p.share == 0.0).then_some(p.segment).or((p.share == 1.0).then_some(p.segment + 1));
            match ends {
                // A vertex, as it was drawn.
                Some(v) if given[v] => vertices.push(stroke.vertices[v]),
                Some(v) => vertices.push(Vertex { z: heights[i], ..stroke.vertices[v] }),
                // A segment between two given heights stays a straight line.
                None if p.given.is_some() => {}
                None => vertices.push(Vertex { x: p.x, y: p.y, z: heights[i] }),
            }
        }
        filled.strokes.push(Stroke { kind: stroke.kind, vertices });
    }
    filled
}
