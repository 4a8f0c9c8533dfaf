//! The detail of a style as files name it.

use super::{DetailPlan, GeneratorConfig, Registry, generators};
use crate::error::Result;
use serde::{Deserialize, Deserializer, Serialize};
use std::sync::Arc;

/// The word `patches`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Patches {
    /// The exemplar's own patches.
    Patches,
}

/// The detail of a style.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum DetailSpec {
    /// The exemplar's patches.
    Patches(Patches),
    /// Generators, trained with these settings.
    Generators(GeneratorConfig),
}

impl DetailSpec {
    /// The detail, to learn with these settings.
    ///
    /// # Errors
    /// When one is out of range.
    pub(crate) fn plan(&self) -> Result<Arc<dyn DetailPlan>> {
        match self {
            Self::Patches(_) => Registry::default().plan_detail("patches", &toml::Table::new()),
            Self::Generators(settings) => generators(settings.clone()),
        }
    }
}

// Not derived: an untagged enum would not say which key is wrong.
impl<'de> Deserialize<'de> for DetailSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match toml::Value::deserialize(deserializer)? {
            toml::Value::String(name) => match name.as_str() {
                "patches" => Ok(Self::Patches(Patches::Patches)),
                "generators" => Ok(Self::Generators(GeneratorConfig::default())),
                "paper" => Ok(Self::Generators(GeneratorConfig::paper())),
                _ => Err(serde::de::Error::unknown_variant(&name, &["patches", "generators", "paper"])),
            },
            settings => settings.try_into().map(Self::Generators).map_err(serde::de::Error::custom),
        }
    }
}
