//! From strokes to terrain, coarse to fine.
//!
//! The coarsest size is quilted; from there on every size alternates between a search for the best patches around every cell and
//! a surface that has the gradients for which they vote (an E and an M step; Kwatra et al. 2005), and hands its pieces on to the next.

use super::exemplar::{Drawn, Level, Synthesis, mean_and_deviation, membranes};
use super::patch::{Asked, Given, Set, Weights};
use super::provenance::provenance;
use super::quilting::{Ground, Wanted, quilt};
use super::search::{Field, Search};
use super::source::{Source, usage};
use super::strokes::{LevelStrokes, density, displaced};
use super::votes::votes;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::pyramid::doubled;
use crate::grid::{Cell, Grid, Window, gaussian};
use crate::interpolation::{Gradients, ScreenedPoisson};
use crate::landscape::{self, BreachConfig, LandscapeConfig};
use crate::metrics::Provenance;
use crate::seed::Seed;
use crate::sketch::LineMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Spread of the votes of the quilting, cells of the coarsest size.
const QUILTED_SPREAD: f64 = 0.6;
/// The last votes at the finest size are spread so much less: nearly one source a cell.
const LAST_SPREAD: f64 = 0.5;
/// Standard deviation of the smoothing of the membrane that large forms are pulled to, cells.
const SMOOTH_MEMBRANE: f64 = 16.0;
/// At least this share of the cells may lie in pits.
const LEAST_PITS: f64 = 0.003;

/// Terrain from strokes.
#[derive(Clone, Debug)]
pub struct Synthesized {
    /// Heights, in the unit of the strokes. Those of the strokes are theirs to the bit.
    pub heights: Grid<f32>,
    /// Where every cell comes from.
    pub(crate) provenance: Provenance,
    /// Share of the cells in pits before and after breaches were cut.
    pub pits: (f64, f64),
}

impl Synthesis {
    /// Terrain through `lines`, on cells as large as the exemplar's, in its unit of heights. Each seed gives another layout between
    /// the strokes; the same seed the same bytes on any number of threads.
    ///
    /// # Errors
    /// When no cell is drawn, the map has more than 2^26 cells, or it is stopped.
    pub fn synthesize(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Synthesized> {
        const MOST_CELLS: usize = 1 << 26;
        let (rows, cols) = lines.shape();
        if lines.line_count() == 0 {
            return Err(Error::value("number of line cells", 0, "the synthesis needs at least one stroke"));
        }
        if rows.saturating_mul(cols) > MOST_CELLS {
            let allowed = format!("the synthesis makes at most {MOST_CELLS} cells");
            return Err(Error::value("cells of the map", format!("{rows}x{cols}"), allowed));
        }
        let made = Run::new(self, lines, seed, stop)?.run()?;
        let datum = self.datum();
        let map = made
            .heights
            .crop(Window::new(Cell::new(0, 0), rows, cols))?
            .map(|z| (f64::from(*z) + datum) as f32);
        stop.check()?;
        let pinned = landscape::pin(&map, lines)?;
        let pit_share = self.landscape().pit_share.max(LEAST_PITS);
        let drained =
            landscape::breach(&pinned, lines, &BreachConfig { pit_share, ..Default::default() }, stop)?;
        Ok(Synthesized {
            heights: drained.heights,
            provenance: provenance(&made.field.sources.crop(Window::whole((rows, cols)))?, lines),
            pits: (drained.pits_before, drained.pits_after),
        })
    }
}

/// One synthesis on its way. Heights are without the exemplar's datum; the map is continued to whole cells of the coarsest size.
struct Run<'a> {
    exemplar: &'a Synthesis,
    drawn: Arc<Drawn>,
    /// Number of sizes.
    levels: usize,
    /// (rows, columns) at the finest size.
    shape: (usize, usize),
    /// The strokes, displaced.
    lines: LineMap,
    /// At every size.
    membranes: Vec<Grid<f32>>,
    /// At every size.
    landscape: Option<Vec<Grid<f32>>>,
    heights: Grid<f32>,
    field: Field,
    seed: Seed,
    stop: Stop,
}

impl<'a> Run<'a> {
    fn new(exemplar: &'a Synthesis, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Self> {
        let config = exemplar.config();
        let levels = exemplar.levels_for(lines.shape());
        let whole = |side: usize| side.next_multiple_of(1 << (levels - 1));
        let shape = (whole(lines.shape().0), whole(lines.shape().1));
        let mut continued = LineMap::empty(shape.0, shape.1);
        for (cell, kind) in lines.kinds().cells() {
            if let Some(kind) = kind {
                continued.set(cell, *kind, lines.heights()[cell]);
            }
        }
        let drawn = exemplar.drawn(density(lines, config.line_length, config.most_lines))?;
        let datum = exemplar.datum();
        let moved = displaced(&continued, config.warp, seed.derive("displacement"))?
            .map_heights(|z| (f64::from(z) - datum) as f32);
        let at = |l: usize| (shape.0 >> l, shape.1 >> l);
        let landscape = if exemplar.landscape().is_fluvial() {
            let (fit, cell) = (exemplar.landscape(), exemplar.cell());
            let found = landscape::solve_until(
                fit,
                &continued,
                cell,
                &LandscapeConfig::guide(),
                seed.derive("guide"),
                stop,
            )?;
            let level = |l: usize| Ok(found.heights(1 << l)?.map(|z| (f64::from(*z) - datum) as f32));
            Some((0..levels).map(level).collect::<Result<Vec<_>>>()?)
        } else {
            None
        };
        let (rows, cols) = at(levels - 1);
        Ok(Self {
            membranes: membranes(&moved, levels, &at)?,
            exemplar,
            drawn,
            levels,
            shape,
            lines: moved,
            landscape,
            heights: Grid::filled(rows, cols, 0.0),
            field: Field::new(Grid::filled(rows, cols, Source::default())),
            seed,
            stop: stop.clone(),
        })
    }

    /// Least and most that patches are stretched: not at all where no landscape model says how strong forms are to be, since the
    /// membrane, which then guides alone, says too much of it along strokes over dunes.
    fn stretch(&self) -> [f32; 2] {
        if self.landscape.is_some() { self.exemplar.config().stretch } else { [1.0, 1.0] }
    }

    fn run(mut self) -> Result<Self> {
        for l in (0..self.levels).rev() {
            self.level(l)?;
        }
        Ok(self)
    }

    /// (rows, columns) at a size.
    const fn at(&self, l: usize) -> (usize, usize) {
        (self.shape.0 >> l, self.shape.1 >> l)
    }

    fn level(&mut self, l: usize) -> Result<()> {
        let exemplar = self.exemplar;
        let config = exemplar.config();
        let (own, ground) = (&config.levels[l], &exemplar.levels()[l]);
        let seed = self.seed.derive_indexed("size", l);
        let strokes = self.strokes(l);
        let mut surface = self.surface(l, &strokes)?;
        if l + 1 == self.levels {
            self.field = Field::new(self.quilted(l, &strokes, seed)?);
            self.heights = self.guide(l).clone();
            let votes = votes(&self.field, &ground.heights, own.radius, QUILTED_SPREAD, config.vote_scale);
            self.heights = surface.through(&votes, &self.heights)?;
        } else {
            self.refine(l);
        }
        let nearness = (own.guide > 0.0).then(|| strokes.nearness(&config.guide));
        for round in 0..own.rounds {
            self.stop.check()?;
            let smooth = (own.flow > 0.0)
                .then(|| gaussian::smooth(&self.heights, &self.heights.map(|_| true), own.flow_sigma));
            let used = usage(&self.field.sources, ground.heights.shape(), own.radius);
            let is_enlarged = round == 0 && l + 1 < self.levels;
            let guided = own.guide > 0.0;
            let search = Search {
                maps: Asked {
                    heights: &self.heights,
                    smooth: smooth.as_ref().or_else(|| guided.then(|| &self.membranes[l])),
                    landscape: self.landscape.as_ref().filter(|_| guided).map(|all| &all[l]),
                    strokes: nearness.as_ref().map(|[ridges, valleys]| [ridges, valleys]),
                },
                given: self.given(l, is_enlarged),
                weights: self.weights(l),
                radius: own.radius,
                centres: &ground.centres,
                used: &used,
                usage: config.usage,
                coherence: own.coherence,
                reach: own.reach.unwrap_or(ground.heights.rows().max(ground.heights.cols())),
                turns: &exemplar.symmetries().used,
                stop: &self.stop,
            };
            let mut field = self.field.clone();
            search.run(&mut field, own.sweeps, seed.derive_indexed("round", round));
            self.field = field;
            let is_last = l == 0 && round + 1 == own.rounds;
            let spread = own.spread * if is_last { LAST_SPREAD } else { 1.0 };
            let votes = votes(&self.field, &ground.heights, own.radius, spread, config.vote_scale);
            self.heights = surface.through(&votes, &self.heights)?;
        }
        Ok(())
    }

    /// The strokes at a size, as much above or below themselves as the exemplar's ground is there.
    fn strokes(&self, l: usize) -> LevelStrokes {
        let mut strokes = LevelStrokes::new(&self.lines, 1 << l, self.at(l));
        if l > 0 {
            strokes.cells.iter_mut().for_each(|(_, z, kind)| *z += self.drawn.above[l][*kind]);
        }
        strokes
    }

    /// What says the large forms at a size.
    fn guide(&self, l: usize) -> &Grid<f32> {
        self.landscape.as_ref().map_or(&self.membranes[l], |all| &all[l])
    }

    /// Weights of the search.
    fn weights(&self, l: usize) -> Weights {
        let config = self.exemplar.config();
        let (own, guide) = (&config.levels[l], &config.guide);
        let unit = 1.0 / self.exemplar.levels()[l].strength;
        let membrane = if self.landscape.is_some() { guide.membrane } else { guide.membrane_alone };
        Weights {
            heights: unit,
            smooth: unit * if own.flow > 0.0 { own.flow } else { membrane * own.guide },
            landscape: unit * guide.landscape * own.guide,
            strokes: guide.strokes * own.guide,
            elevation: unit * guide.elevation * own.guide,
            floor: config.floor,
            stretch: self.stretch(),
        }
    }

    /// The exemplar's maps at a size.
    fn given(&self, l: usize, is_enlarged: bool) -> Given<'_> {
        let ground: &Level = &self.exemplar.levels()[l];
        let sets = self.drawn.sketches.iter().map(|sketch| {
            let level = &sketch.levels[l];
            Set {
                smooth: ground.smooth.as_ref().or(level.membrane.as_ref().map(|m| &m.1)),
                landscape: level.landscape.as_ref().map(|m| &m.1),
                strokes: level.strokes.as_ref().map(|[ridges, valleys]| [&ridges.1, &valleys.1]),
            }
        });
        let blurred = ground.blurred.as_ref().filter(|_| is_enlarged);
        Given { heights: blurred.unwrap_or(&ground.sharp), sets: sets.collect() }
    }

    /// The layout of the coarsest size.
    fn quilted(&self, l: usize, strokes: &LevelStrokes, seed: Seed) -> Result<Grid<Source>> {
        let (exemplar, config) = (self.exemplar, self.exemplar.config());
        let ground = &exemplar.levels()[l];
        let centres = exemplar.quilting_centres(l)?;
        let nearness = strokes.nearness(&config.guide);
        let sets = self.drawn.sketches.iter().map(|sketch| {
            let level = &sketch.levels[l];
            let strokes = level.strokes.as_ref();
            [
                level.membrane.as_ref().map(|m| &m.0),
                level.landscape.as_ref().map(|m| &m.0),
                strokes.map(|s| &s[0].0),
                strokes.map(|s| &s[1].0),
            ]
        });
        let wanted: Vec<(Cell, f32)> = strokes.cells.iter().map(|(cell, z, _)| (*cell, *z)).collect();
        let unit = 1.0 / exemplar.strength_of_patches(l, &centres);
        let weights = Weights {
            heights: unit,
            smooth: if self.landscape.is_some() {
                config.guide.membrane
            } else {
                config.guide.membrane_alone
            },
            landscape: config.guide.landscape,
            strokes: config.guide.strokes,
            elevation: unit * config.guide.elevation,
            floor: config.floor,
            stretch: self.stretch(),
        };
        let sources = quilt(
            &Ground {
                heights: &ground.heights,
                sets: sets.collect(),
                centres: &centres,
                turns: &exemplar.symmetries().used,
            },
            &Wanted {
                strokes: &wanted,
                maps: Asked {
                    heights: &self.membranes[l],
                    smooth: Some(&self.membranes[l]),
                    landscape: self.landscape.as_ref().map(|all| &all[l]),
                    strokes: Some([&nearness[0], &nearness[1]]),
                },
            },
            &weights,
            &config.quilting,
            seed.derive("layout"),
            &self.stop,
        );
        self.stop.check()?;
        Ok(sources.map(|source| {
            let (row, col) = ground.centres.nearest(source.row.into(), source.col.into());
            Source::new(row, col, source.turn, source.set)
        }))
    }

    /// Carries heights and whole pieces to the next finer size.
    fn refine(&mut self, l: usize) {
        let (rows, cols) = self.at(l);
        let centres = &self.exemplar.levels()[l].centres;
        let coarse = &self.field.sources;
        let sources = Grid::from_fn(rows, cols, |c| {
            let source = coarse[Cell::new(c.row / 2, c.col / 2)];
            let (row, col) = source.finer(c.row % 2, c.col % 2);
            let (row, col) = centres.nearest(row, col);
            Source::new(row, col, source.turn, source.set)
        });
        self.heights = doubled(&self.heights);
        self.field = Field::new(sources);
    }

    /// What large forms are pulled to at a size: those of the landscape model; without one the smoothed membrane, lifted as far as
    /// the exemplar's ground lies above its own, since crests are drawn more often than the ground between them.
    fn large_forms(&self, l: usize) -> Grid<f32> {
        if let Some(landscape) = &self.landscape {
            return landscape[l].clone();
        }
        let membrane = &self.membranes[l];
        let sigma = SMOOTH_MEMBRANE / f64::from(1u32 << l);
        let smooth = gaussian::smooth(membrane, &membrane.map(|_| true), sigma);
        let lift = (self.drawn.lift * mean_and_deviation(membrane).1) as f32;
        smooth.map(|z| z + lift)
    }

    /// The equation of a size.
    fn surface(&self, l: usize, strokes: &LevelStrokes) -> Result<Surface> {
        let config = self.exemplar.config();
        let own = &config.levels[l];
        let (rows, cols) = self.at(l);
        let cut = if self.landscape.is_some() { config.cut } else { config.cut_alone };
        let screen = if own.screened { (TAU / (cut / f64::from(1u32 << l))).powi(2) } else { 0.0 };
        let mut weights = Grid::filled(rows, cols, config.hold + screen);
        let mut pull = if screen > 0.0 {
            self.large_forms(l).map(|z| screen * f64::from(*z))
        } else {
            Grid::filled(rows, cols, 0.0)
        };
        for (cell, z, _) in &strokes.cells {
            weights[*cell] += own.strokes;
            pull[*cell] += own.strokes * f64::from(*z);
        }
        let poisson = ScreenedPoisson::new(weights.clone(), &self.stop)?;
        Ok(Surface { poisson, weights, pull, hold: config.hold, most_gain: config.most_gain })
    }
}

/// Heights from gradients at one size.
struct Surface {
    poisson: ScreenedPoisson,
    weights: Grid<f64>,
    /// Weight times target, without what holds the surface where it was.
    pull: Grid<f64>,
    hold: f64,
    most_gain: f64,
}

impl Surface {
    /// The surface of these gradients near `before`. Where patches disagree slopes are lost: they are given back once.
    fn through(&mut self, gradients: &Gradients, before: &Grid<f32>) -> Result<Grid<f32>> {
        let mut targets = self.pull.clone();
        let each = targets.as_mut_slice().iter_mut().zip(self.weights.as_slice()).zip(before.as_slice());
        each.for_each(|((t, w), z)| *t = (*t + self.hold * f64::from(*z)) / w);
        let start = before.map(|z| f64::from(*z));
        let first = self.poisson.solve(gradients, &targets, &start)?;
        let found = first.map(|z| *z as f32);
        let (wanted, got) = (gradients.mean_length(), Gradients::of(&found).mean_length());
        if self.most_gain <= 1.0 || got <= 0.0 {
            return Ok(found);
        }
        let gain = (wanted / got).min(self.most_gain);
        let again = self.poisson.solve(&gradients.scaled(gain as f32), &targets, &first)?;
        Ok(again.map(|z| *z as f32))
    }
}
