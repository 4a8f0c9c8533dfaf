//! The layout: large patches of the exemplar at the coarsest size, placed one by one.
//!
//! Image quilting (Efros & Freeman 2001) with strokes: next comes the place where most is known, from strokes or from patches that
//! lie there; of many places of the exemplar one of the best is drawn. In the overlap a cell belongs to the patch whose centre
//! is nearer. The gradients of what is laid are all that is used of it, so that no cut has to be sought. Cost: patches x
//! candidates x cells of a patch; candidates in parallel, sixteen beside each other.

use super::config::QuiltingConfig;
use super::patch::{Asked, Weights};
use super::source::{Centres, Source, step, step_back};
use crate::control::Stop;
use crate::grid::{Cell, Grid};
use crate::seed::{Seed, Stream};
use pulp::Arch;
use rand::RngExt;
use rayon::prelude::*;

/// Candidates that lie side by side.
const LANES: usize = 16;
/// Runs of one task.
const CHUNK: usize = 32;
/// Known cells count against this much of nothing.
const UNKNOWN: f32 = 2.0;

/// The exemplar at the coarsest size.
pub(super) struct Ground<'a> {
    pub(super) heights: &'a Grid<f32>,
    /// For each self-sketch: membrane, landscape, ridges, valleys.
    pub(super) sets: Vec<[Option<&'a Grid<f32>>; 4]>,
    pub(super) centres: &'a Centres,
    pub(super) turns: &'a [u8],
}

/// The drawing at the coarsest size.
pub(super) struct Wanted<'a> {
    /// Heights of strokes, by cell.
    pub(super) strokes: &'a [(Cell, f32)],
    pub(super) maps: Asked<'a>,
}

/// The source of every cell. `weights` as for the search, but those of membrane and landscape count as they are: shares. Not whole when it is stopped.
pub(super) fn quilt(
    ground: &Ground<'_>,
    wanted: &Wanted<'_>,
    weights: &Weights,
    config: &QuiltingConfig,
    seed: Seed,
    stop: &Stop,
) -> Grid<Source> {
    let (rows, cols) = wanted.maps.heights.shape();
    let mut stream = seed.stream("quilting");
    let mut places = Places::new(rows, cols, config, &mut stream);
    let mut laid = Laid {
        heights: Grid::filled(rows, cols, 0.0),
        known: Grid::filled(rows, cols, 0.0),
        is_stroke: Grid::filled(rows, cols, false),
        nearest: Grid::filled(rows, cols, i32::MAX),
        sources: Grid::filled(rows, cols, Source::default()),
        used: Grid::filled(ground.heights.rows(), ground.heights.cols(), 0.0),
    };
    for &(cell, height) in wanted.strokes {
        laid.heights[cell] = height;
        laid.known[cell] = config.strokes;
        laid.is_stroke[cell] = true;
    }
    places.count(&laid.known, config.radius);
    while let Some(place) = places.next().filter(|_| !stop.is_raised()) {
        let found = Placing { ground, wanted, weights, config, laid: &laid, place }.choose(&mut stream);
        laid.lay(ground.heights, place, config.radius, found);
        places.update(&laid.known, place, config.radius);
    }
    laid.sources
}

/// Centres of the patches that are still to come.
struct Places {
    open: Vec<Cell>,
    /// Known weight around each, and a little chance.
    scores: Vec<f32>,
    chance: Vec<f32>,
}

impl Places {
    fn new(rows: usize, cols: usize, config: &QuiltingConfig, stream: &mut Stream) -> Self {
        let step = config.step;
        let mut shift = || stream.random_range(0..step);
        let (down, right) = (shift(), shift());
        let along = |shift: usize, side: usize| {
            // One before the frame to one behind it, moved onto it.
            let all = (0..).map(|k| (shift + k * step).saturating_sub(step));
            let mut along: Vec<usize> =
                all.take_while(|i| *i < side + step).map(|i| i.min(side - 1)).collect();
            along.dedup();
            along
        };
        let across = along(right, cols);
        let open: Vec<Cell> = along(down, rows)
            .into_iter()
            .flat_map(|row| across.iter().map(move |&col| Cell::new(row, col)))
            .collect();
        let chance = open.iter().map(|_| stream.random::<f32>()).collect();
        Self { scores: vec![0.0; open.len()], open, chance }
    }

    fn count(&mut self, known: &Grid<f32>, radius: usize) {
        for i in 0..self.open.len() {
            self.scores[i] = self.chance[i] + sum_around(known, self.open[i], radius);
        }
    }

    /// Counts anew what a patch at `place` may have changed.
    fn update(&mut self, known: &Grid<f32>, place: Cell, radius: usize) {
        for i in 0..self.open.len() {
            let there = self.open[i];
            if there.row.abs_diff(place.row) <= 2 * radius && there.col.abs_diff(place.col) <= 2 * radius {
                self.scores[i] = self.chance[i] + sum_around(known, there, radius);
            }
        }
    }

    fn next(&mut self) -> Option<Cell> {
        let best = (0..self.open.len()).reduce(|a, b| if self.scores[b] > self.scores[a] { b } else { a })?;
        self.scores.swap_remove(best);
        self.chance.swap_remove(best);
        Some(self.open.swap_remove(best))
    }
}

fn sum_around(map: &Grid<f32>, place: Cell, radius: usize) -> f32 {
    let (rows, cols) = map.shape();
    let range = |i: usize, side: usize| i.saturating_sub(radius)..(i + radius + 1).min(side);
    range(place.row, rows)
        .map(|row| map.as_slice()[row * cols..(row + 1) * cols][range(place.col, cols)].iter().sum::<f32>())
        .sum()
}

/// What has been laid so far.
struct Laid {
    /// Heights where something is known.
    heights: Grid<f32>,
    /// How much they count.
    known: Grid<f32>,
    is_stroke: Grid<bool>,
    /// Squared distance to the centre of the patch that a cell belongs to.
    nearest: Grid<i32>,
    sources: Grid<Source>,
    /// How often each cell of the exemplar lies under a patch.
    used: Grid<f32>,
}

impl Laid {
    /// Lays the patch around `found` at `place`, at the mean height of what is known there.
    fn lay(&mut self, heights: &Grid<f32>, place: Cell, radius: usize, found: Source) {
        let (rows, cols) = self.heights.shape();
        let (mut above, mut weight) = (0.0, 1e-9);
        let cells: Vec<(Cell, Cell, i32)> = pairs(place, found, radius, rows, cols).collect();
        for &(here, there, _) in &cells {
            above += self.known[here] * (self.heights[here] - heights[there]);
            weight += self.known[here];
        }
        above /= weight;
        for (here, there, distance) in cells {
            self.used[there] += 1.0;
            if distance < self.nearest[here] {
                self.nearest[here] = distance;
                self.sources[here] = Source::new(there.row, there.col, found.turn, found.set);
                if !self.is_stroke[here] {
                    self.heights[here] = heights[there] + above;
                }
                self.known[here] = self.known[here].max(1.0);
            }
        }
    }
}

/// (cell of the map, cell of the exemplar, squared distance to the centre) of a patch inside the map.
fn pairs(
    place: Cell,
    found: Source,
    radius: usize,
    rows: usize,
    cols: usize,
) -> impl Iterator<Item = (Cell, Cell, i32)> {
    let r = radius as i32;
    (-r..=r).flat_map(move |down| (-r..=r).map(move |right| (down, right))).filter_map(
        move |(down, right)| {
            let (row, col) = (place.row as i32 + down, place.col as i32 + right);
            let inside = row >= 0 && col >= 0 && row < rows as i32 && col < cols as i32;
            let there = found.moved(down, right);
            let distance = down * down + right * right;
            inside.then(|| {
                let cell = |row: i32, col: i32| Cell::new(row as usize, col as usize);
                (cell(row, col), cell(there.0, there.1), distance)
            })
        },
    )
}

/// One patch to be found.
struct Placing<'a> {
    ground: &'a Ground<'a>,
    wanted: &'a Wanted<'a>,
    weights: &'a Weights,
    config: &'a QuiltingConfig,
    laid: &'a Laid,
    place: Cell,
}

/// Neighbouring candidates in a row of the exemplar, from `col` on.
#[derive(Clone, Copy)]
struct Run {
    row: usize,
    col: usize,
    turn: u8,
    set: u8,
}

/// A cell of the patch as the candidates' cost reads it.
#[derive(Clone, Copy)]
struct Query {
    /// From the candidate's centre, in the exemplar.
    down: i32,
    right: i32,
    known: f32,
    height: f32,
    maps: [f32; 4],
}

/// The patch in one symmetry, and its own moments.
struct Queries {
    cells: Vec<Query>,
    known: f32,
    mean: f32,
    variance: f32,
    /// (mean, variance) of membrane and landscape.
    guides: [[f32; 2]; 2],
}

impl Placing<'_> {
    /// One of the candidates whose cost is within the tolerance of the least.
    fn choose(&self, stream: &mut Stream) -> Source {
        let runs = self.runs(stream);
        let queries: Vec<Queries> = (0..super::source::TURNS).map(|turn| self.queries(turn)).collect();
        let arch = Arch::new();
        let mut costs = vec![f32::INFINITY; runs.len() * LANES];
        costs.par_chunks_mut(CHUNK * LANES).zip(runs.par_chunks(CHUNK)).for_each(|(costs, runs)| {
            for (costs, run) in costs.chunks_exact_mut(LANES).zip(runs) {
                arch.dispatch(
                    #[inline(always)]
                    || self.costs(*run, &queries[run.turn as usize], costs),
                );
            }
        });
        let least = costs.iter().copied().fold(f32::INFINITY, f32::min);
        let most = least + least.abs() * self.config.tolerance;
        let near: Vec<usize> = (0..costs.len()).filter(|&i| costs[i] <= most).collect();
        let chosen = near[stream.random_range(0..near.len())];
        let run = runs[chosen / LANES];
        Source::new(run.row, run.col + chosen % LANES, run.turn, run.set)
    }

    /// Random runs of candidates, or all there are when that is fewer.
    fn runs(&self, stream: &mut Stream) -> Vec<Run> {
        let (turns, sets) = (self.ground.turns, self.ground.sets.len());
        let list = self.ground.centres.list();
        let count = self.config.candidates.div_ceil(LANES);
        let all = list.len() * turns.len() * sets;
        let cols = self.ground.centres.shape().1;
        let place = |(row, col): (u16, u16), turn: u8, set: usize| {
            let col = (col as usize).min(cols.saturating_sub(LANES));
            Run { row: row as usize, col, turn, set: set as u8 }
        };
        if all <= self.config.candidates {
            let starts: Vec<(u16, u16)> = {
                let mut starts: Vec<(u16, u16)> = Vec::new();
                for &(row, col) in list {
                    let covered = starts.last().is_some_and(|s| s.0 == row && col < s.1 + LANES as u16);
                    if !covered {
                        starts.push((row, col));
                    }
                }
                starts
            };
            let each = |start: &(u16, u16)| {
                let start = *start;
                turns.iter().flat_map(move |&turn| (0..sets).map(move |set| place(start, turn, set)))
            };
            return starts.iter().flat_map(each).collect();
        }
        (0..count)
            .map(|_| {
                let (row, col) = list[stream.random_range(0..list.len())];
                // A run around the place, so that both ends of a row are as likely as its middle.
                let col = (col as usize).saturating_sub(stream.random_range(0..LANES)) as u16;
                let turn = turns[stream.random_range(0..turns.len())];
                place((row, col), turn, stream.random_range(0..sets))
            })
            .collect()
    }

    fn queries(&self, turn: u8) -> Queries {
        let (rows, cols) = self.wanted.maps.heights.shape();
        let r = self.config.radius as i32;
        let maps = &self.wanted.maps;
        let strokes = maps.strokes;
        let channels = [maps.smooth, maps.landscape, strokes.map(|s| s[0]), strokes.map(|s| s[1])];
        let mut cells = Vec::new();
        for down in -r..=r {
            for right in -r..=r {
                let (there, beside) = step_back(turn, down, right);
                let (row, col) = (self.place.row as i32 + there, self.place.col as i32 + beside);
                if row < 0 || col < 0 || row >= rows as i32 || col >= cols as i32 {
                    continue;
                }
                let cell = Cell::new(row as usize, col as usize);
                debug_assert_eq!(step(turn, there, beside), (down, right));
                cells.push(Query {
                    down,
                    right,
                    known: self.laid.known[cell],
                    height: self.laid.heights[cell],
                    maps: channels.map(|map| map.map_or(0.0, |map| map[cell])),
                });
            }
        }
        let moments = |weight: &dyn Fn(&Query) -> f32, value: &dyn Fn(&Query) -> f32| {
            let total = cells.iter().map(weight).sum::<f32>() + 1e-9;
            let mean = cells.iter().map(|c| weight(c) * value(c)).sum::<f32>() / total;
            let squares = cells.iter().map(|c| weight(c) * (value(c) - mean).powi(2)).sum::<f32>();
            [mean, squares / total]
        };
        let [mean, variance] = moments(&|c| c.known, &|c| c.height);
        let guides = [0, 1].map(|k| moments(&|_| 1.0, &|c: &Query| c.maps[k]));
        let known = cells.iter().map(|c| c.known).sum::<f32>() + 1e-9;
        Queries { cells, known, mean, variance, guides }
    }

    /// The costs of the candidates of a run; those that are no centre stay infinite.
    #[inline(always)]
    fn costs(&self, run: Run, queries: &Queries, costs: &mut [f32]) {
        let (rows, cols) = self.ground.heights.shape();
        let width = LANES.min(cols - run.col);
        let allowed =
            |lane: usize| lane < width && self.ground.centres.allows(run.row as i32, (run.col + lane) as i32);
        if !(0..LANES).any(allowed) {
            return;
        }
        let heights = self.ground.heights.as_slice();
        let set = &self.ground.sets[run.set as usize];
        let used = self.laid.used.as_slice();
        // Sums over the patch, for each candidate: heights (weighted by what is known), their squares, their product with the query;
        // the same without weights for both guides; squared differences of nearness; use.
        let mut sums = [[0.0f32; LANES]; 3];
        let mut guides = [[[0.0f32; LANES]; 3]; 2];
        let (mut nearness, mut use_sum) = ([0.0f32; LANES], [0.0f32; LANES]);
        for query in &queries.cells {
            let row = run.row as i32 + query.down;
            if row < 0 || row >= rows as i32 {
                continue;
            }
            let start = row as usize * cols;
            let from = run.col as i32 + query.right;
            let cells = |map: &[f32]| -> [f32; LANES] {
                if from >= 0 && from as usize + LANES <= cols {
                    let mut cells = [0.0; LANES];
                    cells.copy_from_slice(&map[start + from as usize..][..LANES]);
                    return cells;
                }
                // Candidates beyond the frame are no centres; any number does.
                std::array::from_fn(|lane| {
                    let col = (from + lane as i32).clamp(0, cols as i32 - 1);
                    map[start + col as usize]
                })
            };
            let w = query.known;
            if w > 0.0 {
                let (z, q) = (cells(heights), query.height - queries.mean);
                for lane in 0..LANES {
                    let v = z[lane] - queries.mean;
                    sums[0][lane] += w * v;
                    sums[1][lane] += w * v * v;
                    sums[2][lane] += w * v * q;
                }
            }
            for k in 0..2 {
                if let Some(map) = set[k] {
                    let (z, q) = (cells(map.as_slice()), query.maps[k] - queries.guides[k][0]);
                    for lane in 0..LANES {
                        let v = z[lane] - queries.guides[k][0];
                        guides[k][0][lane] += v;
                        guides[k][1][lane] += v * v;
                        guides[k][2][lane] += v * q;
                    }
                }
            }
            for (map, q) in set[2..].iter().zip(&query.maps[2..]) {
                if let Some(map) = map {
                    let z = cells(map.as_slice());
                    for lane in 0..LANES {
                        nearness[lane] += (z[lane] - q) * (z[lane] - q);
                    }
                }
            }
            let u = cells(used);
            for lane in 0..LANES {
                use_sum[lane] += u[lane];
            }
        }
        let n = queries.cells.len() as f32;
        let even = (heights.len() as f32 / self.wanted.maps.heights.len() as f32) / n;
        let w = self.weights;
        for (lane, cost) in costs.iter_mut().enumerate().filter(|(lane, _)| allowed(*lane)) {
            // Moments relative to the query's mean.
            let mean = sums[0][lane] / queries.known;
            let variance = (sums[1][lane] / queries.known - mean * mean).max(0.0);
            let moments = |k: usize| {
                let mean = guides[k][0][lane] / n;
                ((guides[k][1][lane] / n - mean * mean).max(0.0), guides[k][2][lane] / n)
            };
            let ([membrane, landscape], floor) = ([moments(0), moments(1)], w.floor / w.heights);
            let own = queries.variance + queries.guides[0][1] + queries.guides[1][1];
            let stretch = w.stretch(own, variance + membrane.0 + landscape.0);
            // Squared difference over the joint energy.
            let part = |own: f32, (variance, product): (f32, f32)| {
                let other = stretch * stretch * variance;
                (own + other - 2.0 * stretch * product).max(0.0) / (floor + own + other)
            };
            let share = queries.known / (queries.known + UNKNOWN);
            let total = share * part(queries.variance, (variance, sums[2][lane] / queries.known))
                + w.elevation * mean * mean
                + w.smooth * part(queries.guides[0][1], membrane)
                + w.landscape * part(queries.guides[1][1], landscape);
            *cost = total + w.strokes * nearness[lane] / n + self.config.usage * even * use_sum[lane];
        }
    }
}
