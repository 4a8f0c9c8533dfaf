//! Coarse to fine: at every scale each patch of the map becomes the exemplar's most fitting one.

use super::clusters::Clusters;
use super::patches::{Layers, SIDE, Units, Waves, as_keys, turned};
use super::search::least;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::grid::resample::resample;
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::systems::task::combined;
use rand::RngExt;

/// Ratio of the sides of two scales (3/4; the paper's code).
const FACTOR: f64 = 0.75;
/// Symmetries of the square.
const TURNS: usize = 8;
/// How free queries are (Granot et al. 2022, Eq. 2, alpha), in medians of the distance from a key to its nearest query.
const FREEDOM: f32 = 0.5;
/// Standard deviation of the votes' weights around a patch's centre, cells.
const CENTRE: f32 = 1.5;
/// A copied patch is at most so much stronger or weaker than in the exemplar.
const MOST_STRETCH: f32 = 2.5;
/// Queries that say which keys are wanted.
const ASKED: usize = 512;
/// Queries that are searched at once: bounded memory for maps of any size.
const BAND: usize = 1 << 16;
/// Side of the exemplar's tiles that a draw leaves out or not, cells of a scale.
const TILE: usize = 16;
/// Cells of the largest map.
const MOST_CELLS: usize = 1 << 25;

/// The exemplar twice: as a coarse map shows it, and as it is.
pub(super) struct Pair {
    pub(super) smooth: Grid<f32>,
    pub(super) truth: Grid<f32>,
    /// 1 on the ridges that the smooth map was made from, -1 in valleys.
    pub(super) marks: Option<Grid<f32>>,
}

/// The map to which detail is added.
pub(super) struct Query<'a> {
    pub(super) heights: &'a Grid<f32>,
    pub(super) marks: Option<&'a Grid<f32>>,
    /// Forms smaller than this are searched, cells.
    pub(super) size: f64,
    pub(super) match_relief: bool,
    /// Share of the exemplar's tiles that is left out.
    pub(super) left_out: f64,
}

/// (rows, columns) at `scale` of a map that has `shape` at scale 0: times 3/4 to the power of the scale.
pub(super) fn shape_at((rows, cols): (usize, usize), scale: usize) -> (usize, usize) {
    let side = |s: usize| ((s as f64 * FACTOR.powi(scale as i32)).round() as usize).max(SIDE);
    (side(rows), side(cols))
}

/// `map` at `scale`.
pub(super) fn at(map: &Grid<f32>, scale: usize) -> Grid<f32> {
    let (rows, cols) = shape_at(map.shape(), scale);
    resample(map, rows, cols)
}

/// Whether a map is small enough to be searched for.
///
/// # Errors
/// When it has more than 2^25 cells.
pub(super) fn check_cells((rows, cols): (usize, usize)) -> Result<()> {
    let cells = rows.saturating_mul(cols);
    if cells <= MOST_CELLS {
        return Ok(());
    }
    let allowed = format!("detail from patches searches at most {MOST_CELLS} cells");
    Err(Error::value("cells of the map", cells, allowed))
}

/// The coarsest scale whose cells are not larger than `size` and at which the smaller of both maps has room for two patches.
pub(super) fn first_scale(size: f64, shortest: usize) -> usize {
    let fits =
        |scale: i32| FACTOR.powi(-scale) <= size && shortest as f64 * FACTOR.powi(scale) >= (2 * SIDE) as f64;
    (1..64).take_while(|scale| fits(*scale)).last().unwrap_or(0) as usize
}

/// Relief is matched where what the smooth map misses is at most so many times as steep as it is (windows of nine areas: .5 to 1.3;
/// one with a dozen line cells in all: 77).
const MOST_MISSING: f32 = 4.0;

/// What the exemplar has beyond its smooth map where it looks like `asked`. (rows, columns) of the map, in its unit; none for
/// level or tiny maps.
///
/// # Errors
/// When the map is too large to be searched, or the work is stopped.
pub(super) fn residual(asked: &Query<'_>, pair: &Pair, seed: Seed, stop: &Stop) -> Result<Option<Grid<f32>>> {
    let shortest = [asked.heights.rows(), asked.heights.cols(), pair.truth.rows(), pair.truth.cols()];
    let shortest = shortest.into_iter().min().unwrap_or(0);
    if shortest < 2 * SIDE {
        return Ok(None);
    }
    check_cells(asked.heights.shape())?;
    let start = first_scale(asked.size, shortest);
    let slope = |map: &Grid<f32>| mean_square_slope(&at(map, start)).sqrt() as f32;
    let (own, exemplar) = (slope(asked.heights), slope(&pair.smooth));
    // Query of the map as it is: shrinking leaves rounding where there is no slope.
    if mean_square_slope(asked.heights) <= 0.0 || own <= 0.0 || exemplar <= 0.0 {
        return Ok(None);
    }
    // A smooth map made from hardly any line is nearly level: it says nothing of how detail grows with relief.
    let missing = slope(&combined(&pair.truth, 1.0, &pair.smooth, -1.0));
    let has_relief = missing <= MOST_MISSING * exemplar;
    let ratio = if asked.match_relief && has_relief { (exemplar / own).clamp(1e-3, 1e3) } else { 1.0 };
    let waves = Waves::new();
    let mut found: Option<Grid<f32>> = None;
    for scale in (0..=start).rev() {
        let seed = seed.derive_indexed("patches of scale", scale);
        let ground = at(asked.heights, scale).map(|z| z * ratio);
        let (rows, cols) = ground.shape();
        let map = Layers {
            ground,
            residual: found.as_ref().map(|found| resample(found, rows, cols)),
            marks: asked.marks.filter(|_| pair.marks.is_some()).map(|marks| at(marks, scale)),
        };
        let exemplars = Exemplars::new(pair, scale, scale < start, map.marks.is_some());
        let kept = kept(&exemplars, asked.left_out, seed);
        found = Some(voted(&map, &exemplars, &kept, &waves, exemplar, stop)?);
    }
    Ok(found.map(|found| found.map(|v| v / ratio)))
}

/// The exemplar at one scale in its eight symmetries.
pub(super) struct Exemplars {
    layers: Vec<Layers>,
    /// What a patch of the layers stands for.
    values: Vec<Grid<f32>>,
}

impl Exemplars {
    /// Patches of the smooth map stand for what it misses.
    fn new(pair: &Pair, scale: usize, with_residual: bool, with_marks: bool) -> Self {
        let missing = |scale| combined(&at(&pair.truth, scale), 1.0, &at(&pair.smooth, scale), -1.0);
        let (ground, value) = (at(&pair.smooth, scale), missing(scale));
        let (rows, cols) = ground.shape();
        let before = with_residual.then(|| resample(&missing(scale + 1), rows, cols));
        let marks = pair.marks.as_ref().filter(|_| with_marks).map(|marks| at(marks, scale));
        Self::of(&Layers { ground, residual: before, marks }, &value)
    }

    /// Patches of `layers` stand for those of `value`.
    pub(super) fn of(layers: &Layers, value: &Grid<f32>) -> Self {
        let all = (0..TURNS).map(|turn| layers.turned(turn)).collect();
        Self { layers: all, values: (0..TURNS).map(|turn| turned(value, turn)).collect() }
    }
}

/// The places of every symmetry that take part in a draw: whole tiles, so that neighbouring patches stay together.
pub(super) fn kept(exemplars: &Exemplars, left_out: f64, seed: Seed) -> Vec<Vec<(usize, usize)>> {
    let mut stream = seed.stream("tiles");
    let mut choose = |left_out: f64| -> Vec<Vec<(usize, usize)>> {
        let places = exemplars.layers.iter().map(|layers| {
            let (rows, cols) = layers.places();
            let across = cols.div_ceil(TILE);
            let tiles: Vec<bool> =
                (0..rows.div_ceil(TILE) * across).map(|_| stream.random::<f64>() >= left_out).collect();
            let all = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
            all.filter(|(row, col)| tiles[row / TILE * across + col / TILE]).collect()
        });
        places.collect()
    };
    let kept = choose(left_out);
    if kept.iter().all(Vec::is_empty) { choose(0.0) } else { kept }
}

/// The map made of the exemplar's best patches; overlapping ones vote, those near their centre more.
///
/// # Errors
/// When the work is stopped.
pub(super) fn voted(
    map: &Layers,
    exemplars: &Exemplars,
    kept: &[Vec<(usize, usize)>],
    waves: &Waves,
    slope: f32,
    stop: &Stop,
) -> Result<Grid<f32>> {
    let value = &exemplars.values[0];
    let power: f64 = value.as_slice().iter().map(|v| f64::from(*v).powi(2)).sum();
    let units = Units {
        slope,
        residual: (power / value.len() as f64).sqrt() as f32,
        contrast: exemplars.layers[0].mean_contrast(waves, slope),
    };
    let mut keys = super::search::Table { depth: 0, values: Vec::new() };
    let (mut contrasts, mut places) = (Vec::new(), Vec::new());
    for (turn, (layers, kept)) in exemplars.layers.iter().zip(kept).enumerate() {
        let (table, contrast) = layers.table(waves, units, kept);
        keys.depth = table.depth;
        keys.values.extend(table.values);
        contrasts.extend(contrast);
        places.extend(kept.iter().map(|&(row, col)| (turn, row, col)));
    }
    let (rows, cols) = map.places();
    // Eq. 2: keys that no query resembles are wanted more.
    let step = ((rows * cols) as f64 / ASKED as f64).sqrt().ceil().max(1.0) as usize;
    let few: Vec<(usize, usize)> =
        (0..rows).step_by(step).flat_map(|row| (0..cols).step_by(step).map(move |col| (row, col))).collect();
    let few = map.table(waves, units, &few).0;
    let nearest = least(&keys, &as_keys(&few, &vec![1.0; few.rows()]), stop);
    let distances: Vec<f32> = nearest.iter().map(|(distance, _)| distance.max(0.0)).collect();
    let mut sorted = distances.clone();
    sorted.sort_by(f32::total_cmp);
    let median = sorted[sorted.len() / 2].max(1e-6);
    let weights: Vec<f32> = distances.iter().map(|d| median / (FREEDOM * median + d)).collect();
    stop.check()?;
    let clusters = Clusters::new(&keys, &weights, stop);

    let mut votes = Votes::new(map.ground.shape());
    for band in (0..rows).step_by((BAND / cols).max(1)) {
        stop.check()?;
        let end = rows.min(band + (BAND / cols).max(1));
        let asked: Vec<(usize, usize)> =
            (band..end).flat_map(|row| (0..cols).map(move |col| (row, col))).collect();
        let (queries, own) = map.table(waves, units, &asked);
        for ((place, own), (_, key)) in asked.iter().zip(own).zip(clusters.least(&queries, stop)) {
            let key = key as usize;
            let stretch = (own / contrasts[key]).clamp(MOST_STRETCH.recip(), MOST_STRETCH);
            let (turn, row, col) = places[key];
            votes.add(*place, &exemplars.values[turn], (row, col), stretch);
        }
    }
    Ok(votes.mean())
}

/// Sums of weighted values and of weights.
struct Votes {
    sum: Grid<f32>,
    weight: Grid<f32>,
    bell: [f32; SIDE],
}

impl Votes {
    fn new((rows, cols): (usize, usize)) -> Self {
        let middle = (SIDE / 2) as f32;
        let bell = std::array::from_fn(|i| (-0.5 * ((i as f32 - middle) / CENTRE).powi(2)).exp());
        Self { sum: Grid::filled(rows, cols, 0.0), weight: Grid::filled(rows, cols, 0.0), bell }
    }

    /// The patch of `values` at `from` votes `stretch` times for the patch at `to`.
    fn add(&mut self, to: (usize, usize), values: &Grid<f32>, from: (usize, usize), stretch: f32) {
        let (cols, from_cols) = (self.sum.cols(), values.cols());
        for i in 0..SIDE {
            let to = (to.0 + i) * cols + to.1;
            let from = (from.0 + i) * from_cols + from.1;
            for j in 0..SIDE {
                let weight = self.bell[i] * self.bell[j];
                self.sum.as_mut_slice()[to + j] += weight * stretch * values.as_slice()[from + j];
                self.weight.as_mut_slice()[to + j] += weight;
            }
        }
    }

    fn mean(self) -> Grid<f32> {
        let mut mean = self.sum;
        for (z, weight) in mean.as_mut_slice().iter_mut().zip(self.weight.as_slice()) {
            *z /= weight;
        }
        mean
    }
}
