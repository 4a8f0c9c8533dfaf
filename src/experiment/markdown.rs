//! The result table of a record as Markdown, and its place in a document.
//!
//! A document marks the place with the lines `<!-- experiment NAME -->` and `<!-- /experiment NAME -->`; what stands between them
//! is written by [`splice`], never by hand.

use super::extras::STAGE_HEAD;
use super::findings::{self, Why};
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
        Kind::Neighbours | Kind::Sparse | Kind::Cost => {
            areas(spec, &summaries, &systems, &seeds, &mut text);
            losses(spec, table, &summaries, &mut text)?;
        }
        Kind::Exemplar => exemplars(spec, &summaries, &seeds, &mut text)?,
        Kind::Exchange | Kind::Drawings | Kind::Invariance | Kind::Disentanglement => {
            general(spec, &summaries, &seeds, &mut text)?;
        }
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

/// Lost patches in a document.
const LISTED: usize = 10;

/// On which patches an interpolator wins, and what is special there.
fn losses(
    spec: &ExperimentSpec,
    table: &ScoreTable,
    summaries: &Summaries<'_>,
    text: &mut String,
) -> Result<()> {
    if summaries.interpolators().is_empty() {
        return Ok(());
    }
    let found = findings::losses(spec, table, summaries)?;
    let highlight = spec.highlighted()?;
    let _ = writeln!(
        text,
        "\nAn interpolator has the higher PSNR than `{highlight}` on {} of {} patches and sketches (mean over seeds).",
        found.lost.len(),
        found.all
    );
    let mean = |name: &str, why: Option<Why>| {
        why.map(|w| {
            format!(
                "{name}: relief {:.0} m, lines on {:.1} % of the cells, {:.0} % of the squared error in the 8-cell border. ",
                w.relief,
                100.0 * w.line_share,
                100.0 * w.border_share
            )
        })
        .unwrap_or_default()
    };
    if found.lost.is_empty() {
        return Ok(());
    }
    let means = format!("{}{}", mean("Lost", found.of_lost), mean("Won", found.of_won));
    let _ = writeln!(text, "{}\n", means.trim_end());
    row(
        text,
        &["area", "patch", "sketch", "dB", "who", "relief, m", "lines, %", "error in the border, %"]
            .map(str::to_owned),
    );
    row(text, &vec!["---".to_owned(); 8]);
    for loss in found.lost.iter().take(LISTED) {
        let w = loss.why;
        row(
            text,
            &[
                loss.area.clone(),
                format!("{}, {}", loss.patch.0, loss.patch.1),
                loss.sketch.clone(),
                format!("{:.2}", loss.margin),
                loss.winner.clone(),
                format!("{:.0}", w.relief),
                format!("{:.1}", 100.0 * w.line_share),
                format!("{:.0}", 100.0 * w.border_share),
            ],
        );
    }
    Ok(())
}

/// A row a terrain: how much depends on which patch is the exemplar.
fn exemplars(spec: &ExperimentSpec, summaries: &Summaries<'_>, seeds: &str, text: &mut String) -> Result<()> {
    let taught = findings::taught(spec, summaries)?;
    let what = if summaries.interpolators().is_empty() {
        "PSNR"
    } else {
        "PSNR above the best interpolator of each patch"
    };
    let _ = writeln!(
        text,
        "`{}`: {what}, dB, mean over all other patches and {seeds}, with every patch as the exemplar in turn:\n",
        spec.highlighted()?
    );
    let heads = ["terrain", "exemplars", "worst", "median", "best", "standard deviation", "best exemplar"];
    row(text, &heads.map(str::to_owned));
    row(text, &vec!["---".to_owned(); heads.len()]);
    let mut terrains: Vec<&str> = Vec::new();
    for t in &taught {
        if !terrains.contains(&t.terrain.as_str()) {
            terrains.push(&t.terrain);
        }
    }
    for terrain in terrains {
        let mut of: Vec<_> = taught.iter().filter(|t| t.terrain == terrain).collect();
        of.sort_by(|a, b| a.score.total_cmp(&b.score));
        let Some(stat) = Stat::of(&of.iter().map(|t| t.score).collect::<Vec<_>>()) else { continue };
        let (worst, best) = (of[0], of[of.len() - 1]);
        row(
            text,
            &[
                terrain.to_owned(),
                of.len().to_string(),
                format!("{:.2}", worst.score),
                format!("{:.2}", of[of.len() / 2].score),
                format!("{:.2}", best.score),
                format!("{:.2}", stat.sd),
                best.area.clone(),
            ],
        );
    }
    Ok(())
}

/// A row for each sketch and system, the mean of all areas.
fn general(spec: &ExperimentSpec, summaries: &Summaries<'_>, seeds: &str, text: &mut String) -> Result<()> {
    let areas: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
    let _ = writeln!(text, "Mean of {} ({seeds}):\n", areas.join(", "));
    let mut heads = vec!["sketch".to_owned(), "system".to_owned()];
    heads.extend(
        spec.metrics
            .iter()
            .map(|m| format!("{m}{}", if lower_is_better(m) { " (less is better)" } else { "" })),
    );
    if spec.kind == Kind::Exchange {
        heads.insert(0, "style".to_owned());
    }
    row(text, &heads);
    row(text, &vec!["---".to_owned(); heads.len()]);
    let styles: Vec<Option<&str>> =
        if spec.kind == Kind::Exchange { areas.iter().map(|a| Some(*a)).collect() } else { vec![None] };
    for style in styles {
        for sketch in spec.sketches() {
            for system in spec.systems()? {
                let mut line: Vec<String> = style.map(str::to_owned).into_iter().collect();
                line.extend([sketch.name.clone(), format!("`{system}`")]);
                for metric in &spec.metrics {
                    let stat = match style {
                        Some(area) => summaries.of_area(&system, area, &sketch.name, metric),
                        None => summaries.of_all(&system, &sketch.name, metric),
                    };
                    line.push(stat.map_or_else(|| "-".to_owned(), |s| short(s.mean)));
                }
                row(text, &line);
            }
        }
    }
    Ok(())
}

/// Four digits behind the point, or a power of ten for what would vanish.
fn short(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:.1e}") } else { format!("{value:.4}") }
}

/// What tells a good exemplar; empty for other kinds.
fn rules(spec: &ExperimentSpec, table: &ScoreTable, record: &Record) -> Result<String> {
    let rules = findings::rules(spec, &Summaries::new(spec, table)?, record)?;
    let mut text = String::new();
    if rules.is_empty() {
        return Ok(text);
    }
    text.push_str("\nWhat tells a good exemplar before any training (rank correlation with the score, mean over terrains; gain: the score of the exemplar so chosen above the mean):\n\n");
    row(&mut text, &["statistic", "correlation", "terrains", "gain, dB"].map(str::to_owned));
    row(&mut text, &vec!["---".to_owned(); 4]);
    for rule in rules {
        let cells =
            [format!("{:+.2}", rule.correlation), rule.terrains.to_string(), format!("{:+.2}", rule.gain)];
        row(&mut text, &[vec![rule.statistic], cells.to_vec()].concat());
    }
    Ok(text)
}

/// Seconds of each stage; empty for other kinds.
fn stages(record: &Record) -> Result<String> {
    let mut text = String::new();
    for (name, title) in [("stages.csv", "Here"), ("peers.csv", "Others on this machine")] {
        let Some(rows) = record.table(name, &STAGE_HEAD)? else { continue };
        let _ = writeln!(text, "\n{title}, seconds and peak memory of the process up to then:\n");
        row(&mut text, &["stage", "system", "n", "s", "MB"].map(str::to_owned));
        row(&mut text, &vec!["---".to_owned(); 5]);
        rows.iter().for_each(|cells| row(&mut text, cells));
    }
    Ok(text)
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
    let (spec, scores) = (record.spec()?, record.scores()?);
    let tables = format!("{}{}{}", tables(&spec, &scores)?, rules(&spec, &scores, record)?, stages(record)?);
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
