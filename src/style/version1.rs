//! Style files of version 1, which held the region network and at most one model of detail.

use crate::arrays::Arrays;
use serde::Deserialize;
use serde_json::{Map, Value, json};

/// What version 1 says of a style.
#[derive(Deserialize)]
struct Description {
    config: Config,
    seed: Value,
    normalization: Value,
    exemplar: Value,
    #[serde(default)]
    mean_slope: Option<f64>,
    training: Value,
    #[serde(default)]
    detail: Option<Map<String, Value>>,
}

#[derive(Deserialize)]
struct Config {
    extraction: Value,
    model: Value,
    generation: Value,
}

/// The description as version 2 has it; the arrays get the names that it uses.
///
/// # Errors
/// When the description is not one of version 1.
pub(super) fn upgraded(value: Value, arrays: &mut Arrays) -> serde_json::Result<Value> {
    let old: Description = serde_json::from_value(value)?;
    for kind in ["weights.", "parts."] {
        let part = arrays.take_all(kind);
        arrays.put_all(&format!("gnn.{kind}"), part);
    }
    let Config { extraction, model, generation } = old.config;
    let network = json!({ "config": { "model": model, "generation": generation }, "training": old.training });
    let mut new = json!({
        "version": 2,
        "origin": {
            "seed": old.seed,
            "normalization": old.normalization,
            "exemplar": old.exemplar,
            "mean_slope": old.mean_slope,
            "extraction": extraction,
        },
        "systems": [{ "name": "gnn", "description": network }],
    });
    if let Some(mut detail) = old.detail {
        // Only patches named their model: generators came first.
        let name = if detail.remove("model").is_some() { "patches" } else { "generators" };
        let part = arrays.take_all("detail.");
        arrays.put_all(&format!("{name}."), part);
        new["detail"] = json!({ "name": name, "description": detail });
    }
    Ok(new)
}
