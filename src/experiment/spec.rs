//! An experiment as a data file: the question, what is compared on which terrain, and what the answer should be.
//!
//! `docs/experiments.md` describes the format. A resolved experiment ([`resolve`](super::resolve::resolve)) is such a file
//! too, with nothing left open.

use crate::checked::Settings;
use crate::error::{Error, Result};
use crate::extract::ExtractionConfig;
pub(crate) use crate::style::DetailSpec;
use crate::style::{self, NETWORK, Preset, Registry, StyleConfig, SystemPlan, overlaid};
use crate::systems::task::RandomHeights;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is done with the trained styles: the name of a protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "each is described in its file below `protocols/`")]
pub(crate) enum Kind {
    Neighbours,
    Fit,
    Sparse,
    Ablation,
    Exemplar,
    Exchange,
    Drawings,
    Invariance,
    Disentanglement,
    Cost,
    Strokes,
}

impl Kind {
    /// Every one.
    #[cfg(test)]
    pub(crate) const ALL: [Self; 11] = [
        Self::Neighbours,
        Self::Fit,
        Self::Sparse,
        Self::Ablation,
        Self::Exemplar,
        Self::Exchange,
        Self::Drawings,
        Self::Invariance,
        Self::Disentanglement,
        Self::Cost,
        Self::Strokes,
    ];
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(&format!("{self:?}").to_lowercase())
    }
}

/// An experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ExperimentSpec {
    /// What is done.
    pub(crate) kind: Kind,
    /// One line.
    pub(crate) title: String,
    /// What the experiment is to answer.
    pub(crate) question: String,
    /// What the results say, written after a run.
    #[serde(default)]
    pub(crate) analysis: String,
    /// Seeds of training and generation; each gives its own rows.
    pub(crate) seeds: Vec<u64>,
    /// How long all of it may take on the machine that it is meant for.
    pub(crate) budget_minutes: f64,
    /// Scores that tables and plots show, by their names in `scores.csv`, the most important first.
    #[serde(default = "main_metrics")]
    pub(crate) metrics: Vec<String>,
    /// Patches an area of which pictures are kept: the worst and the best in turn.
    #[serde(default)]
    pub(crate) pictures: usize,
    /// Interpolators beside the styles: names, or `all` alone.
    #[serde(default)]
    pub(crate) interpolators: Vec<String>,
    /// The system that bounds, pictures and plots are about; the first style's first one when absent.
    pub(crate) highlight: Option<String>,
    /// Ablation: the system that the others are compared with; the highlighted one when absent.
    pub(crate) baseline: Option<String>,
    /// At most so many test patches an area, the nearest to the exemplar.
    pub(crate) patches_per_area: Option<usize>,
    /// How lines of patches are found, and what the styles' own extraction begins with.
    #[serde(default)]
    pub(crate) extraction: ExtractionConfig,
    /// Sections of the style configuration ([`StyleConfig`]) that all styles share.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub(crate) overrides: toml::Table,
    /// The styles.
    pub(crate) style: Vec<StyleSpec>,
    /// The areas with their exemplars.
    pub(crate) area: Vec<AreaSpec>,
    /// The sketches that the systems are given of each patch; one with the lines of `extraction` when none is named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) sketch: Vec<SketchSpec>,
    /// What the results should be.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) bound: Vec<Bound>,
    /// Numbers that others printed, to stand beside ours.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) printed: Vec<Printed>,
}

/// A style that is trained for every area and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StyleSpec {
    /// Stands for `gnn` in the names of its systems: `gnn-aligned` of the style `paper` is `paper-aligned`.
    pub(crate) name: String,
    /// Ways to use the style, by their names in the registry; all of them when none is named.
    #[serde(default)]
    pub(crate) systems: Vec<String>,
    /// The coarse systems that it learns, by name; the region network (`gnn`) alone when absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) learns: Vec<String>,
    /// The configuration to begin with.
    pub(crate) preset: Option<Preset>,
    /// Sections of the configuration that differ from the preset and the common overrides.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub(crate) set: toml::Table,
    /// The whole configuration instead of preset, overrides and set: what a resolved file has.
    pub(crate) config: Option<StyleConfig>,
    /// Also has detail: `"patches"`, `"generators"` (the usual ones), `"paper"` (SinGAN as it was published), or generators
    /// with these settings. Without it the style is coarse only.
    pub(crate) detail: Option<DetailSpec>,
}

/// One piece of terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AreaSpec {
    /// Its name in a manifest, or that of a bundled tile.
    pub(crate) name: String,
    /// The terrain by its name in a manifest or bundle, where `name` is another.
    pub(crate) terrain: Option<String>,
    /// Takes the means of so many by so many cells as the terrain.
    pub(crate) coarser: Option<usize>,
    /// Row and column of the exemplar's north-west cell, and its side if not 128; the most varied central patch when absent.
    pub(crate) exemplar: Option<Vec<usize>>,
    /// North-west cells of the test patches; all whole ones that share no cell with the exemplar when absent.
    pub(crate) patches: Option<Vec<[usize; 2]>>,
    /// SHA-256 of heights and voids, which must be those of the terrain that is found.
    pub(crate) fingerprint: Option<String>,
}

/// Which strokes of a sketch are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Choice {
    /// The longest ones.
    #[default]
    Longest,
    /// Drawn by the experiment's first seed, the same ones for every system and seed.
    Random,
}

/// Which lines the systems are given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SketchSpec {
    /// For tables: "order 3".
    pub(crate) name: String,
    /// Lowest Strahler order; that of `extraction` when absent.
    pub(crate) order: Option<u8>,
    /// Fewest cells that a line drains; those of `extraction` when absent.
    pub(crate) accumulation: Option<u32>,
    /// Keeps at most so many strokes (lines between junctions; `strokes`: half of them valleys, half ridges).
    pub(crate) strokes: Option<usize>,
    /// Which ones; the longest when absent.
    pub(crate) choose: Option<Choice>,
    /// `drawings`: the bundled sample sketch.
    pub(crate) drawing: Option<String>,
    /// `strokes`: side of the truths, cells; 256 when absent.
    pub(crate) size: Option<usize>,
    /// `strokes`: share of the truth that a drawn line drains at least; that of [`MainLinesConfig`](crate::extract::MainLinesConfig) when absent.
    pub(crate) share: Option<f64>,
    /// `drawings`, `strokes`: nodes of random lines (5.2); none when absent.
    pub(crate) random: Option<usize>,
    /// `drawings`, `strokes`: where those lines lie; around the drawn strokes, as steep as the style, when absent.
    pub(crate) random_heights: Option<RandomHeights>,
    /// `invariance`: degrees by which the lines are turned about the middle, counter-clockwise.
    pub(crate) turn: Option<f64>,
    /// `invariance`: west and east change places, before turning.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) mirror: bool,
    /// `invariance`: cells south and east by which the lines are moved.
    pub(crate) shift: Option<[i32; 2]>,
    /// `invariance`: the parts move with the lines instead of being cut anew.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) same_parts: bool,
}

/// Over what a bound takes its mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Scope {
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
pub(crate) enum Against {
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
pub(crate) struct Bound {
    /// The system; the highlighted one when absent.
    pub(crate) system: Option<String>,
    /// The score.
    pub(crate) metric: String,
    /// The sketch; every one when absent.
    pub(crate) sketch: Option<String>,
    /// The area; every one when absent.
    pub(crate) area: Option<String>,
    /// Over what the mean is taken.
    pub(crate) over: Scope,
    /// What is subtracted.
    pub(crate) against: Option<Against>,
    /// Lowest allowed value.
    pub(crate) min: Option<f64>,
    /// Highest allowed value.
    pub(crate) max: Option<f64>,
    /// Why this is expected.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) reason: String,
}

/// A number from a publication.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Printed {
    /// Where it stands.
    pub(crate) source: String,
    /// The area here that comes nearest to the one there.
    pub(crate) area: String,
    /// The score here that comes nearest to the one there.
    pub(crate) metric: String,
    /// The number.
    pub(crate) value: f64,
    /// Its standard deviation, when printed.
    pub(crate) sd: Option<f64>,
    /// What makes the two hard to compare.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) note: String,
}

fn main_metrics() -> Vec<String> {
    let names = ["ssim", "psnr", "interior_ssim", "interior_psnr", "mean_slope_ratio", "spectrum_distance"];
    names.map(str::to_owned).to_vec()
}

impl ExperimentSpec {
    /// The file that [`read`](Self::read) reads back as the same.
    ///
    /// # Panics
    /// Never: a checked experiment is plain data.
    #[must_use]
    pub(crate) fn to_toml(&self) -> String {
        toml::to_string(self).expect("an experiment is plain data")
    }

    /// The interpolators by name, in the order of the registry.
    ///
    /// # Errors
    /// When there is none of that name.
    pub(crate) fn interpolator_names(&self) -> Result<Vec<String>> {
        let known: Vec<String> =
            Registry::default().interpolators().iter().map(|(name, _)| name.clone()).collect();
        if self.interpolators == ["all"] {
            return Ok(known);
        }
        chosen(known, &self.interpolators, || "interpolators".to_owned(), "all (alone), ")
    }

    /// The registry's names of the ways in which a style is used, in the registry's order.
    ///
    /// # Errors
    /// As [`systems`](Self::systems).
    pub(crate) fn uses(&self, style: &StyleSpec) -> Result<Vec<String>> {
        let known = style::names(&self.plans(style)?, style.detail.is_some());
        if style.systems.is_empty() {
            return Ok(known);
        }
        chosen(known, &style.systems, || format!("systems of style {:?}", style.name), "")
    }

    /// The coarse systems of a style, to learn.
    ///
    /// # Errors
    /// As [`config_of`](Self::config_of); when there is none of that name.
    pub(super) fn plans(&self, style: &StyleSpec) -> Result<Vec<Arc<dyn SystemPlan>>> {
        let network = || self.config_of(style)?.plan();
        if style.learns.is_empty() {
            return Ok(vec![network()?]);
        }
        let plan = |name: &String| match name.as_str() {
            NETWORK => network(),
            name => Registry::default().plan(name, &toml::Table::new()),
        };
        let named = |e: Error| e.renamed(|name| format!("learns of style {:?}, {name}", style.name));
        style.learns.iter().map(plan).collect::<Result<_>>().map_err(named)
    }

    /// The whole configuration of a style.
    ///
    /// # Errors
    /// When a key is unknown or a value is not allowed.
    pub(crate) fn config_of(&self, style: &StyleSpec) -> Result<StyleConfig> {
        let named = |e: Error| e.renamed(|name| format!("style {:?}, {name}", style.name));
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

    /// Side of the largest truths of `strokes`, cells.
    pub(super) fn largest_truth(&self) -> usize {
        self.sketch.iter().map(SketchSpec::size).max().unwrap_or(0)
    }

    /// The system that the experiment is about.
    ///
    /// # Errors
    /// As [`systems`](Self::systems).
    pub(crate) fn highlighted(&self) -> Result<String> {
        let first = || self.systems().map(|systems| systems[0].clone());
        self.highlight.clone().map_or_else(first, Ok)
    }
}

/// Those of the `known` names that are `wanted`, in their own order.
fn chosen(
    known: Vec<String>,
    wanted: &[String],
    key: impl Fn() -> String,
    others: &str,
) -> Result<Vec<String>> {
    match wanted.iter().find(|name| !known.contains(name)) {
        Some(bad) => Err(Error::value(key(), bad, format!("allowed: {others}{}", known.join(", ")))),
        None => Ok(known.into_iter().filter(|name| wanted.contains(name)).collect()),
    }
}

impl SketchSpec {
    /// Side of the truths of `strokes`, cells.
    pub(super) fn size(&self) -> usize {
        self.size.unwrap_or(256)
    }
}

impl StyleSpec {
    /// What a way to use the style is called in the scores.
    #[must_use]
    pub(crate) fn label(&self, system: &str) -> String {
        format!("{}{}", self.name, style::suffix(&Registry::default(), system))
    }
}
