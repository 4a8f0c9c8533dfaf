//! Tables whose best numbers stand out.

use super::markup::escape;
use crate::viz::ticks::number;

/// Which number of a column is the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Best {
    /// The largest.
    Highest,
    /// The smallest.
    Lowest,
    /// The one closest to 1, as of a ratio to the truth.
    NearestToOne,
}

/// The head of a column and how its entries are set.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    name: String,
    unit: String,
    decimals: Option<usize>,
    best: Option<Best>,
}

impl Column {
    /// A column of words, set to the left.
    pub fn text(name: impl Into<String>) -> Self {
        Self { name: name.into(), unit: String::new(), decimals: None, best: None }
    }

    /// A column of numbers with `decimals` decimals, set to the right.
    pub fn number(name: impl Into<String>, decimals: usize) -> Self {
        Self { decimals: Some(decimals), ..Self::text(name) }
    }

    /// The unit below the name.
    #[must_use]
    pub fn unit(self, unit: impl Into<String>) -> Self {
        Self { unit: unit.into(), ..self }
    }

    /// Sets the best number in bold; all of them when several look the same at the column's decimals.
    #[must_use]
    pub fn best(self, best: Best) -> Self {
        Self { best: Some(best), ..self }
    }
}

/// One cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// Words.
    Text(String),
    /// A number; one that is not finite is written out and never the best.
    Number(f64),
    /// Mean and standard deviation; the mean decides which is the best.
    Spread(f64, f64),
    /// Nothing was measured: a dash.
    Missing,
}

impl From<&str> for Entry {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Entry {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Entry {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<(f64, f64)> for Entry {
    /// (mean, standard deviation).
    fn from((mean, deviation): (f64, f64)) -> Self {
        Self::Spread(mean, deviation)
    }
}

impl<T: Into<Entry>> From<Option<T>> for Entry {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

impl Entry {
    fn value(&self) -> Option<f64> {
        match *self {
            Self::Number(value) | Self::Spread(value, _) if value.is_finite() => Some(value),
            _ => None,
        }
    }
}

/// Rows under columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Entry>>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self { caption: String::new(), columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// The words above the table.
    #[must_use]
    pub fn caption(self, caption: impl Into<String>) -> Self {
        Self { caption: caption.into(), ..self }
    }

    /// One more row.
    ///
    /// # Panics
    /// When it has more or fewer entries than the table has columns.
    #[must_use]
    pub fn row<T: Into<Entry>>(mut self, entries: impl IntoIterator<Item = T>) -> Self {
        let row: Vec<Entry> = entries.into_iter().map(Into::into).collect();
        assert_eq!(row.len(), self.columns.len(), "a row has one entry for each column");
        self.rows.push(row);
        self
    }

    pub(super) fn html(&self) -> String {
        let mut html = String::from("<div class=\"scroll\"><table>");
        if !self.caption.is_empty() {
            html += &format!("<caption>{}</caption>", escape(&self.caption));
        }
        html += "<thead><tr>";
        for column in &self.columns {
            let class = if column.decimals.is_some() { " class=\"number\"" } else { "" };
            let unit = match column.unit.as_str() {
                "" => String::new(),
                unit => format!("<span class=\"unit\">{}</span>", escape(unit)),
            };
            html += &format!("<th scope=\"col\"{class}>{}{unit}</th>", escape(&column.name));
        }
        html += "</tr></thead>\n<tbody>\n";
        let best: Vec<Option<f64>> = (0..self.columns.len()).map(|i| self.distance_of_best(i)).collect();
        for row in &self.rows {
            html += "<tr>";
            for (i, (entry, column)) in row.iter().zip(&self.columns).enumerate() {
                let chosen = column.best.is_some() && best[i].is_some() && column.distance(entry) == best[i];
                let class = match (column.decimals.is_some(), chosen) {
                    (true, true) => " class=\"number best\"",
                    (true, false) => " class=\"number\"",
                    _ => "",
                };
                html += &format!("<td{class}>{}</td>", column.set(entry));
            }
            html += "</tr>\n";
        }
        html + "</tbody></table></div>\n"
    }

    fn distance_of_best(&self, column: usize) -> Option<f64> {
        let distances = self.rows.iter().filter_map(|row| self.columns[column].distance(&row[column]));
        distances.min_by(f64::total_cmp)
    }
}

impl Column {
    /// How far the entry, as it is written, is from the best imaginable: less is better.
    fn distance(&self, entry: &Entry) -> Option<f64> {
        let tens = 10f64.powi(i32::try_from(self.decimals?).ok()?);
        let shown = (entry.value()? * tens).round();
        Some(match self.best? {
            Best::Highest => -shown,
            Best::Lowest => shown,
            Best::NearestToOne => (shown - tens).abs(),
        })
    }

    fn set(&self, entry: &Entry) -> String {
        let figure = |value: f64| match (value.is_finite(), self.decimals) {
            (true, Some(decimals)) => number(value, decimals),
            (true, None) => value.to_string(),
            (false, _) if value.is_nan() => "not a number".to_owned(),
            (false, _) => if value > 0.0 { "∞" } else { "−∞" }.to_owned(),
        };
        match entry {
            Entry::Text(text) => escape(text),
            Entry::Number(value) => figure(*value),
            Entry::Spread(mean, deviation) => {
                format!("{}<span class=\"spread\"> ± {}</span>", figure(*mean), figure(*deviation))
            }
            Entry::Missing => "–".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores() -> Table {
        Table::new([
            Column::text("System"),
            Column::number("SSIM", 3).best(Best::Highest),
            Column::number("Error", 1).unit("m").best(Best::Lowest),
            Column::number("Slope ratio", 2).best(Best::NearestToOne),
        ])
        .row([Entry::from("laplace"), (0.8141, 0.03).into(), 12.0.into(), 0.70.into()])
        .row([Entry::from("<ours>"), (0.8574, 0.02).into(), 9.04.into(), 1.05.into()])
        .row([Entry::from("other"), (0.8572, 0.04).into(), f64::NAN.into(), 0.94.into()])
        .row([Entry::from("failed"), Entry::Missing, Entry::Missing, Entry::Missing])
    }

    #[test]
    fn the_best_of_each_column_stands_out_and_ties_share() {
        let html = scores().html();
        let best: Vec<&str> = html
            .match_indices("number best\">")
            .map(|(at, m)| &html[at + m.len()..at + m.len() + 5])
            .collect();
        // .857 twice (equal at three decimals), 9.0 m, 1.05 (.94 is farther from 1).
        assert_eq!(best, ["0.857", "9.0</", "1.05<", "0.857"]);
        assert!(html.contains("&lt;ours&gt;") && html.contains("not a number") && html.contains("–"));
        assert!(html.contains("0.814<span class=\"spread\"> ± 0.030</span>"));
    }

    #[test]
    #[should_panic(expected = "one entry for each column")]
    fn a_short_row_is_a_bug() {
        let _ = scores().row(["alone"]);
    }
}
