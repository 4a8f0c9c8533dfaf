//! On which patches an interpolator wins, and what is special there.

use crate::evaluate::PATCH;
use crate::experiment::protocol::Finding;
use crate::experiment::results::{Results, Stat, difference, of_patches};
use crate::experiment::rows::ScoreRow;
use crate::metrics::BORDER_WIDTH;
use crate::viz::report::{Column, Entry, Table};

/// Lost patches that are listed.
const LISTED: usize = 10;

/// A patch on which an interpolator has the higher PSNR.
struct Loss {
    area: String,
    /// First row and column.
    patch: (usize, usize),
    sketch: String,
    /// PSNR less that of the best interpolator, dB, mean over seeds: below 0.
    margin: f64,
    /// The interpolator with the highest PSNR.
    winner: String,
    profile: Profile,
}

/// What is known of a patch and of the system's error there.
#[derive(Clone, Copy)]
struct Profile {
    /// Range of heights, metres.
    relief: f64,
    /// Share of the cells that carry a line.
    line_share: f64,
    /// Share of the squared error that lies in the border strip.
    border_share: f64,
}

impl Profile {
    /// The mean of several, in words after `name`; nothing of none.
    fn words(name: &str, all: &[Self]) -> Option<String> {
        let mean = |f: fn(&Self) -> f64| Stat::of(all.iter().map(f).filter(|v| v.is_finite()));
        Some(format!(
            "{name}: relief {:.0} m, lines on {:.1} % of the cells, {:.0} % of the squared error in the 8-cell border.",
            mean(|p| p.relief)?.mean,
            100.0 * mean(|p| p.line_share)?.mean,
            100.0 * mean(|p| p.border_share)?.mean
        ))
    }

    /// From the rows of a system on a patch.
    fn of(results: &Results<'_>, rows: &[&ScoreRow]) -> Self {
        let inner = (PATCH - 2 * BORDER_WIDTH) as f64;
        let strip = 1.0 - (inner / PATCH as f64).powi(2);
        let share = |row: &&ScoreRow| {
            let value = |name| results.table.column(name).and_then(|i| row.values[i]);
            let (border, all) = (value("border_psnr")?, value("psnr")?);
            Some(strip * 10f64.powf((all - border) / 10.0)).filter(|share| share.is_finite())
        };
        let mean = |values: Vec<f64>| Stat::of(values).map_or(f64::NAN, |stat| stat.mean);
        Self {
            relief: mean(rows.iter().map(|r| r.relief).collect()),
            line_share: mean(rows.iter().map(|r| r.line_share).collect()),
            border_share: mean(rows.iter().filter_map(share).collect()),
        }
    }
}

/// How many patches are lost to an interpolator, what they look like, and the widest margins. Nothing without interpolators.
pub(super) fn findings(results: &Results<'_>) -> Vec<Finding> {
    if results.interpolators().is_empty() || results.table.column("psnr").is_none() {
        return Vec::new();
    }
    let (mut lost, mut of_lost, mut of_won) = (Vec::new(), Vec::new(), Vec::new());
    for area in &results.spec.area {
        for sketch in &results.sketches {
            let cells = |system: &str| results.cells(system, &area.name, sketch, "psnr");
            let best = results.best_of_each(&area.name, sketch, "psnr");
            for (patch, margin) in of_patches(&difference(&cells(&results.highlight), &best)) {
                let rows = results.rows(&results.highlight, &area.name, sketch);
                let is_here = |r: &&&ScoreRow| r.error.is_empty() && (r.key.row, r.key.col) == patch;
                let here: Vec<&ScoreRow> = rows.iter().filter(is_here).copied().collect();
                let profile = Profile::of(results, &here);
                if margin >= 0.0 {
                    of_won.push(profile);
                    continue;
                }
                of_lost.push(profile);
                let score = |name: &String| Some((name.clone(), *of_patches(&cells(name)).get(&patch)?));
                let scores = results.interpolators().iter().filter_map(score);
                let winner =
                    scores.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(name, _)| name).unwrap_or_default();
                let (area, sketch) = (area.name.clone(), sketch.clone());
                lost.push(Loss { area, patch, sketch, margin, winner, profile });
            }
        }
    }
    lost.sort_by(|a, b| a.margin.total_cmp(&b.margin));
    let mut words = format!(
        "An interpolator has the higher PSNR than `{}` on {} of {} patches and sketches (mean over seeds).",
        results.highlight,
        lost.len(),
        lost.len() + of_won.len()
    );
    if lost.is_empty() {
        return vec![Finding::Words(words)];
    }
    let means = [Profile::words("Lost", &of_lost), Profile::words("Won", &of_won)];
    words += &format!("\n{}", means.into_iter().flatten().collect::<Vec<_>>().join(" "));
    let heads = [
        Column::text("area"),
        Column::text("patch"),
        Column::text("sketch"),
        Column::number("dB", 2),
        Column::text("who"),
        Column::number("relief", 0).unit("m"),
        Column::number("lines", 1).unit("%"),
        Column::number("error in the border", 0).unit("%"),
    ];
    let table = lost.iter().take(LISTED).fold(Table::new(heads), |table, loss| {
        let p = loss.profile;
        table.row([
            Entry::from(loss.area.as_str()),
            Entry::from(format!("{}, {}", loss.patch.0, loss.patch.1)),
            Entry::from(loss.sketch.as_str()),
            Entry::from(loss.margin),
            Entry::from(loss.winner.as_str()),
            Entry::from(p.relief),
            Entry::from(100.0 * p.line_share),
            Entry::from(100.0 * p.border_share),
        ])
    });
    vec![Finding::Words(words), Finding::Table(table)]
}
