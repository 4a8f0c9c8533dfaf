//! The scores of an experiment: a row per system, area, patch, sketch and seed, in memory and as CSV.
//!
//! `scores.csv` holds nothing that differs from run to run (times are elsewhere). Numbers are written with eight significant
//! digits, so that reading them back and writing them again gives the same bytes.

use crate::error::{Error, Result};
use crate::file::csv_lines;
use serde::ser::SerializeSeq;
use serde::{Deserialize, Serialize, Serializer};
use std::path::Path;

/// What a row is about.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Key {
    /// The system.
    pub(crate) system: String,
    /// The area.
    pub(crate) area: String,
    /// First row of the patch in the area.
    pub(crate) row: usize,
    /// First column.
    pub(crate) col: usize,
    /// The seed.
    pub(crate) seed: u64,
    /// The sketch that the system was given.
    pub(crate) sketch: String,
}

/// A system's scores on one patch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ScoreRow {
    /// What it is about.
    pub(crate) key: Key,
    /// Metres of the unit interval: the patch's range.
    #[serde(serialize_with = "number")]
    pub(crate) relief: f64,
    /// Share of the patch's cells that carry a line.
    #[serde(serialize_with = "number")]
    pub(crate) line_share: f64,
    /// A value for each column of the table; `None` where there is no such score.
    #[serde(serialize_with = "numbers")]
    pub(crate) values: Vec<Option<f64>>,
    /// Why there are no scores, on one line; empty when there are.
    pub(crate) error: String,
}

/// A finished row with the seconds that it took.
pub(crate) type Timed = (ScoreRow, f64);

/// Rows under columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ScoreTable {
    /// Names of the scores.
    pub(crate) columns: Vec<String>,
    /// The rows.
    pub(crate) rows: Vec<ScoreRow>,
}

const FIRST: [&str; 8] = ["system", "area", "row", "col", "seed", "sketch", "relief_m", "line_share"];

/// Eight significant digits, in the shortest way; nothing for nothing.
fn digits(value: Option<f64>) -> String {
    let rounded = |v: f64| if v.is_finite() { format!("{v:.7e}").parse().unwrap_or(v) } else { v };
    value.map_or_else(String::new, |v| rounded(v).to_string())
}

fn number<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&digits(Some(*value)))
}

fn numbers<S: Serializer>(values: &[Option<f64>], serializer: S) -> Result<S::Ok, S::Error> {
    let mut list = serializer.serialize_seq(Some(values.len()))?;
    values.iter().try_for_each(|value| list.serialize_element(&digits(*value)))?;
    list.end()
}

impl ScoreRow {
    /// A row without scores.
    #[must_use]
    pub(crate) fn failed(key: Key, columns: usize, error: &str) -> Self {
        let error = error.replace(['\n', '\r'], " ");
        Self { key, relief: 0.0, line_share: 0.0, values: vec![None; columns], error }
    }

    /// The row in the fields of a line with `columns` scores.
    ///
    /// # Errors
    /// When a field is missing or not what it should be.
    pub(crate) fn read(line: &csv::StringRecord, columns: usize) -> Result<Self> {
        let expected = FIRST.len() + columns + 1;
        if line.len() != expected {
            return Err(Error::value("number of fields", line.len(), format!("allowed: {expected}")));
        }
        let (key, relief, line_share): (Key, f64, f64) =
            line.deserialize(None).map_err(|e| complaint(&e, line))?;
        let value = |text: &str| {
            if text.is_empty() {
                return Ok(None);
            }
            text.parse()
                .map(Some)
                .map_err(|_| Error::value("score", format!("{text:?}"), "allowed: a number"))
        };
        let values = line.iter().skip(FIRST.len()).take(columns).map(value).collect::<Result<_>>()?;
        let error = line.get(expected - 1).unwrap_or_default().to_owned();
        Ok(Self { key, relief, line_share, values, error })
    }
}

/// What is wrong with a line, with the field.
pub(super) fn complaint(error: &csv::Error, line: &csv::StringRecord) -> Error {
    let field = match error.kind() {
        csv::ErrorKind::Deserialize { err, .. } => err.field().and_then(|i| line.get(i as usize)),
        _ => None,
    };
    let found = field.map_or_else(|| "damaged".to_owned(), |text| format!("{text:?}"));
    Error::value("field", found, format!("the reader says: {error}"))
}

impl ScoreTable {
    /// The table as CSV, a header first.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn to_csv(&self) -> Result<String> {
        let columns = self.columns.iter().map(String::as_str);
        let header: Vec<&str> = FIRST.into_iter().chain(columns).chain(["error"]).collect();
        Ok(csv_lines([header])? + &csv_lines(&self.rows)?)
    }

    /// Reads a table back.
    ///
    /// # Errors
    /// When the text is not such a table; the message names the line.
    pub(crate) fn of_csv(path: &Path, text: &str) -> Result<Self> {
        let bad = |line: usize, e: &dyn std::fmt::Display| {
            let allowed = "allowed: a table of scores as `experiment run` writes it";
            Error::file(path, format!("line {line}"), e, allowed)
        };
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let head = reader.headers().map_err(|e| bad(1, &e))?.clone();
        let names: Vec<&str> = head.iter().collect();
        let columns = match names.strip_prefix(&FIRST) {
            Some([columns @ .., "error"]) if !columns.is_empty() => columns,
            _ => return Err(bad(1, &names.join(","))),
        };
        let rows = reader.records().enumerate().map(|(i, line)| {
            let line = line.map_err(|e| bad(i + 2, &e))?;
            ScoreRow::read(&line, columns.len()).map_err(|e| bad(i + 2, &e))
        });
        Ok(Self {
            rows: rows.collect::<Result<_>>()?,
            columns: columns.iter().map(|&n| n.to_owned()).collect(),
        })
    }

    /// Place of a column.
    #[must_use]
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }
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
        let failed = ScoreRow::failed(key(u64::MAX), 4, "a \"quoted\",\nbroken line");
        ScoreTable { columns: ["a", "b", "c", "d"].map(str::to_owned).to_vec(), rows: vec![scored, failed] }
    }

    #[test]
    fn writing_and_reading_settles_at_once() {
        let text = table().to_csv().unwrap();
        let expected = "gnn+a,alps,128,0,1,\"order 3, thin\",1234.5,0.33333333,0.3,,inf,0.00000032,\n";
        assert_eq!(text.split_inclusive('\n').nth(1), Some(expected));
        let back = ScoreTable::of_csv(Path::new("scores.csv"), &text).unwrap();
        assert_eq!(back.to_csv().unwrap(), text);
        assert_eq!(back.rows[0].values, [Some(0.3), None, Some(f64::INFINITY), Some(3.2e-7)]);
        assert_eq!(back.rows[1].error, "a \"quoted\", broken line");
        assert_eq!(back.rows[1].key, table().rows[1].key);
        assert_eq!(back.column("c"), Some(2));
    }

    #[test]
    fn damage_is_found_and_named() {
        let text = table().to_csv().unwrap();
        let refused = |text: &str| ScoreTable::of_csv(Path::new("s.csv"), text).unwrap_err().to_string();
        assert!(refused("").contains("line 1"));
        assert!(refused("system,area\n").contains("line 1"));
        let message = refused(&text.replace(",128,", ",many,"));
        assert!(message.contains("s.csv: line 2") && message.contains("many"), "{message}");
        assert!(refused(&text[..text.len() - 30]).contains("line 3"));
    }
}
