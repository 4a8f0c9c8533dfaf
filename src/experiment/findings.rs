//! What the scores say beyond means: where interpolators win and what is special there, and what tells a good exemplar.

use super::extras::EXEMPLAR_HEAD;
use super::record::Record;
use super::rows::ScoreTable;
use super::spec::{ExperimentSpec, Kind};
use super::summary::{Stat, Summaries, difference, of_patches};
use crate::error::Result;
use crate::metrics::BORDER_WIDTH;

/// A patch on which an interpolator has the higher PSNR.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// The area.
    pub area: String,
    /// First row and column of the patch.
    pub patch: (usize, usize),
    /// The sketch.
    pub sketch: String,
    /// PSNR less that of the best interpolator, dB, mean over seeds: below 0.
    pub margin: f64,
    /// The interpolator with the highest PSNR.
    pub winner: String,
    /// What may explain it.
    pub why: Why,
}

/// What is known of a patch and of the system's error there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Why {
    /// Range of heights, metres.
    pub relief: f64,
    /// Share of the cells that carry a line.
    pub line_share: f64,
    /// Share of the squared error that lies in the border strip.
    pub border_share: f64,
}

impl Why {
    fn mean(all: &[Self]) -> Option<Self> {
        let of = |f: fn(&Self) -> f64| {
            let values: Vec<f64> = all.iter().map(f).filter(|v| v.is_finite()).collect();
            Stat::of(&values).map(|stat| stat.mean)
        };
        Some(Self {
            relief: of(|w| w.relief)?,
            line_share: of(|w| w.line_share)?,
            border_share: of(|w| w.border_share)?,
        })
    }
}

/// The lost patches, the widest margin first, beside what lost and won patches look like.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Losses {
    /// The lost patches.
    pub lost: Vec<Loss>,
    /// Patches compared.
    pub all: usize,
    /// Means over the lost ones.
    pub of_lost: Option<Why>,
    /// Means over the others.
    pub of_won: Option<Why>,
}

/// Where an interpolator has the higher PSNR than the highlighted system.
///
/// # Errors
/// When the experiment names a system that there is not.
pub fn losses(spec: &ExperimentSpec, table: &ScoreTable, summaries: &Summaries<'_>) -> Result<Losses> {
    let highlight = spec.highlighted()?;
    let mut found = Losses::default();
    let (mut of_lost, mut of_won) = (Vec::new(), Vec::new());
    for (area, sketch) in
        spec.area.iter().flat_map(|a| spec.sketches().into_iter().map(move |s| (&a.name, s.name)))
    {
        let own = summaries.cells(&highlight, area, &sketch, "psnr");
        let best = summaries.best_of_each(area, &sketch, "psnr");
        for (patch, margin) in of_patches(&difference(&own, &best)) {
            let why = why(table, &highlight, area, patch, &sketch);
            found.all += 1;
            if margin >= 0.0 {
                of_won.push(why);
                continue;
            }
            of_lost.push(why);
            let at = |name: &String| {
                let patches = of_patches(&summaries.cells(name, area, &sketch, "psnr"));
                Some((name.clone(), *patches.get(&patch)?))
            };
            let winner = summaries.interpolators().iter().filter_map(at).max_by(|a, b| a.1.total_cmp(&b.1));
            let winner = winner.map(|(name, _)| name).unwrap_or_default();
            found.lost.push(Loss { area: area.clone(), patch, sketch: sketch.clone(), margin, winner, why });
        }
    }
    found.lost.sort_by(|a, b| a.margin.total_cmp(&b.margin));
    (found.of_lost, found.of_won) = (Why::mean(&of_lost), Why::mean(&of_won));
    Ok(found)
}

/// From the rows of the system on that patch.
fn why(table: &ScoreTable, system: &str, area: &str, patch: (usize, usize), sketch: &str) -> Why {
    let rows: Vec<_> = table
        .rows
        .iter()
        .filter(|r| r.error.is_empty() && (r.key.row, r.key.col) == patch)
        .filter(|r| {
            (r.key.system.as_str(), r.key.area.as_str(), r.key.sketch.as_str()) == (system, area, sketch)
        })
        .collect();
    let side = super::PATCH as f64;
    let inner = side - 2.0 * BORDER_WIDTH as f64;
    let strip = 1.0 - (inner / side).powi(2);
    let column = |name| table.column(name);
    let share = |row: &super::rows::ScoreRow| {
        let value = |name| column(name).and_then(|i| row.values[i]);
        let (border, all) = (value("border_psnr")?, value("psnr")?);
        Some(strip * 10f64.powf((all - border) / 10.0)).filter(|share| share.is_finite())
    };
    let mean = |values: Vec<f64>| Stat::of(&values).map_or(f64::NAN, |stat| stat.mean);
    Why {
        relief: mean(rows.iter().map(|r| r.relief).collect()),
        line_share: mean(rows.iter().map(|r| r.line_share).collect()),
        border_share: mean(rows.iter().filter_map(|r| share(r)).collect()),
    }
}

/// An exemplar and how well it taught.
#[derive(Clone, Debug, PartialEq)]
pub struct Taught {
    /// The area of the experiment, which is one patch of a terrain.
    pub area: String,
    /// The terrain.
    pub terrain: String,
    /// Mean over patches and seeds of the PSNR above the best interpolator of each patch; the PSNR without interpolators.
    pub score: f64,
}

/// Every exemplar of an `exemplar` experiment with its score, in the order of the file.
///
/// # Errors
/// As [`losses`].
pub fn taught(spec: &ExperimentSpec, summaries: &Summaries<'_>) -> Result<Vec<Taught>> {
    let (highlight, sketches) = (spec.highlighted()?, spec.sketches());
    let one = |area: &super::spec::AreaSpec| {
        let own = summaries.cells(&highlight, &area.name, &sketches[0].name, "psnr");
        let best = summaries.best_of_each(&area.name, &sketches[0].name, "psnr");
        let cells = if best.is_empty() { own } else { difference(&own, &best) };
        let score = Stat::of(&cells.into_values().collect::<Vec<_>>())?.mean;
        let terrain = area.terrain.clone().unwrap_or_else(|| area.name.clone());
        Some(Taught { area: area.name.clone(), terrain, score })
    };
    Ok(spec.area.iter().filter_map(one).collect())
}

/// A statistic of exemplars and how it goes with their scores.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The column of `exemplars.csv`.
    pub statistic: String,
    /// Spearman's rank correlation within each terrain, mean over terrains.
    pub correlation: f64,
    /// Terrains with at least three exemplars, over which the mean is.
    pub terrains: usize,
    /// The score that the exemplar with the highest value of the statistic (or the lowest, by the sign of the correlation)
    /// gets above the terrain's mean, mean over terrains.
    pub gain: f64,
}

/// The rules that could choose an exemplar, the strongest first.
///
/// # Errors
/// When the record cannot be read.
pub fn rules(spec: &ExperimentSpec, summaries: &Summaries<'_>, record: &Record) -> Result<Vec<Rule>> {
    let Some(known) = record.table("exemplars.csv", &EXEMPLAR_HEAD)? else { return Ok(Vec::new()) };
    if spec.kind != Kind::Exemplar {
        return Ok(Vec::new());
    }
    let taught = taught(spec, summaries)?;
    let mut terrains: Vec<&str> = taught.iter().map(|t| t.terrain.as_str()).collect();
    terrains.sort_unstable();
    terrains.dedup();
    let mut rules = Vec::new();
    for (column, statistic) in EXEMPLAR_HEAD.iter().enumerate().skip(4) {
        let mut sets = Vec::new();
        for terrain in &terrains {
            let pairs: Vec<(f64, f64)> = taught
                .iter()
                .filter(|t| t.terrain == *terrain)
                .filter_map(|t| {
                    let row = known.iter().find(|row| row[0] == t.area)?;
                    Some((row[column].parse().ok()?, t.score))
                })
                .collect();
            if let Some(correlation) = spearman(&pairs) {
                sets.push((correlation, pairs));
            }
        }
        let Some(mean) = Stat::of(&sets.iter().map(|s| s.0).collect::<Vec<_>>()) else { continue };
        let gain = |pairs: &[(f64, f64)]| {
            let average = pairs.iter().map(|p| p.1).sum::<f64>() / pairs.len() as f64;
            let sign = if mean.mean < 0.0 { -1.0 } else { 1.0 };
            let chosen = pairs.iter().max_by(|a, b| (sign * a.0).total_cmp(&(sign * b.0)));
            chosen.map_or(0.0, |chosen| chosen.1 - average)
        };
        let gain = sets.iter().map(|(_, pairs)| gain(pairs)).sum::<f64>() / sets.len() as f64;
        let statistic = (*statistic).to_owned();
        rules.push(Rule { statistic, correlation: mean.mean, terrains: sets.len(), gain });
    }
    rules.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    Ok(rules)
}

/// Spearman's rank correlation, ties at their mean rank; none for fewer than three pairs or when one side is constant.
#[must_use]
pub fn spearman(pairs: &[(f64, f64)]) -> Option<f64> {
    if pairs.len() < 3 {
        return None;
    }
    let ranks = |values: Vec<f64>| -> Vec<f64> {
        let below = |v: f64| values.iter().filter(|w| **w < v).count() as f64;
        let same = |v: f64| values.iter().filter(|w| **w == v).count() as f64;
        values.iter().map(|&v| below(v) + (same(v) - 1.0) / 2.0).collect()
    };
    let a = ranks(pairs.iter().map(|p| p.0).collect());
    let b = ranks(pairs.iter().map(|p| p.1).collect());
    let middle = (pairs.len() as f64 - 1.0) / 2.0;
    let product =
        |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - middle) * (b - middle)).sum() };
    let size = (product(&a, &a) * product(&b, &b)).sqrt();
    (size > 0.0).then(|| product(&a, &b) / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rank_correlation_is_the_textbook_one() {
        let up: Vec<(f64, f64)> = (0..5).map(|i| (f64::from(i), f64::from(i * i))).collect();
        assert!((spearman(&up).unwrap() - 1.0).abs() < 1e-12);
        // Ranks 1 2 3 4 5 against 2 1 4 3 5: 1 - 6 x 4 / (5 x 24).
        let mixed = [(1.0, 20.0), (2.0, 10.0), (3.0, 40.0), (4.0, 30.0), (5.0, 50.0)];
        assert!((spearman(&mixed).unwrap() - 0.8).abs() < 1e-12);
        assert_eq!(spearman(&[(1.0, 2.0), (2.0, 2.0), (3.0, 2.0)]), None);
        assert_eq!(spearman(&up[..2]), None);
    }
}
