//! Configurations laid over each other: a preset, then a file, then single keys.

use crate::error::{Error, Result};
use crate::systems::region_gnn::StyleConfig;

/// Puts `over` on `table`, section by section.
pub fn overlay(table: &mut toml::Table, over: &toml::Table) {
    for (key, value) in over {
        match (table.get_mut(key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => overlay(below, above),
            (_, value) => {
                table.insert(key.clone(), value.clone());
            }
        }
    }
}

/// `base` with every table of `over` laid on it in turn, each being checked.
///
/// # Errors
/// When a key is unknown, or a value is of the wrong kind or out of range.
pub fn style_config<'a>(
    base: &StyleConfig,
    over: impl IntoIterator<Item = &'a toml::Table>,
) -> Result<StyleConfig> {
    let mut table = match toml::Table::try_from(base) {
        Ok(table) => table,
        Err(e) => return Err(Error::value("configuration", e, "a preset must be plain data")),
    };
    over.into_iter().for_each(|over| overlay(&mut table, over));
    let config: StyleConfig = table.try_into().map_err(|e: toml::de::Error| {
        Error::value("configuration", e.message(), "see `monadnock info STYLE --json` for all keys")
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
        let config = style_config(&StyleConfig::default(), &over).unwrap();
        assert_eq!((config.model.width, config.model.epochs, config.model.base), (16, 7, Base::Laplace));
        assert_eq!(config.extraction, StyleConfig::default().extraction);
        let refused =
            |text: &str| style_config(&StyleConfig::default(), [&table(text)]).unwrap_err().to_string();
        assert!(refused("model.widht = 16").contains("widht"));
        assert!(refused("model.width = 17").contains("17"));
        assert!(refused("model = 3").contains("configuration"));
    }
}
