//! The table of protocols whose scores need no table of their own: a row for each sketch and system.

use crate::experiment::protocol::Finding;
use crate::experiment::results::Results;
use crate::experiment::scores::lower_is_better;
use crate::viz::report::{Column, Entry, Table, Text};

/// The head of a score: its name and which way is better.
pub(super) fn head(metric: &str) -> Column {
    Column::text(format!("{metric}{}", if lower_is_better(metric) { " (less is better)" } else { "" }))
}

/// A row for each sketch and system, the mean of all areas; of each area's style apart if `by_style`.
pub(super) fn means(results: &Results<'_>, by_style: bool) -> Vec<Finding> {
    let spec = results.spec;
    let areas: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
    let mut heads = vec![Column::text("sketch"), Column::text("system")];
    heads.extend(spec.metrics.iter().map(|metric| head(metric)));
    if by_style {
        heads.insert(0, Column::text("style"));
    }
    let caption = format!("Mean of {} ({}):", areas.join(", "), results.seeds());
    let mut table = Table::new(heads).caption(caption);
    let styles: Vec<Option<&str>> = if by_style { areas.into_iter().map(Some).collect() } else { vec![None] };
    for style in styles {
        for sketch in &results.sketches {
            for system in &results.systems {
                let mut row: Vec<Entry> = style.map(Entry::from).into_iter().collect();
                row.extend([Entry::from(sketch.as_str()), Entry::from(Text::code(system))]);
                row.extend(spec.metrics.iter().map(|metric| {
                    Entry::from(results.stat(system, style, sketch, metric).map(|s| short(s.mean)))
                }));
                table = table.row(row);
            }
        }
    }
    vec![Finding::Table(table)]
}

/// Four digits behind the point, or a power of ten for what would vanish.
fn short(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:.1e}") } else { format!("{value:.4}") }
}
