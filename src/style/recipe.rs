//! The recipe of a style: all that decides what is learned, read from settings or put together by hand.

use super::config::{StyleConfig, generators, overlaid};
use super::learned::{DetailPlan, SystemPlan, system_plan};
use super::{Registry, Style};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::extract::ExtractionConfig;
use crate::grid::Window;
use crate::seed::Seed;
use crate::systems::gpnn::{self, PatchDetail};
use crate::systems::landscape::LandscapeSystem;
use crate::systems::region_gnn::{Preset, RegionNetwork};
use crate::systems::singan::{Detail, DetailConfig as GeneratorConfig};
use crate::systems::synthesis::SynthesisSystem;
use crate::systems::task::{Part, Source};
use std::sync::Arc;

/// Windows with more cells than this are not learned whole unless asked for: training costs about 1 kB a cell and extraction.
const LARGEST_WHOLE: usize = 192 * 192;

/// What is learned from an exemplar.
#[derive(Clone)]
pub struct Recipe {
    /// How lines are found.
    pub extraction: ExtractionConfig,
    /// The coarse systems, at least one. The first is the one that is used unless another is asked for, and by which the strength of
    /// detail is measured.
    pub systems: Vec<Arc<dyn SystemPlan>>,
    /// The model of detail.
    pub detail: Option<Arc<dyn DetailPlan>>,
    /// From which everything random is drawn.
    pub seed: Seed,
    /// Whether the exemplar's terrain is stored where a part needs it.
    pub keep_terrain: bool,
    /// A style of the same window, seed and settings, whose coarse systems are taken instead of being learned.
    pub known: Option<Style>,
    /// The systems that a style from an earlier run may hold.
    pub registry: Registry,
}

/// Which model of detail is wanted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DetailChoice {
    /// The exemplar's patches, or generators where the exemplar is too large to be searched or a setting of theirs is given. None
    /// for the preset `paper`, unless such a setting is given.
    #[default]
    Automatic,
    /// The one of that name.
    Named(String),
    /// None.
    Without,
}

/// What a recipe is made from: presets, and what is laid over them.
#[derive(Clone, Debug)]
pub struct Choices {
    /// The network's configuration to begin with.
    pub preset: Preset,
    /// The generators' configuration to begin with; none where nothing was said about them.
    pub generators: Option<GeneratorConfig>,
    /// Names of the coarse systems; none for what suits most: the network, and with it landscape and synthesis for drawings of few
    /// strokes, unless the preset is `paper`.
    pub systems: Option<Vec<String>>,
    /// The model of detail.
    pub detail: DetailChoice,
    /// Settings: the sections `[extraction]`, `[model]`, `[generation]`, `[detail]` (of generators), and one by the name of every other
    /// system.
    pub settings: toml::Table,
    /// Number of epochs of the network, over all settings.
    pub epochs: Option<usize>,
}

impl Default for Choices {
    /// The network and patches with their best settings.
    fn default() -> Self {
        Self {
            preset: Preset::Anchored,
            generators: None,
            systems: None,
            detail: DetailChoice::default(),
            settings: toml::Table::new(),
            epochs: None,
        }
    }
}

impl Recipe {
    /// The network alone, to which more may be added.
    ///
    /// # Errors
    /// When a setting is out of range.
    pub fn network(config: &StyleConfig, seed: Seed) -> Result<Self> {
        Ok(Self {
            extraction: config.extraction.clone(),
            systems: vec![system_plan::<RegionNetwork>(config.network())?],
            detail: None,
            seed,
            keep_terrain: true,
            known: None,
            registry: Registry::default(),
        })
    }

    /// Terrain from drawings of few strokes alone: nothing is trained.
    ///
    /// # Errors
    /// Never: its own settings are in range.
    pub fn drawings(seed: Seed) -> Result<Self> {
        Ok(Self {
            systems: vec![system_plan::<SynthesisSystem>(Default::default())?],
            ..Self::network(&StyleConfig::default(), seed)?
        })
    }

    /// The same with the systems for drawings of few strokes.
    ///
    /// # Errors
    /// Never: their own settings are in range.
    pub fn with_systems_for_drawings(mut self) -> Result<Self> {
        self.systems.push(system_plan::<LandscapeSystem>(Default::default())?);
        self.systems.push(system_plan::<SynthesisSystem>(Default::default())?);
        Ok(self)
    }

    /// The recipe that is wanted for an exemplar of `rows` x `cols` cells.
    ///
    /// # Errors
    /// When there is no such system, a setting is unknown or out of range, or the exemplar is too large for what is asked for.
    pub fn new(
        registry: &Registry,
        choices: &Choices,
        (rows, cols): (usize, usize),
        seed: Seed,
    ) -> Result<Self> {
        let mut settings = choices.settings.clone();
        let mut section = |name: &str| match settings.remove(name) {
            Some(toml::Value::Table(section)) => Ok(section),
            Some(other) => Err(Error::value(name, other, "allowed: a section with keys")),
            None => Ok(toml::Table::new()),
        };
        let of_generators = section("detail")?;
        let mut sections = Vec::new();
        for name in registry.names().into_iter().filter(|name| *name != RegionNetwork::NAME) {
            sections.push((name, section(name)?));
        }
        let own = |wanted: &str| {
            let found = sections.iter().find(|(name, _)| *name == wanted);
            found.map(|(_, section)| section.clone()).unwrap_or_default()
        };
        let mut config = overlaid(&StyleConfig::preset(choices.preset), [&settings], "configuration")?;
        config.model.epochs = choices.epochs.unwrap_or(config.model.epochs);
        let base = choices.generators.clone().unwrap_or_default();
        let of_generators = overlaid(&base, [&of_generators], "configuration of the detail")?;
        let asked = choices.generators.is_some() || of_generators != base;

        let mut recipe = Self { registry: registry.clone(), ..Self::network(&config, seed)? };
        let plan = |name: &String| match name.as_str() {
            RegionNetwork::NAME => config.plan(),
            name => registry.plan(name, &own(name)),
        };
        let usual = match choices.preset {
            Preset::Paper => vec![RegionNetwork::NAME],
            _ => vec![RegionNetwork::NAME, LandscapeSystem::NAME, SynthesisSystem::NAME],
        };
        let usual = || usual.iter().map(|name| (*name).to_owned()).collect();
        recipe.systems =
            choices.systems.clone().unwrap_or_else(usual).iter().map(plan).collect::<Result<_>>()?;
        let searched = gpnn::check_shape(rows, cols);
        let name = match &choices.detail {
            DetailChoice::Without => None,
            DetailChoice::Automatic if choices.preset == Preset::Paper && !asked => None,
            DetailChoice::Automatic if asked || searched.is_err() => Some(Detail::NAME),
            DetailChoice::Automatic => Some(PatchDetail::NAME),
            DetailChoice::Named(name) => Some(name.as_str()),
        };
        if name == Some(PatchDetail::NAME) {
            searched?;
        }
        if let Some(other) = name.filter(|name| asked && *name != Detail::NAME) {
            let allowed = "--detail-preset and the keys of [detail] are of generators: leave them out";
            return Err(Error::value("--detail-model", other, allowed));
        }
        recipe.detail = match name {
            None => None,
            Some(Detail::NAME) => Some(generators(of_generators)?),
            Some(name) => Some(registry.plan_detail(name, &own(name))?),
        };
        Ok(recipe)
    }

    /// The same with the exemplar's own patches as detail.
    ///
    /// # Errors
    /// Never: patches have no settings.
    pub fn with_patches(mut self) -> Result<Self> {
        self.detail = Some(super::detail_plan::<PatchDetail>(gpnn::PatchConfig {})?);
        Ok(self)
    }

    /// Leaves out the systems after the first that the exemplar's terrain is not enough for, or that need it stored where it is
    /// not: their names, and why.
    pub fn leave_out_unsuited(&mut self, source: &Source) -> Vec<(&'static str, Error)> {
        let mut left_out = Vec::new();
        let keep_terrain = self.keep_terrain;
        let mut is_first = true;
        self.systems.retain(|plan| {
            let unsuited = if plan.needs_terrain() && !keep_terrain {
                Err(Error::value("terrain of the style", "left out", "the system makes terrain of it"))
            } else {
                plan.check(&source.terrain)
            };
            let is_kept = std::mem::take(&mut is_first) || unsuited.is_ok();
            left_out.extend(unsuited.err().filter(|_| !is_kept).map(|why| (plan.name(), why)));
            is_kept
        });
        left_out
    }

    /// The names of all its parts, in the order in which they are learned.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.systems
            .iter()
            .map(|plan| plan.name())
            .chain(self.detail.iter().map(|plan| plan.name()))
            .collect()
    }

    /// The coarse system that is learned first.
    pub(super) fn first(&self) -> Result<&Arc<dyn SystemPlan>> {
        self.systems.first().ok_or_else(|| Error::value("number of systems", 0, "a style needs at least one"))
    }

    /// Whether `style` is what this recipe makes of `source`, so that its coarse systems need not be learned again; where the training
    /// was `timed` by a budget, whatever their number of steps.
    ///
    /// # Errors
    /// Says what differs.
    pub fn continues(&self, style: &Style, source: &Source, timed: bool) -> Result<()> {
        let allowed =
            "to resume, or to take its coarse model, exemplar, seed and configuration must be the same";
        let origin = &style.origin;
        if origin.exemplar.sha256 != source.info.sha256 {
            return Err(Error::value("exemplar of the style", &origin.exemplar.name, allowed));
        }
        if origin.seed != self.seed {
            return Err(Error::value("seed of the style", origin.seed.0, allowed));
        }
        let first = self.first()?;
        let is_made = style.coarse.iter().any(|system| first.made(&**system, timed));
        if origin.extraction != self.extraction || !is_made {
            return Err(Error::value("configuration of the style", "another one", allowed));
        }
        Ok(())
    }
}

/// The window that is learned when none is named: all of a small DEM, else its most varied central patch. (origin, rows, columns)
///
/// # Errors
/// When a large DEM holds no whole patch.
pub(crate) fn default_window(dem: &Dem) -> Result<Window> {
    let whole = Window::whole(dem.shape());
    if whole.rows * whole.cols <= LARGEST_WHOLE {
        return Ok(whole);
    }
    Ok(Window::square(super::choose_exemplar(dem)?, super::PATCH))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recipe(choices: &Choices, side: usize) -> Result<Recipe> {
        Recipe::new(&Registry::default(), choices, (side, side), Seed(1))
    }

    fn set(text: &str) -> Choices {
        Choices { settings: text.parse().unwrap(), ..Choices::default() }
    }

    #[test]
    fn settings_are_read_and_bad_ones_named() {
        let choices = Choices { epochs: Some(7), ..set("extraction.min_order = 3\nmodel.epochs = 9") };
        let made = recipe(&choices, 64).unwrap();
        assert_eq!(made.extraction.min_order, 3);
        assert!(format!("{:?}", made.systems).contains("epochs: 7"), "{:?}", made.systems);
        let refused = |text: &str| recipe(&set(text), 64).err().unwrap().to_string();
        assert!(refused("model.widht = 64").contains("widht"));
        assert!(refused("model.width = 33").contains("33"));
        assert!(refused("detail.stepps = 9").contains("stepps"));
        assert!(refused("detail.width = 33").contains("detail.width is 33"));
        assert!(refused("detail = 9").contains("section"));
        assert!(refused("magic.steps = 9").contains("magic"));
        let unknown = Choices { systems: Some(vec!["magic".to_owned()]), ..Choices::default() };
        assert!(recipe(&unknown, 64).err().unwrap().to_string().contains("allowed: gnn"));
    }

    #[test]
    fn detail_follows_from_what_is_said_about_it() {
        let detail =
            |choices: &Choices, side: usize| recipe(choices, side).map(|r| r.detail.map(|d| d.name()));
        assert_eq!(detail(&Choices::default(), 128).unwrap(), Some("patches"));
        assert_eq!(detail(&Choices::default(), 300).unwrap(), Some("generators"));
        assert_eq!(detail(&set("detail.steps = 9"), 128).unwrap(), Some("generators"));
        let paper = Choices { preset: Preset::Paper, ..Choices::default() };
        assert_eq!(detail(&paper, 128).unwrap(), None);
        assert_eq!(
            detail(&Choices { preset: Preset::Paper, ..set("detail.steps = 9") }, 128).unwrap(),
            Some("generators")
        );
        let named = |name: &str| DetailChoice::Named(name.to_owned());
        let patches = Choices { detail: named("patches"), ..Choices::default() };
        assert!(detail(&patches, 300).unwrap_err().to_string().contains("300x300"));
        let both = Choices { detail: named("patches"), ..set("detail.steps = 9") };
        assert!(detail(&both, 128).unwrap_err().to_string().contains("[detail]"));
        assert_eq!(
            detail(&Choices { detail: DetailChoice::Without, ..Choices::default() }, 128).unwrap(),
            None
        );
        let sparse = |settings: &str| Choices { detail: named("sparse"), ..set(settings) };
        assert_eq!(detail(&sparse("sparse.atoms = 9"), 300).unwrap(), Some("sparse"));
        assert!(
            detail(&sparse("sparse.atoms = 9999"), 300).unwrap_err().to_string().contains("sparse.atoms")
        );
        assert!(detail(&sparse("detail.steps = 9"), 128).unwrap_err().to_string().contains("[detail]"));
        let magic = Choices { detail: named("magic"), ..Choices::default() };
        assert!(detail(&magic, 128).unwrap_err().to_string().contains("allowed: patches, generators"));
    }
}
