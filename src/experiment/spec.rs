//! An experiment as a data file: what is asked, what is compared on what, and what the answer should be.
//!
//! `docs/experiments.md` describes the format for those who write one. A file that was resolved
//! ([`resolve`](super::resolve::resolve)) is one too, with nothing left open.

use crate::checked::Settings;
use crate::error::{Error, Result};
use crate::extract::ExtractionConfig;
use crate::file;
use crate::metrics::Scores;
use crate::style::{self, DetailPlan, GeneratorConfig, Preset, Registry, StyleConfig, generators, overlaid};
use crate::systems::task::RandomHeights;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;
use std::sync::Arc;

/// The largest file that is read as an experiment, bytes.
const LARGEST: u64 = 1 << 22;

/// What is done with the trained styles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Every test patch is rebuilt from its lines by every system (Liu & Benes 2025, 7.2: Figs. 8, 9, Table 1).
    Neighbours,
    /// Every exemplar is rebuilt by the style that learned it (Table B1).
    Fit,
    /// As `neighbours`, from ever thinner sketches.
    Sparse,
    /// As `neighbours`, with variations of one style against a baseline.
    Ablation,
    /// As `neighbours`, with every patch of an area as the exemplar in turn.
    Exemplar,
    /// As `neighbours`, with each area's style on the patches of all areas (Fig. 6).
    Exchange,
    /// Drawings without a truth, in several variants (Figs. 7, 20).
    Drawings,
    /// The same lines turned, mirrored and shifted (Fig. 15).
    Invariance,
    /// The states of ridge and valley regions after message passing (Fig. 13).
    Disentanglement,
    /// As `neighbours`, with the seconds of each stage (section 7).
    Cost,
}

impl Kind {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Neighbours => "neighbours",
            Self::Fit => "fit",
            Self::Sparse => "sparse",
            Self::Ablation => "ablation",
            Self::Exemplar => "exemplar",
            Self::Exchange => "exchange",
            Self::Drawings => "drawings",
            Self::Invariance => "invariance",
            Self::Disentanglement => "disentanglement",
            Self::Cost => "cost",
        }
    }

    /// Whether a patch is rebuilt and scored against its truth.
    #[must_use]
    pub fn has_truth(self) -> bool {
        !matches!(self, Self::Drawings | Self::Invariance | Self::Disentanglement)
    }
}

/// An experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentSpec {
    /// What is done.
    pub kind: Kind,
    /// One line.
    pub title: String,
    /// What the experiment is to answer.
    pub question: String,
    /// What the results say, written after a run.
    #[serde(default)]
    pub analysis: String,
    /// Seeds of training and generation; each gives its own rows.
    pub seeds: Vec<u64>,
    /// How long all of it may take on the machine that it is meant for.
    pub budget_minutes: f64,
    /// Scores that tables and plots show, by their names in `scores.csv`, the most important first.
    #[serde(default = "main_metrics")]
    pub metrics: Vec<String>,
    /// Patches an area of which pictures are kept: the worst and the best in turn.
    #[serde(default)]
    pub pictures: usize,
    /// Interpolators beside the styles: names, or `all` alone.
    #[serde(default)]
    pub interpolators: Vec<String>,
    /// The system that bounds, pictures and plots are about; the first style's first one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub highlight: Option<String>,
    /// Ablation: the system that the others are compared with; the highlighted one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<String>,
    /// At most so many test patches an area, the nearest to the exemplar.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patches_per_area: Option<usize>,
    /// How lines of patches are found, and what the styles' own extraction begins with.
    #[serde(default)]
    pub extraction: ExtractionConfig,
    /// Sections of the style configuration ([`StyleConfig`]) that all styles share.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub overrides: toml::Table,
    /// The styles.
    pub style: Vec<StyleSpec>,
    /// The areas with their exemplars.
    pub area: Vec<AreaSpec>,
    /// The sketches that the systems are given of each patch; one with the lines of `extraction` when none is named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sketch: Vec<SketchSpec>,
    /// What the results should be.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bound: Vec<Bound>,
    /// Numbers that others printed, to stand beside ours.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub printed: Vec<Printed>,
}

/// A style that is trained for every area and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StyleSpec {
    /// Stands for `gnn` in the names of its systems: `gnn-aligned` of the style `paper` is `paper-aligned`.
    pub name: String,
    /// Ways to use the style, by their names in the registry; all of them when none is named.
    #[serde(default)]
    pub systems: Vec<String>,
    /// The configuration to begin with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Sections of the configuration that differ from the preset and the common overrides.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub set: toml::Table,
    /// The whole configuration instead of preset, overrides and set: what a resolved file has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub config: Option<StyleConfig>,
    /// Also has detail: `"patches"`, `"generators"` (the usual ones), `"paper"` (SinGAN as it was published), or generators
    /// with these settings. Without it the style is coarse only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<DetailSpec>,
}

/// The word `patches`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Patches {
    /// The exemplar's own patches.
    Patches,
}

/// The detail of a style.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum DetailSpec {
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
    pub fn plan(&self) -> Result<Arc<dyn DetailPlan>> {
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

/// One piece of terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AreaSpec {
    /// Its name in a manifest, or that of a bundled tile.
    pub name: String,
    /// The terrain by its name in a manifest or bundle, where `name` is another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<String>,
    /// Takes the means of so many by so many cells as the terrain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coarser: Option<usize>,
    /// Row and column of the exemplar's north-west cell, and its side if not 128; the most varied central patch when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exemplar: Option<Vec<usize>>,
    /// North-west cells of the test patches; all whole ones that share no cell with the exemplar when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patches: Option<Vec<[usize; 2]>>,
    /// SHA-256 of heights and voids, which must be those of the terrain that is found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
}

/// Which strokes of a sketch are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Choice {
    /// The longest ones.
    #[default]
    Longest,
    /// Drawn by the experiment's first seed, the same ones for every system and seed.
    Random,
}

/// Which lines the systems are given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SketchSpec {
    /// For tables: "order 3".
    pub name: String,
    /// Lowest Strahler order; that of `extraction` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<u8>,
    /// Fewest cells that a line drains; those of `extraction` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accumulation: Option<u32>,
    /// Keeps at most so many strokes (lines between junctions).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strokes: Option<usize>,
    /// Which ones; the longest when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub choose: Option<Choice>,
    /// `drawings`: the bundled sample sketch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawing: Option<String>,
    /// `drawings`: nodes of random lines (5.2); none when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<usize>,
    /// `drawings`: where those lines lie; around the drawn strokes, as steep as the style, when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random_heights: Option<RandomHeights>,
    /// `invariance`: degrees by which the lines are turned about the middle, counter-clockwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<f64>,
    /// `invariance`: west and east change places, before turning.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirror: bool,
    /// `invariance`: cells south and east by which the lines are moved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<[i32; 2]>,
    /// `invariance`: the parts move with the lines instead of being cut anew.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub same_parts: bool,
}

/// Over what a bound takes its mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// The mean of the areas' means.
    AllAreas,
    /// The mean of each area, over patches and seeds; every one must keep the bound.
    EachArea,
    /// Each patch, mean over seeds; every one must keep the bound.
    EachPatch,
}

/// What a system's score is compared with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// The interpolator with the best mean over the scope.
    BestInterpolator,
    /// On each patch the best interpolator there.
    BestInterpolatorOfEachPatch,
    /// A system.
    System(String),
}

/// An expectation: a mean score, or its difference to another system's, lies between `min` and `max`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bound {
    /// The system; the highlighted one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system: Option<String>,
    /// The score.
    pub metric: String,
    /// The sketch; every one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sketch: Option<String>,
    /// The area; every one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<String>,
    /// Over what the mean is taken.
    pub over: Scope,
    /// What is subtracted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<Against>,
    /// Lowest allowed value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Highest allowed value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// Why this is expected.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub reason: String,
}

/// A number from a publication.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Printed {
    /// Where it stands.
    pub source: String,
    /// The area here that comes nearest to the one there.
    pub area: String,
    /// The score here that comes nearest to the one there.
    pub metric: String,
    /// The number.
    pub value: f64,
    /// Its standard deviation, when printed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// What makes the two hard to compare.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
}

fn main_metrics() -> Vec<String> {
    let names = ["ssim", "psnr", "interior_ssim", "interior_psnr", "mean_slope_ratio", "spectrum_distance"];
    names.map(str::to_owned).to_vec()
}

/// Losses that `fit` adds to the scores: `l_gt` of the rebuilt exemplar, and those of the last training step with its noise
/// and masked parts.
pub const FIT_COLUMNS: [&str; 7] = [
    "l_gt",
    "train_l_gt",
    "train_l_gradient",
    "train_l_sketch",
    "train_l_smooth",
    "train_l_further",
    "train_ssim",
];

/// What `exchange` adds to the scores: the output against the exemplar of its style.
pub const STYLE_COLUMNS: [&str; 4] =
    ["style_slope_ratio", "style_slope_distance", "style_curvature_distance", "style_spectrum_distance"];

/// Scores of `drawings`, means over the variants.
pub const DRAWING_COLUMNS: [&str; 13] = [
    "diversity",
    "stroke_height_error",
    "drawn_ridge_recall",
    "drawn_valley_recall",
    "ridge_f1",
    "valley_f1",
    "roughness",
    "pit_share",
    "clipped_share",
    STYLE_COLUMNS[0],
    STYLE_COLUMNS[1],
    STYLE_COLUMNS[2],
    STYLE_COLUMNS[3],
];

/// Scores of `invariance`, unit heights: the terrain of the moved lines, moved back, against that of the lines.
pub const INVARIANCE_COLUMNS: [&str; 2] = ["max_difference", "rms_difference"];

/// Scores of `disentanglement`.
pub const STATE_COLUMNS: [&str; 4] = ["kind_purity", "chance_purity", "kind_silhouette", "regions"];

/// Scores of which less is better.
const LOWER: [&str; 20] = [
    "style_slope_distance",
    "style_curvature_distance",
    "style_spectrum_distance",
    "max_difference",
    "rms_difference",
    "rmse",
    "clipped_share",
    "slope_distance",
    "curvature_distance",
    "spectrum_distance",
    "pit_share",
    "truth_pit_share",
    "stroke_height_error",
    "unasked_share",
    "l_gt",
    "train_l_gt",
    "train_l_gradient",
    "train_l_sketch",
    "train_l_smooth",
    "train_l_further",
];

/// Whether less of a score is better.
#[must_use]
pub fn lower_is_better(metric: &str) -> bool {
    LOWER.contains(&metric)
}

impl ExperimentSpec {
    /// Reads and checks an experiment file.
    ///
    /// # Errors
    /// When the file cannot be read or understood, or a value is not allowed; the message names file, key and value.
    pub fn read(path: &Path) -> Result<Self> {
        let text = String::from_utf8(file::read_whole(path, LARGEST)?)
            .map_err(|e| Error::file(path, "text", e, "allowed: TOML in UTF-8"))?;
        let spec: Self = toml::from_str(&text).map_err(|e| {
            let said = e.to_string();
            Error::file(path, "experiment", "not understood", format!("the reader says: {}", said.trim_end()))
        })?;
        spec.validate().map_err(|e| e.in_file(path))?;
        Ok(spec)
    }

    /// The file that [`read`](Self::read) reads back as the same.
    ///
    /// # Panics
    /// Never: a checked experiment is plain data.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("an experiment is plain data")
    }

    /// The columns of scores that this experiment gives.
    #[must_use]
    pub fn columns(&self) -> Vec<&'static str> {
        let mut columns = Scores::names().to_vec();
        match self.kind {
            Kind::Fit => columns.extend(FIT_COLUMNS),
            Kind::Exchange => columns.extend(STYLE_COLUMNS),
            Kind::Drawings => return DRAWING_COLUMNS.to_vec(),
            Kind::Invariance => return INVARIANCE_COLUMNS.to_vec(),
            Kind::Disentanglement => return STATE_COLUMNS.to_vec(),
            Kind::Neighbours | Kind::Sparse | Kind::Ablation | Kind::Exemplar | Kind::Cost => {}
        }
        columns
    }

    /// The names of all systems, those of the styles first, as they stand in the scores.
    ///
    /// # Errors
    /// When a style's configuration or a system's name is not allowed.
    pub fn systems(&self) -> Result<Vec<String>> {
        let mut systems = Vec::new();
        for style in &self.style {
            for system in self.uses(style)? {
                systems.push(if self.kind == Kind::Fit { style.name.clone() } else { style.label(&system) });
                if self.kind == Kind::Fit {
                    break;
                }
            }
        }
        systems.extend(self.interpolator_names()?);
        Ok(systems)
    }

    /// The interpolators by name, in the order of the registry.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn interpolator_names(&self) -> Result<Vec<String>> {
        let known: Vec<String> =
            Registry::default().interpolators().iter().map(|(name, _)| name.clone()).collect();
        if self.interpolators == ["all"] {
            return Ok(known);
        }
        if let Some(bad) = self.interpolators.iter().find(|name| !known.contains(name)) {
            return Err(Error::value(
                "interpolators",
                bad,
                format!("allowed: all (alone), {}", known.join(", ")),
            ));
        }
        Ok(known.into_iter().filter(|name| self.interpolators.contains(name)).collect())
    }

    /// The registry's names of the ways in which a style is used, in the registry's order.
    ///
    /// # Errors
    /// As [`systems`](Self::systems).
    pub fn uses(&self, style: &StyleSpec) -> Result<Vec<String>> {
        let known = style::names(&[self.config_of(style)?.plan()?], style.detail.is_some());
        if style.systems.is_empty() {
            return Ok(known);
        }
        if let Some(bad) = style.systems.iter().find(|name| !known.contains(name)) {
            let name = format!("systems of style {:?}", style.name);
            return Err(Error::value(name, bad, format!("allowed: {}", known.join(", "))));
        }
        Ok(known.into_iter().filter(|name| style.systems.contains(name)).collect())
    }

    /// The whole configuration of a style.
    ///
    /// # Errors
    /// When a key is unknown or a value is not allowed.
    pub fn config_of(&self, style: &StyleSpec) -> Result<StyleConfig> {
        let named = |e: Error| match e {
            Error::Value { name, value, allowed } => {
                Error::Value { name: format!("style {:?}, {name}", style.name), value, allowed }
            }
            other => other,
        };
        if let Some(config) = &style.config {
            if style.preset.is_some() || !style.set.is_empty() {
                let allowed = "allowed: either config, or preset and set";
                return Err(Error::value(format!("style {:?}", style.name), "given twice", allowed));
            }
            config.validate().map_err(named)?;
            return Ok(config.clone());
        }
        let mut base = StyleConfig::preset(style.preset.unwrap_or(Preset::Anchored));
        base.extraction = self.extraction.clone();
        overlaid(&base, [&self.overrides, &style.set], "configuration").map_err(named)
    }

    /// The sketches; the one of `extraction` when none is named. For `exchange` one for each area, called as it is.
    #[must_use]
    pub fn sketches(&self) -> Vec<SketchSpec> {
        let called = |name: &str| SketchSpec { name: name.to_owned(), ..SketchSpec::default() };
        if self.kind == Kind::Exchange {
            return self.area.iter().map(|area| called(&area.name)).collect();
        }
        if self.sketch.is_empty() {
            return vec![called(if self.kind == Kind::Fit { "exemplar" } else { "dense" })];
        }
        self.sketch.clone()
    }

    /// The system that the experiment is about.
    ///
    /// # Errors
    /// As [`systems`](Self::systems).
    pub fn highlighted(&self) -> Result<String> {
        let first = || self.systems().map(|systems| systems[0].clone());
        self.highlight.clone().map_or_else(first, Ok)
    }

    /// Checks everything that can be checked without terrain.
    ///
    /// # Errors
    /// Names the first key that is not allowed.
    pub fn validate(&self) -> Result<()> {
        super::validate::validate(self)
    }
}

impl StyleSpec {
    /// What a way to use the style is called in the scores.
    #[must_use]
    pub fn label(&self, system: &str) -> String {
        format!("{}{}", self.name, style::suffix(&Registry::default(), system))
    }
}
