//! Scores of patches as a table: mean and spread per system, and CSV.

use super::PatchScore;
use crate::error::Result;
use crate::file::csv_lines;
use crate::metrics::{Scores, Summary};

/// One system over all its patches.
#[derive(Clone, Debug)]
pub struct SystemSummary {
    /// The system.
    pub system: String,
    /// Patches scored.
    pub patches: usize,
    /// Patches on which it failed.
    pub failed: usize,
    /// Mean seconds per patch.
    pub seconds: f64,
    /// Mean and spread of every score.
    pub summary: Summary,
}

/// One entry per system, in the order of first appearance.
#[must_use]
pub fn aggregate(rows: &[PatchScore]) -> Vec<SystemSummary> {
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.system.as_str()) {
            names.push(&row.system);
        }
    }
    let summarise = |name: &&str| {
        let of_system: Vec<&PatchScore> = rows.iter().filter(|row| row.system == *name).collect();
        let scores: Vec<Scores> = of_system.iter().filter_map(|row| row.scores.clone()).collect();
        SystemSummary {
            system: (*name).to_owned(),
            patches: scores.len(),
            failed: of_system.len() - scores.len(),
            seconds: of_system.iter().map(|row| row.seconds).sum::<f64>() / of_system.len() as f64,
            summary: Summary::of(&scores),
        }
    };
    names.iter().map(summarise).collect()
}

/// Comma-separated values with a header: one line per row, empty fields where a score is missing.
///
/// # Errors
/// When memory runs out.
pub(crate) fn to_csv(rows: &[PatchScore]) -> Result<String> {
    let known = rows.iter().any(|row| row.scores.is_some());
    let names: Vec<&str> = if known { Scores::names().to_vec() } else { Vec::new() };
    let first = ["row", "col", "system", "seconds", "relief_m", "line_share"];
    let header: Vec<&str> = first.into_iter().chain(names.iter().copied()).chain(["error"]).collect();
    let lines = rows.iter().map(|row| {
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
        let scores =
            row.scores.as_ref().map(|scores| scores.values().map(|(_, value)| number(value)).to_vec());
        let first = [row.row.to_string(), row.col.to_string(), row.system.clone()];
        let measured =
            [format!("{:.4}", row.seconds), format!("{:.2}", row.relief), format!("{:.4}", row.line_share)];
        let scores = scores.unwrap_or_else(|| vec![String::new(); names.len()]);
        [&first[..], &measured, &scores, &[row.error.clone().unwrap_or_default()]].concat()
    });
    Ok(csv_lines([header])? + &csv_lines(lines)?)
}
