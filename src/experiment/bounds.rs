//! What was expected of an experiment against what came out.

use super::results::{Cells, Results, Stat, difference, of_patches};
use super::rows::ScoreTable;
use super::spec::{Against, Bound, ExperimentSpec, Scope};
use crate::error::Result;
use crate::metrics::lower_is_better;

/// How a bound fared.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Verdict {
    /// The bound in words: "anchored: psnr - best interpolator, each area, at least 0".
    pub(crate) bound: String,
    /// Why it is expected.
    pub(crate) reason: String,
    /// The value nearest to its limit, or farthest beyond it; none when there was nothing to take a mean of.
    pub(crate) worst: Option<f64>,
    /// Where that was: area, patch, sketch.
    pub(crate) place: String,
    /// How many values were held against it, and how many broke it.
    pub(crate) checked: usize,
    /// How many of them broke it.
    pub(crate) broken: usize,
    /// Cells on which the system failed and another one did not: each breaks the bound.
    pub(crate) failures: usize,
}

impl Verdict {
    /// Whether the bound is kept: everywhere, and there was something to check.
    #[must_use]
    pub(crate) fn is_kept(&self) -> bool {
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
pub(crate) fn check(spec: &ExperimentSpec, table: &ScoreTable) -> Result<Vec<Verdict>> {
    let results = Results::new(spec, table)?;
    Ok(spec.bound.iter().map(|bound| judge(&results, bound)).collect())
}

fn judge(results: &Results<'_>, bound: &Bound) -> Verdict {
    let system = bound.system.as_ref().unwrap_or(&results.highlight);
    let sketches = results.sketches.iter().filter(|name| bound.sketch.as_ref().is_none_or(|s| s == *name));
    let areas = results.spec.area.iter().map(|a| a.name.as_str());
    let areas: Vec<&str> = areas.filter(|name| bound.area.as_deref().is_none_or(|a| a == *name)).collect();
    let mut found: Vec<(f64, String)> = Vec::new();
    let mut failures = 0;
    for sketch in sketches {
        failures += areas.iter().map(|area| results.failures(system, area, sketch)).sum::<usize>();
        // One set of differences an opponent; without one the scores themselves.
        let opponents: Vec<Vec<(&str, Cells)>> = opponents(results, bound, system, sketch, &areas);
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
    results: &Results<'_>,
    bound: &Bound,
    system: &str,
    sketch: &str,
    areas: &[&'a str],
) -> Vec<Vec<(&'a str, Cells)>> {
    let metric = bound.metric.as_str();
    let own = |area: &str| results.cells(system, area, sketch, metric);
    let against = |name: &str| -> Vec<(&'a str, Cells)> {
        areas.iter().map(|&a| (a, difference(&own(a), &results.cells(name, a, sketch, metric)))).collect()
    };
    match &bound.against {
        None => vec![areas.iter().map(|&area| (area, own(area))).collect()],
        Some(Against::System(name)) => vec![against(name)],
        Some(Against::BestInterpolator) => results.interpolators().iter().map(|n| against(n)).collect(),
        Some(Against::BestInterpolatorOfEachPatch) => {
            let best = |area: &str| results.best_of_each(area, sketch, metric);
            vec![areas.iter().map(|&area| (area, difference(&own(area), &best(area)))).collect()]
        }
    }
}

/// The difference to the opponent that does best.
fn worst(bound: &Bound, values: impl Iterator<Item = f64>) -> Option<f64> {
    if lower_is_better(&bound.metric) { values.reduce(f64::max) } else { values.reduce(f64::min) }
}

fn mean(cells: &Cells) -> Option<f64> {
    Stat::of(cells.values().copied()).map(|stat| stat.mean)
}

fn mean_of_means(areas: &[(&str, Cells)]) -> Option<f64> {
    Stat::of(areas.iter().filter_map(|(_, cells)| mean(cells))).map(|stat| stat.mean)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::rows::{Key, ScoreRow};

    /// Two areas with two patches and two seeds; scores by a formula.
    fn table(score: impl Fn(&str, &str, usize, u64) -> Option<f64>) -> ScoreTable {
        let mut rows = Vec::new();
        for area in ["a", "b"] {
            for row in [0, 128] {
                for seed in [1, 2] {
                    for system in ["anchored", "laplace", "nearest"] {
                        let value = score(system, area, row, seed);
                        let (system, area) = (system.to_owned(), area.to_owned());
                        rows.push(ScoreRow {
                            key: Key { system, area, row, col: 0, seed, sketch: "dense".into() },
                            relief: 1.0,
                            line_share: 0.1,
                            values: vec![value],
                            error: if value.is_none() { "broke".into() } else { String::new() },
                        });
                    }
                }
            }
        }
        ScoreTable { columns: vec!["psnr".into()], rows }
    }

    fn verdict(bound: &str, table: &ScoreTable) -> Verdict {
        let text = format!(
            "kind = 'neighbours'\ntitle = 't'\nquestion = 'q'\nseeds = [1, 2]\nbudget_minutes = 1\nmetrics = ['psnr']\n\
             interpolators = ['laplace', 'nearest']\n[[style]]\nname = 'anchored'\n[[area]]\nname = 'a'\n[[area]]\n\
             name = 'b'\n[[bound]]\nmetric = 'psnr'\n{bound}\n"
        );
        let spec: ExperimentSpec = toml::from_str(&text).unwrap();
        spec.validate().unwrap();
        check(&spec, table).unwrap().remove(0)
    }

    /// Against laplace the model wins area b and loses patch 128 of area a with seed 2; against nearest the other way round.
    fn formula(system: &str, area: &str, row: usize, seed: u64) -> Option<f64> {
        Some(match (system, area, row, seed) {
            ("anchored", "a", 128, 2) => 24.0,
            ("anchored", "a", _, _) => 30.0,
            ("anchored", ..) => 21.0,
            ("laplace", "a", _, _) => 29.0,
            ("laplace", ..) => 20.5,
            ("nearest", "a", _, _) => 10.0,
            _ => 20.75,
        })
    }

    #[test]
    fn means_cover_areas_patches_and_seeds() {
        let t = table(formula);
        let worst = |bound: &str| {
            let v = verdict(bound, &t);
            (v.worst.unwrap(), v.checked, v.broken, v.is_kept())
        };
        // (30 + 30 + 30 + 24) / 4 = 28.5 and 21.
        assert_eq!(worst("over = 'all-areas'\nmin = 24.75"), (24.75, 1, 0, true));
        assert_eq!(worst("over = 'all-areas'\nmin = 24.76"), (24.75, 1, 1, false));
        assert_eq!(worst("over = 'each-area'\nmax = 25"), (28.5, 2, 1, false));
        assert_eq!(worst("over = 'each-area'\narea = 'b'\nmax = 25"), (21.0, 1, 0, true));
        assert_eq!(worst("over = 'each-patch'\nmin = 20"), (21.0, 4, 0, true));
        // The best interpolator of area a is laplace (29), of b nearest (20.75).
        assert_eq!(worst("over = 'each-area'\nagainst = 'best-interpolator'\nmin = 0"), (-0.5, 2, 1, false));
        assert_eq!(
            worst("over = 'each-area'\narea = 'b'\nagainst = 'best-interpolator'\nmin = 0"),
            (0.25, 1, 0, true)
        );
        // Over both areas laplace is the best: (-.5 + .5) / 2.
        assert_eq!(worst("over = 'all-areas'\nagainst = 'best-interpolator'\nmin = 0"), (0.0, 1, 0, true));
        let each = "over = 'all-areas'\nagainst = 'best-interpolator-of-each-patch'\nmin = 0";
        assert_eq!(worst(each), (-0.125, 1, 1, false));
        // Patch a 128: (1 + (-5)) / 2 over the seeds.
        assert_eq!(worst("over = 'each-patch'\nagainst = 'best-interpolator'\nmin = -2"), (-2.0, 4, 0, true));
        assert_eq!(
            worst("over = 'each-patch'\nagainst = { system = 'nearest' }\nmin = 0.3"),
            (0.25, 4, 2, false)
        );
        assert_eq!(worst("system = 'nearest'\nover = 'each-patch'\nmax = 10"), (20.75, 4, 2, false));
        let text = verdict("over = 'each-patch'\nagainst = 'best-interpolator'\nmin = -1.5", &t).to_string();
        assert!(
            text.starts_with("BROKEN") && text.contains("a 128,0") && text.contains("3 of 4 keep it"),
            "{text}"
        );
    }

    #[test]
    fn a_failure_breaks_a_bound_unless_all_failed() {
        let failing = |all: bool| {
            table(move |system, area, row, seed| {
                let broken = area == "b" && row == 0 && (all || system == "anchored");
                if broken { None } else { formula(system, area, row, seed) }
            })
        };
        let bound = "over = 'each-patch'\nmin = 0";
        let some = verdict(bound, &failing(false));
        assert_eq!((some.failures, some.broken, some.is_kept()), (2, 0, false));
        let all = verdict(bound, &failing(true));
        assert_eq!((all.failures, all.checked, all.is_kept()), (0, 3, true));
        let nothing = verdict(bound, &table(|_, _, _, _| None));
        assert!(!nothing.is_kept() && nothing.to_string().contains("no score"));
    }
}
