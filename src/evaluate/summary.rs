//! Scores of patches as a table: mean and spread per system, and CSV.

use super::PatchScore;
use crate::error::{Error, Result};
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
pub fn to_csv(rows: &[PatchScore]) -> Result<String> {
    let failed = |e: csv::Error| Error::value("table of scores", e, "allowed: what can be written as CSV");
    let mut writer = csv::Writer::from_writer(Vec::new());
    let known = rows.iter().any(|row| row.scores.is_some());
    let names: Vec<&str> = if known { Scores::names().to_vec() } else { Vec::new() };
    let first = ["row", "col", "system", "seconds", "relief_m", "line_share"];
    writer.write_record(first.into_iter().chain(names.iter().copied()).chain(["error"])).map_err(failed)?;
    for row in rows {
        let mut fields = vec![row.row.to_string(), row.col.to_string(), row.system.clone()];
        fields.extend([
            format!("{:.4}", row.seconds),
            format!("{:.2}", row.relief),
            format!("{:.4}", row.line_share),
        ]);
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
        match &row.scores {
            Some(scores) => fields.extend(scores.values().map(|(_, value)| number(value))),
            None => fields.extend(names.iter().map(|_| String::new())),
        }
        fields.push(row.error.clone().unwrap_or_default());
        writer.write_record(&fields).map_err(failed)?;
    }
    let bytes = writer.into_inner().map_err(|e| failed(e.into_error().into()))?;
    String::from_utf8(bytes).map_err(|e| Error::value("table of scores", e, "allowed: text"))
}
