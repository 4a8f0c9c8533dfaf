//! The nodes of a tree as they are written: primitives and operators (Guérin et al. 2016, 4.1; Génevaux et al. 2015).

use super::noise::{NoiseKind, OCTAVES};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// A sub-tree. Places are metres east and south of the terrain's north-west corner, heights metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Node {
    /// Terrain as sparse primitives on a regular grid; its numbers are in the file beside the text, under this name.
    Sparse {
        /// The name.
        field: String,
    },
    /// A plane, everywhere.
    Plane {
        /// Height at the corner.
        height: f64,
        /// Metres it rises a metre east and a metre south.
        #[serde(default)]
        slope: [f64; 2],
    },
    /// Noise, everywhere.
    Noise {
        /// Which.
        noise: NoiseKind,
        /// Wavelength of its largest octave.
        wavelength: f64,
        /// Height that it is multiplied with.
        amplitude: f64,
        /// Number of octaves.
        octaves: usize,
        /// Which draw.
        seed: u32,
        /// Height of its zero.
        #[serde(default)]
        height: f64,
    },
    /// A level disc that fades towards its rim.
    Disc {
        /// Where.
        centre: [f64; 2],
        /// Where its weight ends.
        radius: f64,
        /// Its height.
        height: f64,
    },
    /// A river, a valley or a ridge: a cross-section along a line.
    Curve {
        /// Points of the line: east, south, height.
        points: Vec<[f64; 3]>,
        /// Points of the cross-section: distance from the line, height over it; distances rise.
        section: Vec<[f64; 2]>,
        /// Distance at which its weight ends; it is whole up to the section's last distance.
        reach: f64,
    },
    /// The mean of all, by their weights.
    Blend {
        /// What is blended.
        of: Vec<Node>,
    },
    /// One takes the place of the other where it has weight.
    Replace(Pair),
    /// Terrain is lowered to the other where that is lower.
    Carve(Pair),
    /// The other is added to it.
    Add(Pair),
}

/// What a binary operator works on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pair {
    /// How strong: 0 not at all, 1 whole.
    #[serde(default = "whole")]
    pub(crate) weight: f64,
    /// The terrain.
    pub(crate) terrain: Box<Node>,
    /// What is done to it.
    pub(crate) by: Box<Node>,
}

const fn whole() -> f64 {
    1.0
}

impl Node {
    /// Checks every number; `fields` are the names of sparse primitives that are there. `path` is where the node stands.
    ///
    /// # Errors
    /// Names the first number that is out of range.
    pub(super) fn validate(&self, fields: &dyn Fn(&str) -> bool, path: &str) -> Result<()> {
        let bad = |name: &str, value: &dyn std::fmt::Display, allowed: &str| {
            Err(Error::value(format!("{path}.{name}"), value, format!("allowed: {allowed}")))
        };
        let finite = |name: &str, values: &[f64]| match values.iter().find(|v| !v.is_finite()) {
            Some(v) => bad(name, v, "finite"),
            None => Ok(()),
        };
        let above = |name: &str, value: f64| {
            if value > 0.0 && value.is_finite() { Ok(()) } else { bad(name, &value, "finite, above 0") }
        };
        match self {
            Self::Sparse { field } if fields(field) => Ok(()),
            Self::Sparse { field } => bad("field", field, "a name in the file of numbers"),
            Self::Plane { height, slope } => {
                finite("height", &[*height])?;
                finite("slope", slope)
            }
            Self::Noise { wavelength, amplitude, octaves, height, .. } => {
                above("wavelength", *wavelength)?;
                finite("amplitude", &[*amplitude])?;
                finite("height", &[*height])?;
                if (1..=2 * OCTAVES).contains(octaves) { Ok(()) } else { bad("octaves", octaves, "1 to 16") }
            }
            Self::Disc { centre, radius, height } => {
                finite("centre", centre)?;
                finite("height", &[*height])?;
                above("radius", *radius)
            }
            Self::Curve { points, section, reach } => {
                finite("points", points.as_flattened())?;
                finite("section", section.as_flattened())?;
                above("reach", *reach)?;
                if points.len() < 2 {
                    return bad("points", &points.len(), "at least 2");
                }
                let rises = section.windows(2).all(|w| w[0][0] < w[1][0]);
                match (section.first(), section.last()) {
                    (Some(first), Some(last)) if rises && first[0] >= 0.0 && last[0] <= *reach => Ok(()),
                    _ => bad("section", &format!("{section:?}"), "distances from 0 to the reach that rise"),
                }
            }
            Self::Blend { of } => {
                if of.is_empty() {
                    return bad("of", &0, "at least one node");
                }
                of.iter()
                    .enumerate()
                    .try_for_each(|(i, node)| node.validate(fields, &format!("{path}.of[{i}]")))
            }
            Self::Replace(pair) | Self::Carve(pair) | Self::Add(pair) => {
                if !(0.0..=1.0).contains(&pair.weight) {
                    return bad("weight", &pair.weight, "0 to 1");
                }
                pair.terrain.validate(fields, &format!("{path}.terrain"))?;
                pair.by.validate(fields, &format!("{path}.by"))
            }
        }
    }

    /// The nodes below it.
    pub(crate) fn children(&self) -> Vec<&Self> {
        match self {
            Self::Blend { of } => of.iter().collect(),
            Self::Replace(pair) | Self::Carve(pair) | Self::Add(pair) => vec![&pair.terrain, &pair.by],
            _ => Vec::new(),
        }
    }

    /// What it is called in files.
    pub(crate) const fn kind(&self) -> &'static str {
        match self {
            Self::Sparse { .. } => "sparse",
            Self::Plane { .. } => "plane",
            Self::Noise { .. } => "noise",
            Self::Disc { .. } => "disc",
            Self::Curve { .. } => "curve",
            Self::Blend { .. } => "blend",
            Self::Replace(_) => "replace",
            Self::Carve(_) => "carve",
            Self::Add(_) => "add",
        }
    }
}
