//! The result table of a record as Markdown, and its place in a document.
//!
//! A document marks the place with the lines `<!-- experiment NAME -->` and `<!-- /experiment NAME -->`; what stands between them
//! is written by [`splice`], never by hand.

use super::record::Record;
use super::rows::ScoreTable;
use super::spec::{ExperimentSpec, Kind, lower_is_better};
use super::summary::{Stat, Summaries, better};
use crate::error::{Error, Result};
use crate::file;
use std::fmt::Write;
use std::path::Path;

/// Documents are short.
const LARGEST: u64 = 1 << 24;

/// The tables of an experiment, deciding nothing that the scores do not say.
///
/// # Errors
/// When the experiment names a system that there is not.
pub fn tables(spec: &ExperimentSpec, table: &ScoreTable) -> Result<String> {
    let summaries = Summaries::new(spec, table)?;
    let systems: Vec<String> =
        spec.systems()?.into_iter().filter(|s| !summaries.interpolators().contains(s)).collect();
    let mut text = String::new();
    let seeds = match spec.seeds.len() {
        1 => "1 seed".to_owned(),
        n => format!("{n} seeds"),
    };
    match spec.kind {
        Kind::Fit => fit(spec, &summaries, &systems, &seeds, &mut text),
        Kind::Ablation => ablation(spec, &summaries, &systems, &seeds, &mut text),
        Kind::Neighbours | Kind::Sparse => areas(spec, &summaries, &systems, &seeds, &mut text),
    }
    Ok(text)
}

/// A table for each sketch, a row an area: SSIM / PSNR of the best interpolator and of every style's systems.
fn areas(
    spec: &ExperimentSpec,
    summaries: &Summaries<'_>,
    systems: &[String],
    seeds: &str,
    text: &mut String,
) {
    for sketch in spec.sketches() {
        let name = &sketch.name;
        let _ = writeln!(text, "Sketch \"{name}\", SSIM / PSNR in dB, mean over patches and {seeds}:\n");
        let with_best = !summaries.interpolators().is_empty();
        let mut heads = vec!["area".to_owned(), "patches".to_owned()];
        if with_best {
            heads.push("best interpolator".to_owned());
        }
        heads.extend(systems.iter().map(|s| format!("`{s}`")));
        row(text, &heads);
        row(text, &vec!["---".to_owned(); heads.len()]);
        let names = spec.area.iter().map(|area| Some(area.name.as_str()));
        for area in names.chain((spec.area.len() > 1).then_some(None)) {
            let best = |metric: &str| {
                summaries.best_interpolator(area, name, metric).map(|(who, value)| (who.to_owned(), value))
            };
            let stat = |system: &str, metric: &str| match area {
                Some(area) => summaries.of_area(system, area, name, metric),
                None => summaries.of_all(system, name, metric),
            };
            let patches = match area {
                Some(area) => {
                    let cells = systems.iter().map(|s| summaries.cells(s, area, name, "ssim"));
                    let n = cells.map(|c| super::summary::of_patches(&c).len()).max().unwrap_or(0);
                    n.to_string()
                }
                None => String::new(),
            };
            let mut line = vec![area.unwrap_or("mean of areas").to_owned(), patches];
            if with_best {
                line.push(match (best("ssim"), best("psnr")) {
                    (Some(a), Some(b)) => format!("{:.4} ({}) / {:.2} ({})", a.1, a.0, b.1, b.0),
                    _ => "-".to_owned(),
                });
            }
            for system in systems {
                let shown = |metric: &str, digits: usize| {
                    stat(system, metric).map_or_else(
                        || "-".to_owned(),
                        |s| {
                            let wins = best(metric).is_some_and(|(_, b)| better(metric, s.mean, b));
                            let bold = if wins { "**" } else { "" };
                            format!("{bold}{:.digits$}{bold}", s.mean)
                        },
                    )
                };
                line.push(format!("{} / {}", shown("ssim", 4), shown("psnr", 2)));
            }
            row(text, &line);
        }
        text.push('\n');
    }
    if !summaries.interpolators().is_empty() {
        text.push_str("Bold: above every interpolator's mean.\n");
    }
}

/// A row an area and style: SSIM, PSNR and the losses.
fn fit(spec: &ExperimentSpec, summaries: &Summaries<'_>, systems: &[String], seeds: &str, text: &mut String) {
    let _ =
        writeln!(text, "Exemplars rebuilt from their own lines, mean ± standard deviation over {seeds}:\n");
    let metrics = [
        ("ssim", "SSIM"),
        ("psnr", "PSNR, dB"),
        ("l_gt", "l_gt, 1e-4"),
        ("train_l_gradient", "l_gradient, 1e-4"),
    ];
    let mut heads = vec!["area".to_owned(), "style".to_owned()];
    heads.extend(metrics.iter().map(|(_, head)| (*head).to_owned()));
    row(text, &heads);
    row(text, &vec!["---".to_owned(); heads.len()]);
    for area in &spec.area {
        for system in systems {
            let mut line = vec![area.name.clone(), format!("`{system}`")];
            for (metric, head) in metrics {
                let factor = if head.ends_with("1e-4") { 1e4 } else { 1.0 };
                let digits = if metric == "ssim" { 4 } else { 2 };
                let stat = summaries.of_area(system, &area.name, "exemplar", metric);
                line.push(stat.map_or_else(
                    || "-".to_owned(),
                    |s| format!("{:.digits$} ± {:.digits$}", factor * s.mean, factor * s.sd),
                ));
            }
            row(text, &line);
        }
    }
}

/// A row a system, for each sketch: the mean of all areas and what it changes against the baseline.
fn ablation(
    spec: &ExperimentSpec,
    summaries: &Summaries<'_>,
    systems: &[String],
    seeds: &str,
    text: &mut String,
) {
    let baseline =
        spec.baseline.clone().or_else(|| spec.highlight.clone()).unwrap_or_else(|| systems[0].clone());
    for sketch in spec.sketches() {
        let areas: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
        let _ = writeln!(
            text,
            "Sketch \"{}\", mean of {} ({seeds}), and the difference to `{baseline}`:\n",
            sketch.name,
            areas.join(", ")
        );
        let mut heads = vec!["system".to_owned()];
        heads.extend(
            spec.metrics
                .iter()
                .map(|m| format!("{m}{}", if lower_is_better(m) { " (less is better)" } else { "" })),
        );
        row(text, &heads);
        row(text, &vec!["---".to_owned(); heads.len()]);
        for system in systems {
            let mut line = vec![format!("`{system}`")];
            for metric in &spec.metrics {
                let of = |name: &str| summaries.of_all(name, &sketch.name, metric);
                line.push(match (of(system), of(&baseline)) {
                    (Some(Stat { mean, .. }), _) if *system == baseline => format!("{mean:.4}"),
                    (Some(own), Some(base)) => format!("{:.4} ({:+.4})", own.mean, own.mean - base.mean),
                    (Some(own), None) => format!("{:.4}", own.mean),
                    (None, _) => "-".to_owned(),
                });
            }
            row(text, &line);
        }
        text.push('\n');
    }
}

fn row(text: &mut String, cells: &[String]) {
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

/// What stands between the markers of a record in a document.
///
/// # Errors
/// When the record is not finished or cannot be read.
pub fn of_record(record: &Record) -> Result<String> {
    let machine = record.machine()?;
    let tables = tables(&record.spec()?, &record.scores()?)?;
    let revision = if machine.revision.is_empty() { "an unknown revision" } else { &machine.revision };
    Ok(format!("{}\nRevision {revision}.\n", tables.trim_end()))
}

/// The names of the experiments whose tables a document holds.
///
/// # Errors
/// When the file cannot be read, or a marker has no end.
pub fn markers(document: &Path) -> Result<Vec<String>> {
    let text = read(document)?;
    let names =
        text.lines().filter_map(|line| line.trim().strip_prefix("<!-- experiment ")?.strip_suffix(" -->"));
    names
        .map(|name| {
            between(&text, name).map(|_| name.to_owned()).ok_or_else(|| {
                Error::file(
                    document,
                    "marker",
                    format!("{name:?} without an end"),
                    format!("allowed: {} after it", end(name)),
                )
            })
        })
        .collect()
}

/// The experiments whose tables in a document are not what their records in the folder `records` say.
///
/// # Errors
/// When the document cannot be read or a marker has no end. A record that is not there makes its table stale.
pub fn stale(document: &Path, records: &Path) -> Result<Vec<String>> {
    let text = read(document)?;
    let is_stale = |name: &String| {
        let content = of_record(&Record::new(&records.join(name))).ok();
        content.is_none_or(|content| spliced(&text, name, &content).is_none_or(|new| new != text))
    };
    Ok(markers(document)?.into_iter().filter(is_stale).collect())
}

/// Puts `content` between the markers of `name`; tells whether that changed the document.
///
/// # Errors
/// When the document has no such markers, or cannot be read or written.
pub fn splice(document: &Path, name: &str, content: &str) -> Result<bool> {
    let text = read(document)?;
    let Some(spliced) = spliced(&text, name, content) else {
        let allowed = format!("allowed: a document with the lines {} and {}", begin(name), end(name));
        return Err(Error::file(document, "marker", "missing", allowed));
    };
    if spliced == text {
        return Ok(false);
    }
    file::write_bytes(document, spliced.as_bytes())?;
    Ok(true)
}

fn spliced(text: &str, name: &str, content: &str) -> Option<String> {
    let (start, stop) = between(text, name)?;
    Some(format!("{}\n{}\n\n{}", &text[..start], content.trim_end(), &text[stop..]))
}

fn begin(name: &str) -> String {
    format!("<!-- experiment {name} -->")
}

fn end(name: &str) -> String {
    format!("<!-- /experiment {name} -->")
}

/// Bytes between the end of the first marker's line and the second marker.
fn between(text: &str, name: &str) -> Option<(usize, usize)> {
    let start = text.find(&begin(name))? + begin(name).len();
    let start = start + text[start..].find('\n')? + 1;
    let stop = start + text[start..].find(&end(name))?;
    Some((start, stop))
}

fn read(path: &Path) -> Result<String> {
    String::from_utf8(file::read_whole(path, LARGEST)?)
        .map_err(|e| Error::file(path, "text", e, "allowed: UTF-8"))
}
