//! As `neighbours`, with every patch of an area as the exemplar in turn: which one teaches well, and can that be told before?

use crate::dem::Normalization;
use crate::error::Result;
use crate::experiment::areas::Area;
use crate::experiment::protocol::{Finding, Finished, Plot, Protocol};
use crate::experiment::record::Record;
use crate::experiment::results::{Results, Stat, difference};
use crate::experiment::spec::AreaSpec;
use crate::extract;
use crate::metrics::{mean_square_slope, spearman};
use crate::viz::plot::Scatter;
use crate::viz::report::{Column, Entry, Table};
use serde::{Deserialize, Serialize};

/// The table of exemplars in the record.
const TABLE: &str = "exemplars.csv";

pub(super) struct Exemplar;

/// What could tell a good exemplar before any training: a row of `exemplars.csv`. Slopes are root mean squares.
#[derive(Clone, Serialize, Deserialize)]
struct ExemplarRow {
    area: String,
    terrain: String,
    row: usize,
    col: usize,
    relief_m: f64,
    slope_m_per_m: f64,
    unit_slope: f64,
    line_share: f64,
}

/// A statistic of an exemplar with its name.
type Statistic = (&'static str, fn(&ExemplarRow) -> f64);

const STATISTICS: [Statistic; 4] = [
    ("relief_m", |row| row.relief_m),
    ("slope_m_per_m", |row| row.slope_m_per_m),
    ("unit_slope", |row| row.unit_slope),
    ("line_share", |row| row.line_share),
];

/// An exemplar and how well the styles do that learned it.
struct ExemplarScore {
    /// The area of the experiment, which is one patch of a terrain.
    area: String,
    terrain: String,
    /// Mean over patches and seeds of the PSNR above the best interpolator of each patch; the PSNR without interpolators.
    score: f64,
}

/// A statistic of exemplars and how it goes with their scores.
struct Rule {
    statistic: Statistic,
    /// Spearman's rank correlation within each terrain, mean over terrains.
    correlation: f64,
    /// Terrains with at least three exemplars, over which the mean is.
    terrains: usize,
    /// The score that the exemplar with the highest value of the statistic (or the lowest, by the sign of the correlation)
    /// gets above the terrain's mean, mean over terrains.
    gain: f64,
}

impl Protocol for Exemplar {
    fn after_scoring(&self, finished: &Finished<'_>) -> Result<()> {
        let resolved = finished.resolved;
        let row = |(area, entry): (&Area, &AreaSpec)| {
            let dem = &area.source.dem;
            let range = Normalization::of(dem);
            let unit = range.normalize(dem);
            let lines = extract::ridges_and_valleys(&unit, dem.valid(), &resolved.spec.extraction)?;
            let (slope, relief) = (mean_square_slope(&unit).sqrt(), range.high() - range.low());
            let micro = |value: f64| (value * 1e6).round() / 1e6;
            Ok(ExemplarRow {
                area: area.name.clone(),
                terrain: entry.terrain.clone().unwrap_or_else(|| area.name.clone()),
                row: area.source.info.row,
                col: area.source.info.col,
                relief_m: (relief * 100.0).round() / 100.0,
                slope_m_per_m: micro(slope * relief / dem.cell_size().mean()),
                unit_slope: micro(slope),
                line_share: micro(lines.line_count() as f64 / unit.len() as f64),
            })
        };
        let rows = resolved.areas.iter().zip(&resolved.spec.area).map(row).collect::<Result<Vec<_>>>()?;
        finished.record.write_table(TABLE, &rows)
    }

    fn findings(&self, results: &Results<'_>, record: &Record) -> Result<Vec<Finding>> {
        let scores = scores(results);
        let heads = ["terrain", "exemplars", "best exemplar"].map(Column::text);
        let numbers = ["worst", "median", "best", "standard deviation"].map(|name| Column::number(name, 2));
        let caption = format!(
            "`{}`: {}, dB, mean over all other patches and {}, with every patch as the exemplar in turn:",
            results.highlight,
            what(results),
            results.seeds()
        );
        let mut table = Table::new(heads.into_iter().chain(numbers)).caption(caption);
        for terrain in terrains(&scores) {
            let mut of: Vec<_> = scores.iter().filter(|s| s.terrain == terrain).collect();
            of.sort_by(|a, b| a.score.total_cmp(&b.score));
            let Some(stat) = Stat::of(of.iter().map(|s| s.score)) else { continue };
            let (worst, median, best) = (of[0], of[of.len() / 2], of[of.len() - 1]);
            let numbers = [worst.score, median.score, best.score, stat.sd].map(Entry::from);
            let words = [terrain.to_owned(), of.len().to_string(), best.area.clone()].map(Entry::from);
            table = table.row(words.into_iter().chain(numbers));
        }
        let rules = rules(&scores, &record.table(TABLE)?);
        let caption = "What tells a good exemplar before any training (rank correlation with the score, mean over terrains; \
                       gain: the score of the exemplar so chosen above the mean):";
        let heads = ["statistic", "correlation", "terrains", "gain, dB"];
        let of_rules =
            rules.iter().fold(Table::new(heads.map(Column::text)).caption(caption), |table, rule| {
                let (correlation, gain) = (format!("{:+.2}", rule.correlation), format!("{:+.2}", rule.gain));
                table.row([
                    Entry::from(rule.statistic.0),
                    correlation.into(),
                    rule.terrains.to_string().into(),
                    gain.into(),
                ])
            });
        let mut findings = vec![Finding::Table(table)];
        findings.extend((!rules.is_empty()).then_some(Finding::Table(of_rules)));
        Ok(findings)
    }

    /// The statistic with the strongest rank correlation, and the score.
    fn plots(&self, results: &Results<'_>, record: &Record) -> Result<Vec<Plot>> {
        let (scores, known) = (scores(results), record.table::<ExemplarRow>(TABLE)?);
        if scores.is_empty() || known.is_empty() {
            return Ok(Vec::new());
        }
        let (name, value) = rules(&scores, &known).first().map_or(STATISTICS[0], |rule| rule.statistic);
        let y = format!("{}, dB", what(results));
        let mut plot = Scatter::new("Every patch as the exemplar", name.replace('_', " "), y);
        for terrain in terrains(&scores) {
            let of = scores.iter().filter(|s| s.terrain == terrain);
            let points =
                of.filter_map(|s| Some((value(known.iter().find(|row| row.area == s.area)?), s.score)));
            plot = plot.group(terrain, points);
        }
        let caption =
            "A point for each exemplar: the statistic with the strongest rank correlation, and the score.";
        Ok(vec![("exemplars".to_owned(), plot.draw()?, caption.to_owned())])
    }
}

fn what(results: &Results<'_>) -> &'static str {
    if results.interpolators().is_empty() { "PSNR" } else { "PSNR above the best interpolator of each patch" }
}

/// Every exemplar with its score, in the order of the file.
fn scores(results: &Results<'_>) -> Vec<ExemplarScore> {
    let sketch = &results.sketches[0];
    let one = |area: &AreaSpec| {
        let own = results.cells(&results.highlight, &area.name, sketch, "psnr");
        let best = results.best_of_each(&area.name, sketch, "psnr");
        let cells = if best.is_empty() { own } else { difference(&own, &best) };
        let score = Stat::of(cells.into_values())?.mean;
        let terrain = area.terrain.clone().unwrap_or_else(|| area.name.clone());
        Some(ExemplarScore { area: area.name.clone(), terrain, score })
    };
    results.spec.area.iter().filter_map(one).collect()
}

/// In the order of first appearance.
fn terrains(scores: &[ExemplarScore]) -> Vec<&str> {
    let mut terrains: Vec<&str> = Vec::new();
    for s in scores {
        if !terrains.contains(&s.terrain.as_str()) {
            terrains.push(&s.terrain);
        }
    }
    terrains
}

/// The rules that could choose an exemplar, the strongest first.
fn rules(scores: &[ExemplarScore], known: &[ExemplarRow]) -> Vec<Rule> {
    let mut terrains = terrains(scores);
    terrains.sort_unstable();
    let rule = |statistic: Statistic| {
        let pairs = |terrain: &&str| {
            let of = scores.iter().filter(|s| s.terrain == *terrain);
            let pair = |s: &ExemplarScore| {
                Some((statistic.1(known.iter().find(|row| row.area == s.area)?), s.score))
            };
            let pairs: Vec<(f64, f64)> = of.filter_map(pair).collect();
            Some((spearman(&pairs)?, pairs))
        };
        let sets: Vec<(f64, Vec<(f64, f64)>)> = terrains.iter().filter_map(pairs).collect();
        let correlation = Stat::of(sets.iter().map(|set| set.0))?.mean;
        let gain = |pairs: &[(f64, f64)]| {
            let mean = pairs.iter().map(|p| p.1).sum::<f64>() / pairs.len() as f64;
            let sign = if correlation < 0.0 { -1.0 } else { 1.0 };
            let chosen = pairs.iter().max_by(|a, b| (sign * a.0).total_cmp(&(sign * b.0)));
            chosen.map_or(0.0, |chosen| chosen.1 - mean)
        };
        let gain = sets.iter().map(|(_, pairs)| gain(pairs)).sum::<f64>() / sets.len() as f64;
        Some(Rule { statistic, correlation, terrains: sets.len(), gain })
    };
    let mut rules: Vec<Rule> = STATISTICS.into_iter().filter_map(rule).collect();
    rules.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    rules
}
