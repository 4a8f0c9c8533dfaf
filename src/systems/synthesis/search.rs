//! PatchMatch with a Potts term, in parallel and with the same answer on any number of threads.
//!
//! Barnes, Shechtman, Finkelstein & Goldman 2009: every cell tries the sources that go on from its neighbours', then random ones in
//! shrinking windows around its own. A source costs its patch's distance, more where it is used often, plus a share for each of
//! the four neighbours that it does not continue: whole pieces of the exemplar hold together.
//!
//! The paper's sweep visits cells one after the other. Here tiles take the place of cells: a tile needs the tiles above and to the
//! left of it as they are after the sweep, the others as they were, so that tiles on one diagonal are independent; inside a
//! tile cells follow each other. Random numbers belong to the tile. Cost: cells x sweeps x about ten distances.

use super::patch::{Asked, Given, Patch, Weights};
use super::source::{Centres, Source};
use crate::control::Stop;
use crate::grid::{Cell, Grid};
use crate::seed::{Seed, Stream};
use pulp::Arch;
use rand::RngExt;
use rayon::prelude::*;

/// Side of a tile, cells.
const TILE: usize = 8;
/// A window at least this wide tries any symmetry and self-sketch first.
const WIDE: i32 = 9;
/// Share of the other random places that change the self-sketch.
const OTHER_SET: f64 = 0.3;

/// The source of every cell and what it costs.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) sources: Grid<Source>,
    /// With the factor for use, without the Potts term.
    pub(super) distances: Grid<f32>,
    /// How much higher the forms of the source are laid.
    pub(super) stretches: Grid<f32>,
}

impl Field {
    /// Sources that have not been compared yet.
    pub(super) fn new(sources: Grid<Source>) -> Self {
        Self { distances: sources.map(|_| 0.0), stretches: sources.map(|_| 1.0), sources }
    }
}

/// What a search compares and where it may look.
pub(super) struct Search<'a> {
    pub(super) maps: Asked<'a>,
    pub(super) given: Given<'a>,
    pub(super) weights: Weights,
    pub(super) radius: usize,
    pub(super) centres: &'a Centres,
    /// Of each place, relative to even use.
    pub(super) used: &'a Grid<f32>,
    pub(super) usage: f32,
    pub(super) coherence: f32,
    /// First window of the random search.
    pub(super) reach: usize,
    /// Symmetries that may be drawn.
    pub(super) turns: &'a [u8],
    /// Ends the sweeps early.
    pub(super) stop: &'a Stop,
}

impl Search<'_> {
    /// Measures the field's sources anew, then sweeps.
    pub(super) fn run(&self, field: &mut Field, sweeps: usize, seed: Seed) {
        let arch = Arch::new();
        let (rows, cols) = field.sources.shape();
        self.measure(field, arch);
        let (down, right) = (rows.div_ceil(TILE), cols.div_ceil(TILE));
        for sweep in 0..sweeps {
            let seed = seed.derive_indexed("sweep", sweep);
            let is_backward = sweep % 2 == 1;
            for diagonal in 0..down + right - 1 {
                if self.stop.is_raised() {
                    return;
                }
                let first = (diagonal + 1).saturating_sub(right);
                let tiles: Vec<(usize, usize)> = (first..=diagonal.min(down - 1))
                    .map(|a| (a, diagonal - a))
                    .map(|(a, b)| if is_backward { (down - 1 - a, right - 1 - b) } else { (a, b) })
                    .collect();
                let found: Vec<Tile> = tiles
                    .par_iter()
                    .map(|&(a, b)| {
                        let mut tile = Tile::cut(field, a * TILE, b * TILE);
                        let mut stream = seed.derive_indexed("tile", a * right + b).stream("search");
                        arch.dispatch(
                            #[inline(always)]
                            || self.sweep_tile(&mut tile, is_backward, &mut stream),
                        );
                        tile
                    })
                    .collect();
                found.iter().for_each(|tile| tile.put(field));
            }
        }
        self.measure(field, arch);
    }

    /// Distances and stretches of the field's sources.
    fn measure(&self, field: &mut Field, arch: Arch) {
        let cols = field.sources.cols();
        let sources = field.sources.as_slice();
        let distances = field.distances.as_mut_slice().par_chunks_mut(cols);
        let stretches = field.stretches.as_mut_slice().par_chunks_mut(cols);
        distances.zip(stretches).enumerate().for_each(|(row, (distances, stretches))| {
            arch.dispatch(
                #[inline(always)]
                || {
                    let mut patch = Patch::new(self.radius);
                    let sources = &sources[row * cols..(row + 1) * cols];
                    for (col, source) in sources.iter().enumerate() {
                        patch.load(&self.maps, row, col);
                        let (distance, stretch) =
                            patch.distance(&self.maps, &self.given, &self.weights, *source, f32::INFINITY);
                        distances[col] = distance * self.factor(source.row.into(), source.col.into());
                        stretches[col] = stretch;
                    }
                },
            );
        });
    }

    /// What use makes of a distance.
    #[inline(always)]
    fn factor(&self, row: i32, col: i32) -> f32 {
        1.0 + self.usage * self.used.as_slice()[row as usize * self.used.cols() + col as usize]
    }

    #[inline(always)]
    fn sweep_tile(&self, tile: &mut Tile, is_backward: bool, stream: &mut Stream) {
        let mut patch = Patch::new(self.radius);
        let (rows, cols) = (tile.rows, tile.cols);
        let ahead = if is_backward { 1 } else { -1 };
        let around = [(ahead, 0), (0, ahead), (-ahead, 0), (0, -ahead)];
        let places = (rows * cols) as i32;
        for i in 0..places {
            let i = if is_backward { places - 1 - i } else { i } as usize;
            let (row, col) = (i / cols, i % cols);
            patch.load(&self.maps, tile.top + row, tile.left + col);
            let mut best = tile.source(row, col);
            let mut distance = tile.distances[i];
            let mut cost = distance + self.coherence * tile.breaks(row, col, best);
            let mut attempt = |best: &mut Source, row_there: i32, col_there: i32, turn: u8, set: u8| {
                if !self.centres.allows(row_there, col_there) {
                    return;
                }
                let source = Source::new(row_there as usize, col_there as usize, turn, set);
                let breaks = self.coherence * tile.breaks(row, col, source);
                if source == *best || breaks >= cost {
                    return;
                }
                let factor = self.factor(row_there, col_there);
                let most = (cost - breaks) / factor;
                let found = factor * patch.distance(&self.maps, &self.given, &self.weights, source, most).0;
                if found + breaks < cost {
                    (cost, distance, *best) = (found + breaks, found, source);
                }
            };
            for (down, right) in around {
                if let Some(beside) = tile.neighbour(row, col, down, right) {
                    let (row_there, col_there) = beside.moved(-down, -right);
                    attempt(&mut best, row_there, col_there, beside.turn, beside.set);
                }
            }
            let mut reach = self.reach as i32;
            let mut is_first = reach >= WIDE;
            while reach >= 1 {
                let row_there = i32::from(best.row) + stream.random_range(-reach..=reach);
                let col_there = i32::from(best.col) + stream.random_range(-reach..=reach);
                let (mut turn, mut set) = (best.turn, best.set);
                let sets = self.given.sets.len() as u8;
                if is_first {
                    turn = self.turns[stream.random_range(0..self.turns.len())];
                    set = stream.random_range(0..sets);
                } else if stream.random::<f64>() < OTHER_SET {
                    set = stream.random_range(0..sets);
                }
                attempt(&mut best, row_there, col_there, turn, set);
                is_first = false;
                reach /= 2;
            }
            tile.distances[i] = distance;
            tile.set(row, col, best);
        }
    }
}

/// A tile's cells with one cell around them.
struct Tile {
    top: usize,
    left: usize,
    rows: usize,
    cols: usize,
    /// (rows + 2) x (cols + 2); none past the frame.
    sources: [Option<Source>; (TILE + 2) * (TILE + 2)],
    distances: [f32; TILE * TILE],
}

impl Tile {
    fn cut(field: &Field, top: usize, left: usize) -> Self {
        let (all_rows, all_cols) = field.sources.shape();
        let (rows, cols) = (TILE.min(all_rows - top), TILE.min(all_cols - left));
        let mut tile = Self {
            top,
            left,
            rows,
            cols,
            sources: [None; (TILE + 2) * (TILE + 2)],
            distances: [0.0; TILE * TILE],
        };
        for row in 0..rows + 2 {
            for col in 0..cols + 2 {
                let (r, c) = ((top + row).wrapping_sub(1), (left + col).wrapping_sub(1));
                if r < all_rows && c < all_cols {
                    tile.sources[row * (TILE + 2) + col] = Some(field.sources[Cell::new(r, c)]);
                }
            }
        }
        for row in 0..rows {
            for col in 0..cols {
                tile.distances[row * cols + col] = field.distances[Cell::new(top + row, left + col)];
            }
        }
        tile
    }

    fn put(&self, field: &mut Field) {
        for row in 0..self.rows {
            for col in 0..self.cols {
                let cell = Cell::new(self.top + row, self.left + col);
                field.sources[cell] = self.source(row, col);
                field.distances[cell] = self.distances[row * self.cols + col];
            }
        }
    }

    #[inline(always)]
    fn neighbour(&self, row: usize, col: usize, down: i32, right: i32) -> Option<Source> {
        let (row, col) = ((row as i32 + 1 + down) as usize, (col as i32 + 1 + right) as usize);
        self.sources[row * (TILE + 2) + col]
    }

    #[inline(always)]
    fn source(&self, row: usize, col: usize) -> Source {
        self.neighbour(row, col, 0, 0).unwrap_or_default()
    }

    #[inline(always)]
    fn set(&mut self, row: usize, col: usize, source: Source) {
        self.sources[(row + 1) * (TILE + 2) + col + 1] = Some(source);
    }

    /// Share of the four neighbours that do not go on from `source`.
    #[inline(always)]
    fn breaks(&self, row: usize, col: usize, source: Source) -> f32 {
        let (mut count, mut broken) = (0.0f32, 0.0);
        for (down, right) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            if let Some(beside) = self.neighbour(row, col, down, right) {
                count += 1.0;
                broken += f32::from(u8::from(!source.continues(beside, down, right)));
            }
        }
        broken / count.max(1.0)
    }
}
