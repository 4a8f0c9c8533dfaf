//! The scores of an experiment: a row per system, area, patch, sketch and seed, in memory and as CSV.
//!
//! `scores.csv` holds nothing that differs from run to run (times are elsewhere). Numbers are written with eight significant
//! digits, so that reading them back and writing them again gives the same bytes.

use crate::error::{Error, Result};
use std::path::Path;

/// What a row is about.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    /// The system.
    pub system: String,
    /// The area.
    pub area: String,
    /// First row of the patch in the area.
    pub row: usize,
    /// First column.
    pub col: usize,
    /// The seed.
    pub seed: u64,
    /// The sketch that the system was given.
    pub sketch: String,
}

/// A system's scores on one patch.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoreRow {
    /// What it is about.
    pub key: Key,
    /// Metres of the unit interval: the patch's range.
    pub relief: f64,
    /// Share of the patch's cells that carry a line.
    pub line_share: f64,
    /// A value for each column of the table; `None` where there is no such score.
    pub values: Vec<Option<f64>>,
    /// Why there are no scores; empty when there are.
    pub error: String,
}

/// Rows under columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScoreTable {
    /// Names of the scores.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<ScoreRow>,
}

const FIRST: [&str; 8] = ["system", "area", "row", "col", "seed", "sketch", "relief_m", "line_share"];

/// A number as it is written: eight significant digits, in the shortest way.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    if value.is_finite() { format!("{value:.7e}").parse().unwrap_or(value) } else { value }
}

impl ScoreRow {
    /// The fields of the row's line.
    #[must_use]
    pub fn fields(&self) -> Vec<String> {
        let k = &self.key;
        let mut fields = vec![k.system.clone(), k.area.clone(), k.row.to_string(), k.col.to_string()];
        fields.extend([k.seed.to_string(), k.sketch.clone()]);
        fields.extend([rounded(self.relief).to_string(), rounded(self.line_share).to_string()]);
        fields.extend(self.values.iter().map(|v| v.map_or_else(String::new, |v| rounded(v).to_string())));
        fields.push(self.error.replace(['\n', '\r'], " "));
        fields
    }

    /// The row in the fields of a line with `columns` scores.
    ///
    /// # Errors
    /// When a field is missing or not what it should be.
    pub fn of_fields(fields: &[&str], columns: usize) -> Result<Self> {
        if fields.len() != FIRST.len() + columns + 1 {
            let allowed = format!("allowed: {}", FIRST.len() + columns + 1);
            return Err(Error::value("number of fields", fields.len(), allowed));
        }
        let key = Key {
            system: fields[0].to_owned(),
            area: fields[1].to_owned(),
            row: number(FIRST[2], fields[2])?,
            col: number(FIRST[3], fields[3])?,
            seed: number(FIRST[4], fields[4])?,
            sketch: fields[5].to_owned(),
        };
        let scores = &fields[FIRST.len()..FIRST.len() + columns];
        let value = |text: &&str| if text.is_empty() { Ok(None) } else { number("score", text).map(Some) };
        Ok(Self {
            key,
            relief: number(FIRST[6], fields[6])?,
            line_share: number(FIRST[7], fields[7])?,
            values: scores.iter().map(value).collect::<Result<_>>()?,
            error: fields[FIRST.len() + columns].to_owned(),
        })
    }
}

fn number<T: std::str::FromStr>(name: &str, text: &str) -> Result<T> {
    text.parse().map_err(|_| Error::value(name, format!("{text:?}"), "allowed: a number"))
}

impl ScoreTable {
    /// The table as CSV, a header first.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let columns = self.columns.iter().map(String::as_str);
        let header: Vec<&str> = FIRST.into_iter().chain(columns).chain(["error"]).collect();
        csv_lines(
            std::iter::once(header.into_iter().map(str::to_owned).collect())
                .chain(self.rows.iter().map(ScoreRow::fields)),
        )
    }

    /// Reads a table back.
    ///
    /// # Errors
    /// When the text is not such a table; the message names the line.
    pub fn of_csv(path: &Path, text: &str) -> Result<Self> {
        let bad = |line: usize, e: &dyn std::fmt::Display| {
            Error::file(
                path,
                format!("line {line}"),
                e,
                "allowed: a table of scores as `experiment run` writes it",
            )
        };
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
        let mut lines = reader.records();
        let header = lines.next().ok_or_else(|| bad(1, &"missing"))?.map_err(|e| bad(1, &e))?;
        let names: Vec<&str> = header.iter().collect();
        let is_table = names.len() > FIRST.len() + 1
            && names[..FIRST.len()] == FIRST
            && names[names.len() - 1] == "error";
        if !is_table {
            return Err(bad(1, &names.join(",")));
        }
        let columns: Vec<String> =
            names[FIRST.len()..names.len() - 1].iter().map(|&n| n.to_owned()).collect();
        let rows = lines.enumerate().map(|(i, line)| {
            let line = line.map_err(|e| bad(i + 2, &e))?;
            ScoreRow::of_fields(&line.iter().collect::<Vec<_>>(), columns.len()).map_err(|e| bad(i + 2, &e))
        });
        let rows = rows.collect::<Result<_>>()?;
        Ok(Self { columns, rows })
    }

    /// Place of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }
}

/// Lines of CSV, fields quoted where they must be.
///
/// # Panics
/// Never: memory takes every byte.
pub(super) fn csv_lines(lines: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for line in lines {
        writer.write_record(&line).expect("memory takes every line");
    }
    let bytes = writer.into_inner().expect("memory takes every byte");
    String::from_utf8(bytes).expect("the fields were text")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> ScoreTable {
        let key = |seed| Key {
            system: "gnn+a".into(),
            area: "alps".into(),
            row: 128,
            col: 0,
            seed,
            sketch: "order 3, thin".into(),
        };
        let scored = ScoreRow {
            key: key(1),
            relief: 1234.5,
            line_share: 1.0 / 3.0,
            values: vec![Some(0.1 + 0.2), None, Some(f64::INFINITY), Some(3.2e-7)],
            error: String::new(),
        };
        let failed = ScoreRow {
            key: key(u64::MAX),
            relief: 0.0,
            line_share: 0.0,
            values: vec![None; 4],
            error: "a \"quoted\",\nbroken line".into(),
        };
        ScoreTable { columns: ["a", "b", "c", "d"].map(str::to_owned).to_vec(), rows: vec![scored, failed] }
    }

    #[test]
    fn writing_and_reading_settles_at_once() {
        let path = Path::new("scores.csv");
        let text = table().to_csv();
        let back = ScoreTable::of_csv(path, &text).unwrap();
        assert_eq!(back.to_csv(), text);
        assert_eq!(back.rows[0].values, [Some(0.3), None, Some(f64::INFINITY), Some(3.2e-7)]);
        assert_eq!(back.rows[1].error, "a \"quoted\", broken line");
        assert_eq!(back.rows[1].key, table().rows[1].key);
        assert_eq!(back.column("c"), Some(2));
    }

    #[test]
    fn damage_is_found_and_named() {
        let text = table().to_csv();
        let refused = |text: &str| ScoreTable::of_csv(Path::new("s.csv"), text).unwrap_err().to_string();
        assert!(refused("").contains("line 1"));
        assert!(refused("system,area\n").contains("line 1"));
        let message = refused(&text.replace(",128,", ",many,"));
        assert!(message.contains("s.csv: line 2") && message.contains("many"), "{message}");
        assert!(refused(&text[..text.len() - 30]).contains("line 3"));
    }
}
