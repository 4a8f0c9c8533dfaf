//! A style: what was learned from one piece of terrain, and what is made with it. The only room that knows every system.
//!
//! [`Source`] -> [`learn`] -> [`Style`] -> one `.safetensors` file. A style holds any number of coarse systems, which turn lines
//! into terrain, and at most one model of detail, which adds what lines leave open; each of them keeps the promise of
//! [`Part`](crate::systems::task::Part) and is known by name to a [`Registry`].

mod config;
mod detail;
mod detail_spec;
mod drain;
mod file;
mod heights;
mod learn;
mod learned;
mod recipe;
mod registry;
mod unseen;
mod uses;
mod version1;
mod windows;

pub(crate) use crate::systems::region_gnn::{
    GenerationConfig, LossValues, Preset, RegionGraph, RegionNetwork, RegionNetworkConfig,
};
pub use crate::systems::singan::DetailConfig as GeneratorConfig;
pub(crate) use crate::systems::task::fingerprint;
pub use crate::systems::task::{Exemplar, ExemplarInfo, Source};
pub use config::{StyleConfig, generators};
pub(crate) use config::{overlaid, overlay};
pub use detail::add_detail;
pub(crate) use detail_spec::DetailSpec;
pub(crate) use drain::Drain;
pub use learn::learn;
pub(crate) use learn::unfinished;
pub(crate) use learned::detail_plan;
pub use learned::{DetailPlan, LearnedDetail, LearnedSystem, SystemPlan};
pub(crate) use recipe::default_window;
pub use recipe::{Choices, DetailChoice, Recipe};
pub use registry::{Named, Registry};
pub(crate) use unseen::has_unseen;
pub use unseen::unseen_surface;
pub(crate) use uses::{names, suffix};
pub use windows::{PATCH, choose_exemplar, patch_cells};

use crate::control::Stop;
use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::extract::ExtractionConfig;
use crate::grid::Grid;
use crate::metrics::Provenance;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::systems::task::DetailUse;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::sync::Arc;

/// Where a style comes from, and what its parts have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Seed of the training.
    pub(crate) seed: Seed,
    /// Metres of the unit interval: the exemplar's range.
    pub normalization: Normalization,
    /// The exemplar.
    pub exemplar: ExemplarInfo,
    /// Mean slope of the exemplar, unit heights a cell; absent in styles of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) mean_slope: Option<f64>,
    /// How its lines were found.
    pub extraction: ExtractionConfig,
}

/// Name of the region network.
pub(crate) const NETWORK: &str = <RegionNetwork as crate::systems::task::Part>::NAME;

/// Which coarse system of a style makes terrain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The first one that is made for drawings of so few strokes, or else the style's first.
    #[default]
    Auto,
    /// The one of that name.
    System(String),
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::System(name) => f.write_str(name),
        }
    }
}

/// A trained style.
#[derive(Clone, Debug)]
pub struct Style {
    /// Where it comes from.
    pub origin: Origin,
    /// The coarse systems, at least one; the first is the one that is used unless another is asked for.
    pub coarse: Vec<Arc<dyn LearnedSystem>>,
    /// The model of detail.
    pub detail: Option<Arc<dyn LearnedDetail>>,
    /// The exemplar's terrain and what lies around it, for the parts that need it; metres.
    pub terrain: Option<Arc<Dem>>,
}

impl Style {
    /// The coarse system of a type, when the style has it.
    #[must_use]
    pub fn system<S: Any>(&self) -> Option<&S> {
        self.coarse.iter().find_map(|system| {
            let any: &dyn Any = &**system;
            any.downcast_ref()
        })
    }

    /// The region network.
    ///
    /// # Errors
    /// When the style has none.
    pub fn network(&self) -> Result<&RegionNetwork> {
        self.system().ok_or_else(|| {
            let names: Vec<&str> = self.coarse.iter().map(|system| system.name()).collect();
            Error::value("systems of the style", names.join(", "), "a region network (gnn) is needed here")
        })
    }

    /// The same style, its network with other settings of generation.
    ///
    /// # Errors
    /// When they are out of range or do not go with the network.
    pub fn with_generation(mut self, generation: &GenerationConfig) -> Result<Self> {
        for system in &mut self.coarse {
            let any: &dyn Any = &**system;
            if let Some(network) = any.downcast_ref::<RegionNetwork>() {
                *system = Arc::new(network.with_generation(generation.clone())?);
            }
        }
        Ok(self)
    }

    /// The settings that extraction and network have; those of `Default` for a network that is not there.
    #[must_use]
    pub fn config(&self) -> StyleConfig {
        use crate::systems::task::Part;
        let network =
            self.system::<RegionNetwork>().map(|network| network.config().clone()).unwrap_or_default();
        let RegionNetworkConfig { model, generation } = network;
        StyleConfig { extraction: self.origin.extraction.clone(), model, generation }
    }

    /// The model of detail, where a style without one is a mistake.
    ///
    /// # Errors
    /// When there is none.
    pub fn needed_detail(&self) -> Result<&Arc<dyn LearnedDetail>> {
        let allowed = "train the style again without --no-detail";
        self.detail.as_ref().ok_or_else(|| Error::value("detail of the style", "none", allowed))
    }

    /// The coarse system that makes terrain of `lines`.
    ///
    /// # Errors
    /// When the style has no system of that name.
    pub fn system_for(&self, lines: &LineMap, method: &Method) -> Result<&Arc<dyn LearnedSystem>> {
        let named = |name: &str| self.coarse.iter().find(|system| system.name() == name);
        let found = match method {
            Method::Auto => {
                let (rows, cols) = lines.shape();
                let share = lines.line_count() as f64 / (rows * cols) as f64;
                self.coarse.iter().find(|system| share <= system.sparse_up_to()).or(self.coarse.first())
            }
            Method::System(name) => named(name),
        };
        found.ok_or_else(|| {
            let names: Vec<&str> = self.coarse.iter().map(|system| system.name()).collect();
            let allowed = format!("the style has {}; `train --systems` learns others", names.join(", "));
            Error::value("system of the style", method, allowed)
        })
    }

    /// Terrain in metres for lines in metres, by the coarse system that `method` says. `range`: the elevations that stand for the exemplar's
    /// lowest and highest height; none takes the exemplar's own.
    ///
    /// The lines are taken as drawn by a hand ([`draw`](crate::systems::task::SketchToTerrain::draw)). Evaluations, where heights
    /// on lines are real, take the systems of [`uses`](Self::uses).
    ///
    /// ```
    /// # fn main() -> monadnock::Result<()> {
    /// use monadnock::{Control, Method, Recipe, Seed, Source, Stop, dem::bundled, learn, sketch::samples};
    ///
    /// let source = Source::whole("sierra", &bundled::load("sierra")?)?;
    /// let style = learn(&source, &Recipe::drawings(Seed(1))?, Control::new(&mut |_| ()))?;
    /// let range = style.origin.normalization;
    /// let drawing = samples::load("lambda-ring")?.sketch.scaled_to(64, 64);
    /// let lines = drawing.map_heights(|z| range.to_metres(z)).rasterize();
    /// let terrain = style.generate(&lines, &Method::Auto, None, Seed(1), &Stop::new())?;
    /// let drawn = lines.mask();
    /// let met = |i: usize| terrain.as_slice()[i] == lines.heights().as_slice()[i];
    /// assert!((0..terrain.len()).filter(|&i| drawn.as_slice()[i]).all(met));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// When there is no line, or the work is stopped.
    pub fn generate(
        &self,
        lines: &LineMap,
        method: &Method,
        range: Option<Normalization>,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Grid<f32>> {
        let made = self.made(lines, method, range, |system, unit| {
            system.draw(unit, seed, stop).map(|terrain| (terrain, ()))
        });
        Ok(made?.0)
    }

    /// As [`generate`](Self::generate), with where every cell comes from, in rows and columns of the style's [terrain](Self::terrain).
    ///
    /// # Errors
    /// As there; when the system lays no places of the exemplar.
    pub fn generate_traced(
        &self,
        lines: &LineMap,
        method: &Method,
        range: Option<Normalization>,
        seed: Seed,
        stop: &Stop,
    ) -> Result<(Grid<f32>, Provenance)> {
        self.made(lines, method, range, |system, unit| {
            system.traced(unit, seed, stop).unwrap_or_else(|| {
                let allowed = "its terrain is not laid from places of the exemplar; synthesis has sources (--method synthesis)";
                Err(Error::value("sources of the system", system.name(), allowed))
            })
        })
    }

    /// Terrain in metres and what `make` gives beside it. Lines and answer of `make` are in the unit interval.
    fn made<T>(
        &self,
        lines: &LineMap,
        method: &Method,
        range: Option<Normalization>,
        make: impl FnOnce(&dyn LearnedSystem, &LineMap) -> Result<(Grid<f32>, T)>,
    ) -> Result<(Grid<f32>, T)> {
        let range = range.unwrap_or(self.origin.normalization);
        let unit = lines.to_unit(range);
        let (terrain, beside) = make(&**self.system_for(lines, method)?, &unit)?;
        let mut terrain = range.denormalize(&terrain);
        // What passes through the lines in the unit interval does so in metres, to the bit.
        let drawn =
            lines.kinds().as_slice().iter().zip(lines.heights().as_slice()).zip(unit.heights().as_slice());
        for (z, ((kind, &height), &unit)) in terrain.as_mut_slice().iter_mut().zip(drawn) {
            if kind.is_some() && *z == range.to_metres(f64::from(unit)) as f32 {
                *z = height;
            }
        }
        Ok((terrain, beside))
    }

    /// `dem` with `factor` times as many cells in each direction, and the style's detail below its own cells. Where it has voids, so
    /// has the answer; they are bridged harmonically meanwhile.
    ///
    /// ```
    /// # fn main() -> monadnock::Result<()> {
    /// use monadnock::{Cell, Control, Recipe, Seed, Source, Stop, Window, dem::bundled, learn, style::StyleConfig};
    /// use monadnock::systems::task::DetailUse;
    ///
    /// let dem = bundled::load("sierra")?;
    /// let mut config = StyleConfig::default();
    /// (config.model.epochs, config.model.extractions) = (3, 2);
    /// let recipe = Recipe::network(&config, Seed(1))?.with_patches()?;
    /// let style = learn(&Source::new("sierra", &dem, Window::square(Cell::new(128, 0), 64))?, &recipe, Control::new(&mut |_| ()))?;
    /// let coarse = dem.crop(Window::new(Cell::new(0, 0), 32, 48))?;
    /// let fine = style.amplify(&coarse, 2, &DetailUse::default(), Seed(1), &Stop::new())?;
    /// assert_eq!(fine.shape(), (64, 96));
    /// assert_eq!(fine.cell_size().x(), coarse.cell_size().x() / 2.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// When the style has no detail, a setting is out of range, there are more than 2^30 cells to make or more than the detail model
    /// can, or the work is stopped.
    pub fn amplify(&self, dem: &Dem, factor: usize, how: &DetailUse, seed: Seed, stop: &Stop) -> Result<Dem> {
        detail::amplify(dem, &**self.needed_detail()?, self.origin.normalization, factor, how, seed, stop)
    }
}
