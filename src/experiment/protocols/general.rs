//! The table of protocols whose scores need no table of their own: a row for each sketch and system.

use crate::experiment::protocol::Finding;
use crate::experiment::results::Results;
use crate::metrics::lower_is_better;
use crate::viz::report::{Column, Entry, Table, Text};

/// The head of a score: its name and which way is better.
fn head(metric: &str) -> Column {
    Column::text(format!("{metric}{}", if lower_is_better(metric) { " (less is better)" } else { "" }))
}

/// A row for each sketch and system, the mean of all areas; of each area's style apart if `by_style`.
pub(super) fn means(results: &Results<'_>, by_style: bool) -> Vec<Finding> {
    let areas = || results.spec.area.iter().map(|area| Some(area.name.as_str()));
    let styles: Vec<Option<&str>> = if by_style { areas().collect() } else { vec![None] };
    let systems: Vec<&str> = results.systems.iter().map(String::as_str).collect();
    let entry = |system: &str, style: Option<&str>, sketch: &str, metric: &str| {
        Entry::from(results.stat(system, style, sketch, metric).map(|s| short(s.mean)))
    };
    table(results, &styles, &systems, "", entry)
}

/// A row for each sketch and system of a style, the mean of all areas and the difference to the baseline.
pub(super) fn beside_baseline(results: &Results<'_>) -> Vec<Finding> {
    let baseline = results.spec.baseline.as_ref().unwrap_or(&results.highlight);
    let entry = |system: &str, style: Option<&str>, sketch: &str, metric: &str| {
        let mean = |name: &str| results.stat(name, style, sketch, metric).map(|s| s.mean);
        let base = mean(baseline).filter(|_| system != baseline);
        Entry::from(mean(system).map(|own| match base {
            Some(base) => format!("{own:.4} ({:+.4})", own - base),
            None => format!("{own:.4}"),
        }))
    };
    table(results, &[None], &results.style_systems(), &format!(", and the difference to `{baseline}`"), entry)
}

fn table(
    results: &Results<'_>,
    styles: &[Option<&str>],
    systems: &[&str],
    what: &str,
    entry: impl Fn(&str, Option<&str>, &str, &str) -> Entry,
) -> Vec<Finding> {
    let spec = results.spec;
    let areas: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
    let with_style = styles.iter().any(Option::is_some);
    let first = with_style.then_some("style").into_iter().chain(["sketch", "system"]).map(Column::text);
    let caption = format!("Mean of {} ({}){what}:", areas.join(", "), results.seeds());
    let mut table = Table::new(first.chain(spec.metrics.iter().map(|metric| head(metric)))).caption(caption);
    for &style in styles {
        for sketch in &results.sketches {
            for system in systems {
                let mut row: Vec<Entry> = style.map(Entry::from).into_iter().collect();
                row.extend([Entry::from(sketch.as_str()), Entry::from(Text::code(*system))]);
                row.extend(spec.metrics.iter().map(|metric| entry(system, style, sketch, metric)));
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
