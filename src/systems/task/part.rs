//! The card: what a system promises to be part of a style. A new paper implements it in its own folder and is registered in one
//! line of `style::Registry`.

use super::{Exemplar, SketchToTerrain};
use crate::arrays::Arrays;
use crate::checked::{Checked, Settings};
use crate::control::Control;
use crate::dem::Dem;
use crate::error::Result;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;
use std::sync::Arc;

/// What is learned from an exemplar and stored in a style: a coarse system ([`System`]) or a model of detail
/// ([`DetailModel`](super::DetailModel)).
pub trait Part: Debug + Sized + Send + Sync + 'static {
    /// Its name in style files, in configurations and on the command line.
    const NAME: &'static str;
    /// Whether it needs the exemplar's terrain ([`Exemplar::terrain`]) when it is used: the style then stores it, once for all.
    const NEEDS_TERRAIN: bool = false;
    /// Whether learning takes the time that a budget gives it; otherwise it is over when it is over.
    const TAKES_BUDGET: bool = true;
    /// What can be set.
    type Config: Settings;
    /// What a style file says of it beside its arrays.
    type Description: Serialize + DeserializeOwned;

    /// Learns from an exemplar. Everything random comes from the exemplar's seed.
    ///
    /// # Errors
    /// When the exemplar is not enough for it, the training diverges, or is stopped.
    fn learn(exemplar: &Exemplar, config: &Checked<Self::Config>, control: Control<'_>) -> Result<Self>;

    /// The settings that it was learned with.
    fn config(&self) -> &Self::Config;

    /// What learning took and gave, for reports.
    fn account(&self) -> Account {
        Account { text: format!("{} learned", Self::NAME), ..Account::default() }
    }

    /// The description and the arrays.
    ///
    /// # Errors
    /// When a value cannot be read from the tensor library.
    fn save(&self) -> Result<(Self::Description, Arrays)>;

    /// What [`save`](Self::save) came from. `terrain` is the style's, where it has it.
    ///
    /// # Errors
    /// When description and arrays contradict each other, or the terrain is needed and left out.
    fn load(description: Self::Description, arrays: &mut Arrays, terrain: Option<&Arc<Dem>>) -> Result<Self>;
}

/// What learning took and gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Account {
    /// In words, for people.
    pub text: String,
    /// Seconds that it took.
    pub seconds: f64,
    /// Figures by name.
    pub figures: Vec<(&'static str, f64)>,
}

impl Account {
    /// A figure.
    #[must_use]
    pub fn figure(&self, name: &str) -> Option<f64> {
        self.figures.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }
}

/// A part that turns lines into terrain. Heights go in and come out in the unit interval of the exemplar, or of any range that
/// stands for it.
pub trait System: Part + SketchToTerrain {
    /// The ways to use what is learned with these settings, the usual one first.
    #[must_use]
    fn uses(_config: &Self::Config) -> Vec<Use> {
        vec![Use::default()]
    }

    /// One of [`uses`](Self::uses), as a system.
    fn used(self: &Arc<Self>, _suffix: &str) -> Arc<dyn SketchToTerrain> {
        self.clone()
    }

    /// Extractions of the exemplar's lines that it learns from ([`Exemplar::variants`]).
    #[must_use]
    fn extractions(_config: &Self::Config) -> usize {
        1
    }

    /// The settings without their numbers of steps, by which trainings within a budget are told apart.
    #[must_use]
    fn untimed(config: &Self::Config) -> Self::Config {
        config.clone()
    }

    /// The settings for half of the exemplar, on which less is to be learned.
    #[must_use]
    fn for_half(config: &Self::Config) -> Self::Config {
        config.clone()
    }

    /// Whether `terrain`, the exemplar's with what lies around it, is enough for it.
    ///
    /// # Errors
    /// Says what is missing.
    fn check(_config: &Self::Config, _terrain: &Dem) -> Result<()> {
        Ok(())
    }

    /// The share of line cells up to which a drawing is best given to it ([`Method::Auto`](crate::style::Method)); 0 for a system
    /// that wants to be asked for by name.
    #[must_use]
    fn sparse_up_to(_config: &Self::Config) -> f64 {
        0.0
    }

    /// Whether its terrain has all small forms already, so that a style's detail is not added unless asked for.
    #[must_use]
    fn is_complete(_config: &Self::Config) -> bool {
        false
    }

    /// Whether its terrain passes through its lines, so that what it leaves open there is nothing: detail is then measured on
    /// what it makes of terrain that it has not seen.
    #[must_use]
    fn meets_lines(_config: &Self::Config) -> bool {
        false
    }
}

/// A way to use a system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Use {
    /// What is put behind the system's name; empty for the usual way.
    pub suffix: &'static str,
    /// Whether it is also offered with the harmonic correction: it ends beside its lines.
    pub corrected: bool,
}
