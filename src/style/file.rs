//! A style as one `.safetensors` file: everything about it as JSON under the one metadata key [`KEY`], the numbers of each part
//! as tensors behind its name.

use super::learned::Stored;
use super::{LearnedDetail, LearnedSystem, Origin, RegionNetwork, Registry, Style, version1};
use crate::arrays::Arrays;
use crate::dem::{CellSize, Dem};
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use crate::sketch::StrokeKind;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// Metadata key of the style's description.
pub(crate) const KEY: &str = "monadnock";
/// Version of the file format that this program writes. It also reads version 1.
const VERSION: u32 = 2;

/// The description of a style.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    version: u32,
    origin: Origin,
    systems: Vec<PartDescription>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    detail: Option<PartDescription>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    terrain: Option<TerrainDescription>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartDescription {
    name: String,
    description: Value,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainDescription {
    rows: usize,
    cols: usize,
}

impl Style {
    /// Writes the style to a file, all or nothing.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// Never: a description is plain data.
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut arrays = Arrays::default();
        let mut described = |name: &str, stored: Stored| {
            arrays.put_all(&format!("{name}."), stored.arrays);
            PartDescription { name: name.to_owned(), description: stored.description }
        };
        let mut systems = Vec::new();
        for system in &self.coarse {
            systems.push(described(system.name(), system.stored()?));
        }
        let detail = match &self.detail {
            Some(detail) => Some(described(detail.name(), detail.stored()?)),
            None => None,
        };
        let terrain = self.terrain.as_ref().filter(|_| self.needs_terrain()).map(|dem| {
            let (rows, cols) = dem.shape();
            let valid: Vec<u8> = dem.valid().as_slice().iter().map(|ok| u8::from(*ok)).collect();
            arrays.put_f32("terrain.heights", &[rows, cols], dem.heights().as_slice());
            arrays.put_u8("terrain.valid", &[rows, cols], &valid);
            TerrainDescription { rows, cols }
        });
        let origin = self.origin.clone();
        let description = Description { version: VERSION, origin, systems, detail, terrain };
        let text = serde_json::to_string(&description).expect("a description is plain data");
        arrays.write(path, KEY, text)
    }

    /// Whether a part needs the exemplar's terrain.
    #[must_use]
    pub fn needs_terrain(&self) -> bool {
        let of_detail = self.detail.as_ref().is_some_and(|detail| detail.needs_terrain());
        of_detail || self.coarse.iter().any(|system| system.needs_terrain())
    }

    /// Reads a style of the systems that come with the program.
    ///
    /// # Errors
    /// As [`Registry::load`].
    pub fn load(path: &Path) -> Result<Self> {
        Registry::default().load(path)
    }

    /// What the style says of itself, for people and programs; its numbers are counted.
    ///
    /// # Errors
    /// When a part cannot be described.
    pub fn describe(&self) -> Result<Value> {
        let mut value = serde_json::to_value(&self.origin).map_err(not_plain)?;
        value["version"] = VERSION.into();
        value["systems"] = self.coarse.iter().map(|system| system.name()).collect();
        for system in &self.coarse {
            value[system.name()] = system.stored()?.description;
        }
        if let Some(network) = self.system::<RegionNetwork>() {
            let parts = network.model().parts();
            let ridges = parts.iter().filter(|part| part.kind == StrokeKind::Ridge).count();
            value["config"] = serde_json::to_value(self.config()).map_err(not_plain)?;
            value["training"] = serde_json::to_value(network.training()).map_err(not_plain)?;
            value["parameters"] = network.model().network().params().value_count().into();
            value["parts"] = json!({ "ridge": ridges, "valley": parts.len() - ridges });
        }
        if let Some(detail) = &self.detail {
            value["detail"] = detail.stored()?.description;
            value["detail"]["system"] = detail.name().into();
        }
        Ok(value)
    }
}

fn not_plain(error: serde_json::Error) -> Error {
    Error::value("description of the style", error, "it must be plain data")
}

impl Registry {
    /// Reads a style of these systems.
    ///
    /// # Errors
    /// When the file is not a style, is damaged, was written by a newer program, or holds a system that is not known here.
    pub fn load(&self, path: &Path) -> Result<Style> {
        let (text, arrays) = Arrays::read(path, KEY, "a style")?;
        self.read(path, &text, arrays).map_err(|e| e.in_file(path))
    }

    fn read(&self, path: &Path, text: &str, mut arrays: Arrays) -> Result<Style> {
        let field = |e: serde_json::Error| {
            let allowed = format!("allowed: what version {VERSION} writes");
            Error::file(path, format!("metadata {KEY}"), e, allowed)
        };
        let mut value: Value = serde_json::from_str(text).map_err(field)?;
        let version = value.get("version").and_then(Value::as_u64);
        if version == Some(1) {
            value = version1::upgraded(value, &mut arrays).map_err(field)?;
        } else if version != Some(u64::from(VERSION)) {
            let found = version.map_or_else(|| "missing".to_owned(), |v| v.to_string());
            let allowed = format!("this program reads versions 1 and {VERSION}");
            return Err(Error::file(path, "format version", found, allowed));
        }
        let Description { origin, systems, detail, terrain, .. } =
            serde_json::from_value(value).map_err(field)?;
        let terrain = terrain
            .map(|shape| {
                let heights = arrays.take_f32("terrain.heights")?;
                let heights = Grid::from_vec(shape.rows, shape.cols, heights)?;
                let valid: Vec<bool> = arrays.take_u8("terrain.valid")?.iter().map(|v| *v != 0).collect();
                let [x, y] = origin.exemplar.cell_size;
                let valid = Mask::from_vec(shape.rows, shape.cols, valid)?;
                Dem::with_voids(heights, valid, CellSize::new(x, y)?).map(Arc::new)
            })
            .transpose()?;
        let mut stored = |part: &PartDescription| Stored {
            description: part.description.clone(),
            arrays: arrays.take_all(&format!("{}.", part.name)),
        };
        let coarse: Vec<Arc<dyn LearnedSystem>> = systems
            .iter()
            .map(|part| self.load_system(&part.name, stored(part), terrain.as_ref()))
            .collect::<Result<_>>()?;
        if coarse.is_empty() {
            return Err(Error::value("number of systems of the style", 0, "allowed: at least one"));
        }
        let detail: Option<Arc<dyn LearnedDetail>> =
            detail.map(|part| self.load_detail(&part.name, stored(&part), terrain.as_ref())).transpose()?;
        arrays.finish()?;
        origin.extraction.validate()?;
        Ok(Style { origin, coarse, detail, terrain })
    }
}
