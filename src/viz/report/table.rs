//! Tables, written once and rendered as HTML, Markdown and text.

use crate::viz::ticks::number;
use comfy_table::CellAlignment;
use maud::{Markup, html};
use std::fmt::Write;

/// Which number of a column is the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Best {
    /// The largest.
    Highest,
    /// The smallest.
    Lowest,
    /// The one closest to 1, as of a ratio to the truth.
    NearestToOne,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Emphasis {
    None,
    Strong,
    Code,
}

/// Words with emphasis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Text(Vec<(Emphasis, String)>);

impl Text {
    /// The name of something in a program or file.
    pub(crate) fn code(text: impl Into<String>) -> Self {
        Self(vec![(Emphasis::Code, text.into())])
    }

    /// More words, in bold if `strong`.
    #[must_use]
    pub(crate) fn and(mut self, text: impl Into<String>, strong: bool) -> Self {
        self.0.push((if strong { Emphasis::Strong } else { Emphasis::None }, text.into()));
        self
    }

    pub(super) fn html(&self) -> Markup {
        html! {
            @for (emphasis, text) in &self.0 {
                @match emphasis {
                    Emphasis::None => { (text) }
                    Emphasis::Strong => { strong { (text) } }
                    Emphasis::Code => { code { (text) } }
                }
            }
        }
    }

    fn markdown(&self) -> String {
        let span = |(emphasis, text): &(Emphasis, String)| match emphasis {
            Emphasis::None => text.replace('|', "\\|"),
            Emphasis::Strong => format!("**{text}**"),
            Emphasis::Code => format!("`{text}`"),
        };
        self.0.iter().map(span).collect()
    }

    fn plain(&self) -> String {
        self.0.iter().map(|(_, text)| text.as_str()).collect()
    }
}

impl<T: Into<String>> From<T> for Text {
    fn from(text: T) -> Self {
        Self::default().and(text, false)
    }
}

/// The head of a column and how its entries are set.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Column {
    name: Text,
    unit: String,
    decimals: Option<usize>,
    best: Option<Best>,
}

impl Column {
    /// A column of words, set to the left.
    pub(crate) fn text(name: impl Into<Text>) -> Self {
        Self { name: name.into(), unit: String::new(), decimals: None, best: None }
    }

    /// A column of numbers with `decimals` decimals, set to the right.
    pub(crate) fn number(name: impl Into<Text>, decimals: usize) -> Self {
        Self { decimals: Some(decimals), ..Self::text(name) }
    }

    /// The unit beside or below the name.
    #[must_use]
    pub(crate) fn unit(self, unit: impl Into<String>) -> Self {
        Self { unit: unit.into(), ..self }
    }

    /// Sets the best number in bold; all of them when several look the same at the column's decimals.
    #[must_use]
    pub(crate) fn best(self, best: Best) -> Self {
        Self { best: Some(best), ..self }
    }

    fn head(&self, name: String) -> String {
        if self.unit.is_empty() { name } else { format!("{name}, {}", self.unit) }
    }
}

/// One cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Entry {
    /// Words.
    Text(Text),
    /// A number; one that is not finite is written out and never the best.
    Number(f64),
    /// Mean and standard deviation; the mean decides which is the best.
    Spread(f64, f64),
    /// Nothing was measured: a dash.
    Missing,
}

impl From<Text> for Entry {
    fn from(text: Text) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Entry {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl From<String> for Entry {
    fn from(text: String) -> Self {
        Self::Text(text.into())
    }
}

impl From<f64> for Entry {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<usize> for Entry {
    fn from(count: usize) -> Self {
        Self::Number(count as f64)
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

    /// With a hyphen for a minus and a missing value, as plain files have it.
    fn plain(&self, column: &Column, words: fn(&Text) -> String) -> String {
        let figure = |value: f64| match column.decimals {
            Some(decimals) => format!("{value:.decimals$}"),
            None => value.to_string(),
        };
        match self {
            Self::Text(text) => words(text),
            Self::Number(value) => figure(*value),
            Self::Spread(mean, deviation) => format!("{} ± {}", figure(*mean), figure(*deviation)),
            Self::Missing => "-".to_owned(),
        }
    }
}

/// Rows under columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Entry>>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub(crate) fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self { caption: String::new(), columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// The rows of a table of CSV under the names of its header, `_` read as a space. Columns of numbers keep the decimals that
    /// they have, at most four.
    #[must_use]
    pub(crate) fn of_csv(text: &str) -> Self {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let heads: Vec<String> =
            reader.headers().into_iter().flatten().map(|name| name.replace('_', " ")).collect();
        let rows: Vec<csv::StringRecord> = reader.records().filter_map(std::result::Result::ok).collect();
        let columns = heads.into_iter().enumerate().map(|(i, head)| {
            let fields = || rows.iter().filter_map(|row| row.get(i)).filter(|field| !field.is_empty());
            if fields().any(|field| field.parse::<f64>().is_err()) || fields().next().is_none() {
                return Column::text(head);
            }
            let decimals = |field: &str| field.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            Column::number(head, fields().map(decimals).max().unwrap_or(0).min(4))
        });
        let table = Self::new(columns);
        let entry = |(field, column): (&str, &Column)| match column.decimals {
            Some(_) => Entry::from(field.parse::<f64>().ok()),
            None => Entry::from(field),
        };
        let rows = rows.iter().map(|row| row.iter().zip(&table.columns).map(entry).collect::<Vec<Entry>>());
        let rows = rows.collect();
        Self { rows, ..table }
    }

    /// The words above the table.
    #[must_use]
    pub(crate) fn caption(self, caption: impl Into<String>) -> Self {
        Self { caption: caption.into(), ..self }
    }

    /// One more row.
    ///
    /// # Panics
    /// When it has more or fewer entries than the table has columns.
    #[must_use]
    pub(crate) fn row<T: Into<Entry>>(mut self, entries: impl IntoIterator<Item = T>) -> Self {
        let row: Vec<Entry> = entries.into_iter().map(Into::into).collect();
        assert_eq!(row.len(), self.columns.len(), "a row has one entry for each column");
        self.rows.push(row);
        self
    }

    pub(super) fn html(&self) -> Markup {
        let best: Vec<Option<f64>> = (0..self.columns.len()).map(|i| self.distance_of_best(i)).collect();
        let is_best =
            |i: usize, entry: &Entry| best[i].is_some() && self.columns[i].distance(entry) == best[i];
        html! {
            div.scroll {
                table {
                    @if !self.caption.is_empty() { caption { (self.caption) } }
                    thead {
                        tr {
                            @for column in &self.columns {
                                th scope="col" class=[column.decimals.map(|_| "number")] {
                                    (column.name.html())
                                    @if !column.unit.is_empty() { span.unit { (column.unit) } }
                                }
                            }
                        }
                    }
                    tbody {
                        @for row in &self.rows {
                            tr {
                                @for (i, (entry, column)) in row.iter().zip(&self.columns).enumerate() {
                                    @let class = match (column.decimals.is_some(), is_best(i, entry)) {
                                        (true, true) => Some("number best"),
                                        (true, false) => Some("number"),
                                        _ => None,
                                    };
                                    td class=[class] { (column.set(entry)) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// As Markdown, the caption as a paragraph before it.
    #[must_use]
    pub(crate) fn markdown(&self) -> String {
        let mut text = String::new();
        if !self.caption.is_empty() {
            let _ = writeln!(text, "{}\n", self.caption);
        }
        let heads: Vec<String> = self.columns.iter().map(|c| c.head(c.name.markdown())).collect();
        let mut line = |cells: &[String]| {
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        };
        line(&heads);
        line(&vec!["---".to_owned(); heads.len()]);
        self.rows.iter().for_each(|row| line(&self.cells(row, Text::markdown)));
        text
    }

    /// As text in columns, for a terminal.
    #[must_use]
    pub(crate) fn text(&self) -> String {
        let mut table = comfy_table::Table::new();
        table.load_style(comfy_table::presets::NOTHING);
        table.set_header(self.columns.iter().map(|c| c.head(c.name.plain())));
        self.rows.iter().for_each(|row| {
            table.add_row(self.cells(row, Text::plain));
        });
        for (i, column) in self.columns.iter().enumerate() {
            if let Some(set) = table.column_mut(i) {
                set.set_padding((if i == 0 { 0 } else { 1 }, 1));
                if column.decimals.is_some() {
                    set.set_cell_alignment(CellAlignment::Right);
                }
            }
        }
        let caption = if self.caption.is_empty() { String::new() } else { format!("{}\n", self.caption) };
        caption + &table.trim_fmt()
    }

    fn cells(&self, row: &[Entry], words: fn(&Text) -> String) -> Vec<String> {
        row.iter().zip(&self.columns).map(|(entry, column)| entry.plain(column, words)).collect()
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

    fn set(&self, entry: &Entry) -> Markup {
        let figure = |value: f64| match (value.is_finite(), self.decimals) {
            (true, Some(decimals)) => number(value, decimals),
            (true, None) => value.to_string(),
            (false, _) if value.is_nan() => "not a number".to_owned(),
            (false, _) => if value > 0.0 { "∞" } else { "−∞" }.to_owned(),
        };
        match entry {
            Entry::Text(text) => text.html(),
            Entry::Number(value) => html! { (figure(*value)) },
            Entry::Spread(mean, sd) => html! { (figure(*mean)) span.spread { " ± " (figure(*sd)) } },
            Entry::Missing => html! { "–" },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_in_both_languages() {
        let table = Table::new([Column::text("system"), Column::number("PSNR", 2).unit("dB")])
            .row([Entry::from(Text::code("laplace")), Entry::from(31.187)]);
        assert_eq!(table.markdown(), "| system | PSNR, dB |\n| --- | --- |\n| `laplace` | 31.19 |\n");
        assert_eq!(table.text(), "system   PSNR, dB\nlaplace     31.19");
    }

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
        let html = scores().html().into_string();
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
    fn one_table_reads_the_same_in_all_three() {
        let table = Table::new([Column::text("system"), Column::text("SSIM / PSNR")]).caption("Means");
        let entry = Text::default().and("0.9", true).and(" / 30", false);
        let table = table.row([Text::code("a|b"), entry]).row(["a|b", "-"]);
        assert_eq!(
            table.markdown(),
            "Means\n\n| system | SSIM / PSNR |\n| --- | --- |\n| `a|b` | **0.9** / 30 |\n| a\\|b | - |\n"
        );
        let html = table.html().into_string();
        assert!(html.contains("<code>a|b</code>") && html.contains("<strong>0.9</strong> / 30"), "{html}");
        assert_eq!(table.text(), "Means\nsystem  SSIM / PSNR\na|b     0.9 / 30\na|b     -");
    }

    #[test]
    fn a_table_of_csv_has_its_columns() {
        let table = Table::of_csv("style,peak_mb,seconds\none,120,0.5\ntwo,,12.25\n");
        let expected =
            "| style | peak mb | seconds |\n| --- | --- | --- |\n| one | 120 | 0.50 |\n| two | - | 12.25 |\n";
        assert_eq!(table.markdown(), expected);
        assert!(table.html().into_string().contains("<td class=\"number\">12.25</td>"));
    }

    #[test]
    #[should_panic(expected = "one entry for each column")]
    fn a_short_row_is_a_bug() {
        let _ = scores().row(["alone"]);
    }
}
