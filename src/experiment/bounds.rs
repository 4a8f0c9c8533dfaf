//! What was expected of an experiment against what came out.

use super::rows::ScoreTable;
use super::spec::{Against, Bound, ExperimentSpec, Scope, lower_is_better};
use super::summary::{Cells, Stat, Summaries, difference, of_patches};
use crate::error::Result;

/// How a bound fared.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The bound in words: "anchored: psnr - best interpolator, each area, at least 0".
    pub bound: String,
    /// Why it is expected.
    pub reason: String,
    /// The value nearest to its limit, or farthest beyond it; none when there was nothing to take a mean of.
    pub worst: Option<f64>,
    /// Where that was: area, patch, sketch.
    pub place: String,
    /// How many values were held against it, and how many broke it.
    pub checked: usize,
    /// How many of them broke it.
    pub broken: usize,
    /// Cells on which the system failed and another one did not: each breaks the bound.
    pub failures: usize,
}

impl Verdict {
    /// Whether the bound is kept: everywhere, and there was something to check.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.checked > 0 && self.broken == 0 && self.failures == 0
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let word = if self.is_kept() { "kept  " } else { "BROKEN" };
        write!(f, "{word}  {}: ", self.bound)?;
        match self.worst {
            Some(worst) => write!(f, "{worst:.5} ({})", self.place)?,
            None => write!(f, "no score to check")?,
        }
        if self.checked > 1 {
            write!(f, "; {} of {} keep it", self.checked - self.broken, self.checked)?;
        }
        if self.failures > 0 {
            write!(f, "; failed on {} cells", self.failures)?;
        }
        Ok(())
    }
}

/// Holds the scores against every bound.
///
/// # Errors
/// When the experiment names a system that there is not.
pub fn check(spec: &ExperimentSpec, table: &ScoreTable) -> Result<Vec<Verdict>> {
    let summaries = Summaries::new(spec, table)?;
    let highlight = spec.highlighted()?;
    Ok(spec.bound.iter().map(|bound| one(spec, &summaries, bound, &highlight)).collect())
}

fn one(spec: &ExperimentSpec, summaries: &Summaries<'_>, bound: &Bound, highlight: &str) -> Verdict {
    let system = bound.system.as_deref().unwrap_or(highlight);
    let sketches: Vec<String> = spec.sketches().into_iter().map(|s| s.name).collect();
    let sketches = sketches.iter().filter(|name| bound.sketch.as_ref().is_none_or(|wanted| wanted == *name));
    let areas: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
    let areas: Vec<&str> =
        areas.into_iter().filter(|name| bound.area.as_deref().is_none_or(|wanted| wanted == *name)).collect();
    let mut found: Vec<(f64, String)> = Vec::new();
    let mut failures = 0;
    for sketch in sketches {
        failures += areas.iter().map(|area| summaries.failures(system, area, sketch)).sum::<usize>();
        // One set of differences an opponent; without one the scores themselves.
        let opponents: Vec<Vec<(&str, Cells)>> = opponents(summaries, bound, system, sketch, &areas);
        match bound.over {
            Scope::AllAreas => {
                let value = worst(bound, opponents.iter().filter_map(|areas| mean_of_means(areas)));
                found.extend(value.map(|v| (v, format!("{} areas, sketch {sketch}", areas.len()))));
            }
            Scope::EachArea => {
                for (i, area) in areas.iter().enumerate() {
                    let value = worst(bound, opponents.iter().filter_map(|areas| mean(&areas[i].1)));
                    found.extend(value.map(|v| (v, format!("{area}, sketch {sketch}"))));
                }
            }
            Scope::EachPatch => {
                for (i, area) in areas.iter().enumerate() {
                    let sets: Vec<_> = opponents.iter().map(|areas| of_patches(&areas[i].1)).collect();
                    let patches: std::collections::BTreeSet<_> =
                        sets.iter().flat_map(|set| set.keys()).collect();
                    for &(row, col) in patches {
                        let values = sets.iter().filter_map(|set| set.get(&(row, col)).copied());
                        let value = worst(bound, values);
                        found.extend(value.map(|v| (v, format!("{area} {row},{col}, sketch {sketch}"))));
                    }
                }
            }
        }
    }
    let broken = found.iter().filter(|(value, _)| slack(bound, *value) < 0.0).count();
    let nearest = found.iter().min_by(|a, b| slack(bound, a.0).total_cmp(&slack(bound, b.0)));
    Verdict {
        bound: words(bound, system),
        reason: bound.reason.clone(),
        worst: nearest.map(|(value, _)| *value),
        place: nearest.map(|(_, place)| place.clone()).unwrap_or_default(),
        checked: found.len(),
        broken,
        failures,
    }
}

/// The values to check in every area, once for each system that they are compared with.
fn opponents<'a>(
    summaries: &Summaries<'_>,
    bound: &Bound,
    system: &str,
    sketch: &str,
    areas: &[&'a str],
) -> Vec<Vec<(&'a str, Cells)>> {
    let metric = bound.metric.as_str();
    let own = |area: &str| summaries.cells(system, area, sketch, metric);
    let against = |name: &str| -> Vec<(&'a str, Cells)> {
        areas.iter().map(|&a| (a, difference(&own(a), &summaries.cells(name, a, sketch, metric)))).collect()
    };
    match &bound.against {
        None => vec![areas.iter().map(|&area| (area, own(area))).collect()],
        Some(Against::System(name)) => vec![against(name)],
        Some(Against::BestInterpolator) => summaries.interpolators().iter().map(|n| against(n)).collect(),
        Some(Against::BestInterpolatorOfEachPatch) => {
            let best = |area: &str| summaries.best_of_each(area, sketch, metric);
            vec![areas.iter().map(|&area| (area, difference(&own(area), &best(area)))).collect()]
        }
    }
}

/// The difference to the opponent that does best.
fn worst(bound: &Bound, values: impl Iterator<Item = f64>) -> Option<f64> {
    if lower_is_better(&bound.metric) { values.reduce(f64::max) } else { values.reduce(f64::min) }
}

fn mean(cells: &Cells) -> Option<f64> {
    Stat::of(&cells.values().copied().collect::<Vec<_>>()).map(|stat| stat.mean)
}

fn mean_of_means(areas: &[(&str, Cells)]) -> Option<f64> {
    let means: Vec<f64> = areas.iter().filter_map(|(_, cells)| mean(cells)).collect();
    Stat::of(&means).map(|stat| stat.mean)
}

/// How far inside its limits a value lies; below 0 it breaks the bound.
fn slack(bound: &Bound, value: f64) -> f64 {
    let below = bound.min.map_or(f64::INFINITY, |min| value - min);
    let above = bound.max.map_or(f64::INFINITY, |max| max - value);
    below.min(above)
}

fn words(bound: &Bound, system: &str) -> String {
    let against = match &bound.against {
        None => String::new(),
        Some(Against::BestInterpolator) => " - best interpolator".to_owned(),
        Some(Against::BestInterpolatorOfEachPatch) => " - best interpolator of each patch".to_owned(),
        Some(Against::System(name)) => format!(" - {name}"),
    };
    let over = match (bound.over, &bound.area) {
        (Scope::AllAreas, _) => "mean of all areas".to_owned(),
        (Scope::EachArea, None) => "each area".to_owned(),
        (Scope::EachPatch, None) => "each patch".to_owned(),
        (Scope::EachArea, Some(area)) => area.clone(),
        (Scope::EachPatch, Some(area)) => format!("each patch of {area}"),
    };
    let sketch = bound.sketch.as_ref().map(|s| format!(", sketch {s}")).unwrap_or_default();
    let limits = match (bound.min, bound.max) {
        (Some(min), Some(max)) => format!("{min} to {max}"),
        (Some(min), None) => format!("at least {min}"),
        (None, Some(max)) => format!("at most {max}"),
        (None, None) => String::new(),
    };
    format!("{system}: {}{against}, {over}{sketch}, {limits}", bound.metric)
}
