//! Every system by name. A new one is one line in [`Registry::default`]; programs of others add theirs to it.

use super::learned::{DetailPlan, LearnedDetail, LearnedSystem, Planned, Stored, SystemPlan, loaded};
use super::{Style, config};
use crate::checked::Checked;
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::systems::classical;
use crate::systems::gpnn::PatchDetail;
use crate::systems::landscape::LandscapeSystem;
use crate::systems::region_gnn::RegionNetwork;
use crate::systems::singan::Detail;
use crate::systems::sparse::SparseDetail;
use crate::systems::synthesis::SynthesisSystem;
use crate::systems::task::{DetailModel, Part, SketchToTerrain, System};
use std::sync::Arc;

/// A system, or a way to use one, and its name.
pub type Named = (String, Arc<dyn SketchToTerrain>);

/// The systems that styles can be made of, and the interpolators beside them.
#[derive(Clone)]
pub struct Registry {
    systems: Vec<Entry<dyn SystemPlan, dyn LearnedSystem>>,
    details: Vec<Entry<dyn DetailPlan, dyn LearnedDetail>>,
    interpolators: Vec<Named>,
}

struct Entry<P: ?Sized, L: ?Sized> {
    name: &'static str,
    plan: fn(&toml::Table) -> Result<Arc<P>>,
    load: Load<L>,
}

type Load<L> = fn(Stored, Option<&Arc<Dem>>) -> Result<Arc<L>>;

impl<P: ?Sized, L: ?Sized> Clone for Entry<P, L> {
    fn clone(&self) -> Self {
        Self { ..*self }
    }
}

impl Default for Registry {
    /// All that come with the program.
    fn default() -> Self {
        let interpolators = classical::all().into_iter().map(|(name, system)| (name.to_owned(), system));
        Self { systems: Vec::new(), details: Vec::new(), interpolators: interpolators.collect() }
            .system::<RegionNetwork>()
            .system::<LandscapeSystem>()
            .system::<SynthesisSystem>()
            .detail::<PatchDetail>()
            .detail::<Detail>()
            .detail::<SparseDetail>()
    }
}

impl Registry {
    /// Adds a coarse system.
    ///
    /// # Panics
    /// When its name is taken.
    #[must_use]
    pub fn system<S: System>(mut self) -> Self {
        assert!(!self.names().contains(&S::NAME), "system {} exists", S::NAME);
        self.systems.push(Entry {
            name: S::NAME,
            plan: |over| Ok(Arc::new(Planned::<S>(settings::<S>(over)?))),
            load: |stored, terrain| Ok(loaded::<S>(stored, terrain)?),
        });
        self
    }

    /// Adds a model of detail.
    ///
    /// # Panics
    /// When its name is taken.
    #[must_use]
    pub fn detail<D: Part + DetailModel>(mut self) -> Self {
        assert!(!self.names().contains(&D::NAME), "system {} exists", D::NAME);
        self.details.push(Entry {
            name: D::NAME,
            plan: |over| Ok(Arc::new(Planned::<D>(settings::<D>(over)?))),
            load: |stored, terrain| Ok(loaded::<D>(stored, terrain)?),
        });
        self
    }

    /// The names of all that learns: coarse systems first, then models of detail.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.systems.iter().map(|e| e.name).chain(self.details.iter().map(|e| e.name)).collect()
    }

    /// The names of the coarse systems.
    #[must_use]
    pub fn system_names(&self) -> Vec<&'static str> {
        self.systems.iter().map(|e| e.name).collect()
    }

    /// The coarse system of that name, to learn with its default settings under those of `over`.
    ///
    /// # Errors
    /// When there is no such system, or a setting is unknown or out of range.
    pub fn plan(&self, name: &str, over: &toml::Table) -> Result<Arc<dyn SystemPlan>> {
        (entry(&self.systems, name, "system")?.plan)(over)
    }

    /// The model of detail of that name, as [`plan`](Self::plan).
    ///
    /// # Errors
    /// As there.
    pub fn plan_detail(&self, name: &str, over: &toml::Table) -> Result<Arc<dyn DetailPlan>> {
        (entry(&self.details, name, "detail")?.plan)(over)
    }

    pub(super) fn load_system(
        &self,
        name: &str,
        stored: Stored,
        terrain: Option<&Arc<Dem>>,
    ) -> Result<Arc<dyn LearnedSystem>> {
        (entry(&self.systems, name, "system of the style")?.load)(stored, terrain)
    }

    pub(super) fn load_detail(
        &self,
        name: &str,
        stored: Stored,
        terrain: Option<&Arc<Dem>>,
    ) -> Result<Arc<dyn LearnedDetail>> {
        (entry(&self.details, name, "detail of the style")?.load)(stored, terrain)
    }

    /// What learns nothing: every interpolator.
    #[must_use]
    pub fn interpolators(&self) -> &[Named] {
        &self.interpolators
    }

    /// Whether something called `name` in [`all`](Self::all) has learned, and is no interpolator.
    #[must_use]
    pub fn has_learned(&self, name: &str) -> bool {
        !self.interpolators.iter().any(|(known, _)| known == name)
    }

    /// Every way to use a style, then every interpolator.
    #[must_use]
    pub fn all(&self, style: &Style) -> Vec<Named> {
        let mut systems = style.uses();
        systems.extend(self.interpolators.iter().cloned());
        systems
    }

    /// Those of [`all`](Self::all) whose names stand in `wanted`, separated by commas; `all` for every one. A name that ends at a `-`
    /// or `+` of longer ones takes them all: `gnn` is every way to use the network.
    ///
    /// # Errors
    /// When a name fits no system.
    pub fn select(&self, style: &Style, wanted: &str) -> Result<Vec<Named>> {
        let systems = self.all(style);
        if wanted == "all" {
            return Ok(systems);
        }
        let fits = |name: &str, wanted: &str| {
            name == wanted || name.strip_prefix(wanted).is_some_and(|rest| rest.starts_with(['-', '+']))
        };
        let wanted: Vec<&str> = wanted.split(',').map(str::trim).collect();
        for w in &wanted {
            if !systems.iter().any(|(name, _)| fits(name, w)) {
                let names: Vec<&str> = systems.iter().map(|(name, _)| name.as_str()).collect();
                return Err(Error::value("system", w, format!("allowed: all, {}", names.join(", "))));
            }
        }
        Ok(systems.into_iter().filter(|(name, _)| wanted.iter().any(|w| fits(name, w))).collect())
    }
}

/// The default settings of a part under those of `over`.
fn settings<P: Part>(over: &toml::Table) -> Result<Checked<P::Config>> {
    Checked::new(config::overlaid(&P::Config::default(), [over], &format!("configuration of {}", P::NAME))?)
}

fn entry<'a, P: ?Sized, L: ?Sized>(
    entries: &'a [Entry<P, L>],
    name: &str,
    what: &str,
) -> Result<&'a Entry<P, L>> {
    entries.iter().find(|entry| entry.name == name).ok_or_else(|| {
        let known: Vec<&str> = entries.iter().map(|entry| entry.name).collect();
        Error::value(what, name, format!("allowed: {}", known.join(", ")))
    })
}
