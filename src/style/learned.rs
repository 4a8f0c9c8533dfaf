//! Parts of a style without their types: what a [`Registry`](super::Registry) and a [`Style`](super::Style) hold of any system
//! that keeps the promise of [`Part`]. Every system has these traits for free.

use crate::arrays::Arrays;
use crate::checked::Checked;
use crate::control::Control;
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::systems::task::{Account, DetailModel, Exemplar, Part, SketchToTerrain, System, Use};
use serde_json::Value;
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

/// A part as it is stored.
#[derive(Clone, Debug)]
pub struct Stored {
    /// What it says of itself.
    pub(crate) description: Value,
    /// Its numbers.
    pub(crate) arrays: Arrays,
}

/// A coarse system that has learned.
pub trait LearnedSystem: SketchToTerrain + Debug + Any {
    /// Its name.
    fn name(&self) -> &'static str;

    /// Every way to use it, the usual one first.
    fn all_uses(self: Arc<Self>) -> Vec<(Use, Arc<dyn SketchToTerrain>)>;

    /// Whether the style stores the exemplar's terrain for it.
    fn needs_terrain(&self) -> bool;

    /// As [`System::sparse_up_to`].
    fn sparse_up_to(&self) -> f64;

    /// As [`System::is_complete`].
    fn is_complete(&self) -> bool;

    /// What learning took and gave.
    fn account(&self) -> Account;

    /// The part as it is stored.
    ///
    /// # Errors
    /// As [`Part::save`].
    fn stored(&self) -> Result<Stored>;
}

impl<S: System> LearnedSystem for S {
    fn name(&self) -> &'static str {
        S::NAME
    }

    fn all_uses(self: Arc<Self>) -> Vec<(Use, Arc<dyn SketchToTerrain>)> {
        S::uses(self.config()).into_iter().map(|way| (way, self.used(way.suffix))).collect()
    }

    fn needs_terrain(&self) -> bool {
        S::NEEDS_TERRAIN
    }

    fn sparse_up_to(&self) -> f64 {
        S::sparse_up_to(self.config())
    }

    fn is_complete(&self) -> bool {
        S::is_complete(self.config())
    }

    fn account(&self) -> Account {
        Part::account(self)
    }

    fn stored(&self) -> Result<Stored> {
        stored(self)
    }
}

/// A model of detail that has learned.
pub trait LearnedDetail: DetailModel + Debug + Any {
    /// Its name.
    fn name(&self) -> &'static str;

    /// Whether the style stores the exemplar's terrain for it.
    fn needs_terrain(&self) -> bool;

    /// What learning took and gave.
    fn account(&self) -> Account;

    /// The part as it is stored.
    ///
    /// # Errors
    /// As [`Part::save`].
    fn stored(&self) -> Result<Stored>;
}

impl<D: Part + DetailModel> LearnedDetail for D {
    fn name(&self) -> &'static str {
        D::NAME
    }

    fn needs_terrain(&self) -> bool {
        D::NEEDS_TERRAIN
    }

    fn account(&self) -> Account {
        Part::account(self)
    }

    fn stored(&self) -> Result<Stored> {
        stored(self)
    }
}

fn stored<P: Part>(part: &P) -> Result<Stored> {
    let (description, arrays) = part.save()?;
    let plain = |e| Error::value(format!("description of {}", P::NAME), e, "it must be plain data");
    Ok(Stored { description: serde_json::to_value(description).map_err(plain)?, arrays })
}

/// The part that was stored; every array must belong to it.
pub(super) fn loaded<P: Part>(stored: Stored, terrain: Option<&Arc<Dem>>) -> Result<Arc<P>> {
    let described =
        |e| Error::value(format!("description of {}", P::NAME), e, "allowed: what `train` writes");
    let description = serde_json::from_value(stored.description).map_err(described)?;
    let mut arrays = stored.arrays;
    let part = P::load(description, &mut arrays, terrain)?;
    arrays.finish()?;
    Ok(Arc::new(part))
}

/// A coarse system that is to learn, with its settings.
pub trait SystemPlan: Debug + Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// As [`System::uses`].
    fn uses(&self) -> Vec<Use>;

    /// As [`System::extractions`].
    fn extractions(&self) -> usize;

    /// As [`System::meets_lines`].
    fn meets_lines(&self) -> bool;

    /// Whether the style stores the exemplar's terrain for it.
    fn needs_terrain(&self) -> bool;

    /// As [`System::check`].
    ///
    /// # Errors
    /// As there.
    fn check(&self, terrain: &Dem) -> Result<()>;

    /// As [`System::is_complete`].
    fn is_complete(&self) -> bool;

    /// The plan for half of the exemplar: [`System::for_half`].
    fn halved(&self) -> Arc<dyn SystemPlan>;

    /// As [`Part::TAKES_BUDGET`].
    fn takes_budget(&self) -> bool;

    /// Whether something with this plan has learned what is there, as far as settings say; where that was `timed` by a budget,
    /// whatever its number of steps.
    fn made(&self, system: &dyn LearnedSystem, timed: bool) -> bool;

    /// As [`Part::learn`].
    ///
    /// # Errors
    /// As there.
    fn learn(&self, exemplar: &Exemplar, control: Control<'_>) -> Result<Arc<dyn LearnedSystem>>;
}

/// A model of detail that is to learn, with its settings.
pub trait DetailPlan: Debug + Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// As [`Part::TAKES_BUDGET`].
    fn takes_budget(&self) -> bool;

    /// As [`Part::learn`].
    ///
    /// # Errors
    /// As there.
    fn learn(&self, exemplar: &Exemplar, control: Control<'_>) -> Result<Arc<dyn LearnedDetail>>;
}

/// A part with its settings.
#[derive(Debug)]
pub(super) struct Planned<P: Part>(pub(super) Checked<P::Config>);

impl<S: System> SystemPlan for Planned<S> {
    fn name(&self) -> &'static str {
        S::NAME
    }

    fn uses(&self) -> Vec<Use> {
        S::uses(&self.0)
    }

    fn extractions(&self) -> usize {
        S::extractions(&self.0)
    }

    fn meets_lines(&self) -> bool {
        S::meets_lines(&self.0)
    }

    fn needs_terrain(&self) -> bool {
        S::NEEDS_TERRAIN
    }

    fn check(&self, terrain: &Dem) -> Result<()> {
        S::check(&self.0, terrain)
    }

    fn is_complete(&self) -> bool {
        S::is_complete(&self.0)
    }

    fn halved(&self) -> Arc<dyn SystemPlan> {
        // Less of the same: in range where this is.
        let half = Checked::new(S::for_half(&self.0)).unwrap_or_else(|_| self.0.clone());
        Arc::new(Self(half))
    }

    fn takes_budget(&self) -> bool {
        S::TAKES_BUDGET
    }

    fn made(&self, system: &dyn LearnedSystem, timed: bool) -> bool {
        let any: &dyn Any = system;
        any.downcast_ref::<S>().is_some_and(|system| {
            if timed {
                S::untimed(system.config()) == S::untimed(&self.0)
            } else {
                system.config() == &*self.0
            }
        })
    }

    fn learn(&self, exemplar: &Exemplar, control: Control<'_>) -> Result<Arc<dyn LearnedSystem>> {
        Ok(Arc::new(S::learn(exemplar, &self.0, control)?))
    }
}

impl<D: Part + DetailModel> DetailPlan for Planned<D> {
    fn name(&self) -> &'static str {
        D::NAME
    }

    fn takes_budget(&self) -> bool {
        D::TAKES_BUDGET
    }

    fn learn(&self, exemplar: &Exemplar, control: Control<'_>) -> Result<Arc<dyn LearnedDetail>> {
        Ok(Arc::new(D::learn(exemplar, &self.0, control)?))
    }
}

/// The plan of a system with these settings.
///
/// # Errors
/// When one is out of range.
pub(crate) fn system_plan<S: System>(settings: S::Config) -> Result<Arc<dyn SystemPlan>> {
    Ok(Arc::new(Planned::<S>(Checked::new(settings)?)))
}

/// The plan of a model of detail with these settings.
///
/// # Errors
/// When one is out of range.
pub(crate) fn detail_plan<D: Part + DetailModel>(settings: D::Config) -> Result<Arc<dyn DetailPlan>> {
    Ok(Arc::new(Planned::<D>(Checked::new(settings)?)))
}
