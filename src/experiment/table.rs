//! Rows of scores as a table: mean and spread per system, and CSV.

use super::Row;
use crate::metrics::{Scores, Summary};
use std::fmt::Write;

/// One system over all its patches.
#[derive(Clone, Debug)]
pub struct Line {
    /// The system.
    pub system: String,
    /// Patches scored.
    pub patches: usize,
    /// Patches on which it failed.
    pub failed: usize,
    /// Mean seconds a patch.
    pub seconds: f64,
    /// Mean and spread of every score.
    pub summary: Summary,
}

/// A line per system, in the order of first appearance.
#[must_use]
pub fn aggregate(rows: &[Row]) -> Vec<Line> {
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.system.as_str()) {
            names.push(&row.system);
        }
    }
    let line = |name: &&str| {
        let of_system: Vec<&Row> = rows.iter().filter(|row| row.system == *name).collect();
        let scores: Vec<Scores> = of_system.iter().filter_map(|row| row.scores.clone()).collect();
        Line {
            system: (*name).to_owned(),
            patches: scores.len(),
            failed: of_system.len() - scores.len(),
            seconds: of_system.iter().map(|row| row.seconds).sum::<f64>() / of_system.len() as f64,
            summary: Summary::of(&scores),
        }
    };
    names.iter().map(line).collect()
}

/// Comma-separated values with a header: a line per row, empty fields where a score is missing.
#[must_use]
pub fn to_csv(rows: &[Row]) -> String {
    let names = rows.iter().find_map(|row| row.scores.as_ref()).map(Scores::values);
    let mut text = String::from("row,col,system,seconds,relief_m,line_share");
    for (name, _) in names.iter().flatten() {
        let _ = write!(text, ",{name}");
    }
    text.push_str(",error\n");
    for row in rows {
        let _ = write!(
            text,
            "{},{},{},{:.4},{:.2},{:.4}",
            row.row, row.col, row.system, row.seconds, row.relief, row.line_share
        );
        match &row.scores {
            Some(scores) => {
                for (_, value) in scores.values() {
                    text.push(',');
                    if let Some(value) = value {
                        let _ = write!(text, "{value:.6}");
                    }
                }
            }
            None => names.iter().flatten().for_each(|_| text.push(',')),
        }
        let error = row.error.as_deref().unwrap_or("").replace('"', "\"\"");
        let _ = writeln!(text, ",{}", if error.is_empty() { String::new() } else { format!("\"{error}\"") });
    }
    text
}
