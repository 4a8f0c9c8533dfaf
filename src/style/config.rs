//! Settings of a style as one table: what a configuration file, `--set` and experiments lay over each other.

use super::learned::{DetailPlan, SystemPlan, detail_plan, system_plan};
use crate::checked::Settings;
use crate::error::{Error, Result};
use crate::extract::ExtractionConfig;
use crate::systems::region_gnn::{
    GenerationConfig, Preset, RegionGnnConfig, RegionNetwork, RegionNetworkConfig,
};
use crate::systems::singan::{Detail, DetailConfig as GeneratorConfig};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How lines are found, and the network: the sections `[extraction]`, `[model]` and `[generation]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StyleConfig {
    /// How lines are found.
    pub extraction: ExtractionConfig,
    /// The network and its training.
    pub model: RegionGnnConfig,
    /// What happens around the network when terrain is generated.
    pub generation: GenerationConfig,
}

impl StyleConfig {
    /// A named configuration.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        Self { model: RegionGnnConfig::preset(preset), ..Self::default() }
    }

    /// The network, to learn with these settings.
    ///
    /// # Errors
    /// When one is out of range.
    pub fn plan(&self) -> Result<Arc<dyn SystemPlan>> {
        system_plan::<RegionNetwork>(self.network())
    }

    /// The settings of the network.
    #[must_use]
    pub fn network(&self) -> RegionNetworkConfig {
        RegionNetworkConfig { model: self.model.clone(), generation: self.generation.clone() }
    }
}

impl Settings for StyleConfig {
    fn validate(&self) -> Result<()> {
        self.extraction.validate()?;
        self.network().validate()
    }
}

/// Detail from generators, to learn with these settings.
///
/// # Errors
/// When one is out of range.
pub fn generators(settings: GeneratorConfig) -> Result<Arc<dyn DetailPlan>> {
    detail_plan::<Detail>(settings)
}

/// Puts `over` on `table`, section by section.
pub(crate) fn overlay(table: &mut toml::Table, over: &toml::Table) {
    for (key, value) in over {
        match (table.get_mut(key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => overlay(below, above),
            (_, value) => {
                table.insert(key.clone(), value.clone());
            }
        }
    }
}

/// `base` with every table of `over` laid on it in turn, checked at the end. `what` names the settings in messages.
///
/// # Errors
/// When a key is unknown, or a value is of the wrong kind or out of range.
pub(crate) fn overlaid<'a, C: Settings>(
    base: &C,
    over: impl IntoIterator<Item = &'a toml::Table>,
    what: &str,
) -> Result<C> {
    let mut table = match toml::Table::try_from(base) {
        Ok(table) => table,
        Err(e) => return Err(Error::value(what, e, "a preset must be plain data")),
    };
    over.into_iter().for_each(|over| overlay(&mut table, over));
    let config: C = table.try_into().map_err(|e: toml::de::Error| {
        Error::value(what, e.message(), "see `monadnock info STYLE --json` for all keys")
    })?;
    config.validate()?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::region_gnn::config::Base;

    #[test]
    fn later_tables_win_key_by_key() {
        let table = |text: &str| text.parse::<toml::Table>().unwrap();
        let over =
            [table("model.width = 16\nmodel.epochs = 9"), table("model.epochs = 7\nmodel.base = 'laplace'")];
        let config = overlaid(&StyleConfig::default(), &over, "configuration").unwrap();
        assert_eq!((config.model.width, config.model.epochs, config.model.base), (16, 7, Base::Laplace));
        assert_eq!(config.extraction, StyleConfig::default().extraction);
        let refused = |text: &str| {
            overlaid(&StyleConfig::default(), [&table(text)], "configuration").unwrap_err().to_string()
        };
        assert!(refused("model.widht = 16").contains("widht"));
        assert!(refused("model.width = 17").contains("17"));
        assert!(refused("model = 3").contains("configuration"));
    }
}
