//! A record as one HTML page that can be read alone, with its plots as SVG files beside it.
//!
//! Everything on the page comes from the record's files, so that it can be made again without running anything.

use super::bounds;
use super::pictures::plain;
use super::protocol::{Finding, Plot};
use super::protocols;
use super::record::{MachineInfo, Record, TrainingRow};
use super::results::Results;
use crate::error::Result;
use crate::file::{self, csv_table};
use crate::metrics::{decimals, lower_is_better, title};
use crate::viz::Picture;
use crate::viz::plot::{Better, ScorePlot, Svg};
use crate::viz::report::{Best, Column, Entry, Report, Table};
use std::path::PathBuf;
use std::time::Duration;

/// Largest picture of a record, bytes.
const LARGEST_PICTURE: u64 = 1 << 26;
/// Metrics that get a plot.
const PLOTTED: usize = 4;

/// Writes `report.html` and `plots/*.svg`; the path of the page.
///
/// # Errors
/// When the record is not finished, or a file cannot be read or written.
pub(crate) fn write(record: &Record) -> Result<PathBuf> {
    let (spec, table) = (record.spec()?, record.scores()?);
    let (machine, training) = (record.machine()?, record.table("training.csv")?);
    let results = Results::new(&spec, &table)?;
    let html = draw(&results, record, &machine, &training)?;
    let path = record.path("report.html");
    file::write_bytes(&path, html.as_bytes())?;
    Ok(path)
}

fn draw(
    results: &Results<'_>,
    record: &Record,
    machine: &MachineInfo,
    training: &[TrainingRow],
) -> Result<String> {
    let (spec, protocol) = (results.spec, protocols::of(results.spec.kind));
    file::remove(&record.path("plots"))?;
    file::create_folder(&record.path("plots"))?;
    let mut report = Report::new(&spec.title).summary(&spec.question).summary(conditions(results, machine));
    report = report.section("Results");
    let analysis = if spec.analysis.trim().is_empty() { "Not written yet." } else { &spec.analysis };
    for paragraph in analysis.split("\n\n") {
        report = report.paragraph(paragraph.replace('\n', " ").trim());
    }
    for finding in protocol.findings(results, record)? {
        report = match finding {
            Finding::Words(words) => report.paragraph(words),
            Finding::Table(table) => report.table(&table),
        };
    }
    if !spec.bound.is_empty() {
        report = report.table(&bounds_table(results)?);
    }
    if !spec.printed.is_empty() {
        report = report.table(&printed(results));
    }
    let plots = [distributions(results)?, printed_plots(results)?, protocol.plots(results, record)?].concat();
    for (name, plot, caption) in plots {
        plot.write(&record.path("plots").join(format!("{name}.svg")))?;
        report = report.figure(plot, caption);
    }
    report = report.section("Scores");
    for area in results.areas() {
        report = report.table(&scores(results, area));
    }
    let files = record.list("pictures")?;
    if !files.is_empty() {
        report = report.section("Pictures").paragraph(protocol.about_pictures());
    }
    for path in files {
        let bytes = file::read_whole(&path, LARGEST_PICTURE)?;
        let picture = Picture::from_png(&bytes).map_err(|e| e.in_file(&path))?;
        let name = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        report = report.figure(picture, name);
    }
    let seconds: f64 = machine.session.iter().map(|s| s.seconds).sum();
    let sessions = machine.session.iter().enumerate().map(|(i, s)| {
        let (n, trained, rows, jobs, threads) = (i + 1, s.trained, s.rows, s.jobs, s.threads);
        let what =
            format!("session {n}: {trained} styles trained, {rows} rows, {jobs} jobs, {threads} threads");
        (what, Duration::from_secs_f64(s.seconds.max(0.0)))
    });
    let caption = "Every training; times are those of the machine and its other work.";
    Ok(report
        .section("Training")
        .table(&Table::of_csv(&csv_table(training)?).caption(caption))
        .section("Cost and conditions")
        .paragraph(format!(
            "{:.1} minutes in {} sessions; the budget is {} minutes.",
            seconds / 60.0,
            machine.session.len(),
            spec.budget_minutes
        ))
        .time_spent(sessions)
        .commands(["monadnock experiment run resolved.toml --out again", "cmp scores.csv again/scores.csv"])
        .subsection("The experiment as it was run")
        .listing(spec.to_toml())
        .finish())
}

fn conditions(results: &Results<'_>, machine: &MachineInfo) -> String {
    let rows = &results.table.rows;
    let seeds: Vec<String> = results.spec.seeds.iter().map(u64::to_string).collect();
    let vector =
        if machine.vector.is_empty() { String::new() } else { format!(", vectors {}", machine.vector) };
    format!(
        "{} areas, seeds {}, {} rows of which {} failed. monadnock {}, revision {}; {}, {} cores, {} MB{vector}.",
        results.spec.area.len(),
        seeds.join(", "),
        rows.len(),
        rows.iter().filter(|row| !row.error.is_empty()).count(),
        machine.version,
        if machine.revision.is_empty() { "unknown" } else { &machine.revision },
        machine.system,
        machine.cores,
        machine.memory_mb
    )
}

fn bounds_table(results: &Results<'_>) -> Result<Table> {
    let columns = ["Expected", "Found", "Where it is tightest", "Kept", "Why expected"];
    let mut table = Table::new(columns.map(Column::text)).caption("What was expected of the result.");
    for verdict in bounds::check(results.spec, results.table)? {
        let found = verdict.worst.map_or_else(|| "nothing to check".to_owned(), |w| format!("{w:.5}"));
        let kept = match (verdict.is_kept(), verdict.checked) {
            (true, _) => "yes".to_owned(),
            (false, n) => format!("NO: {} of {n} broken, {} failed", verdict.broken, verdict.failures),
        };
        table = table.row([verdict.bound, found, verdict.place, kept, verdict.reason]);
    }
    Ok(table)
}

fn printed(results: &Results<'_>) -> Table {
    let highlight = &results.highlight;
    let caption =
        format!("Beside printed numbers: {highlight}, mean ± standard deviation over patches and seeds.");
    let heads = ["Source", "Area", "Score", "Printed", "Here", "Mind"];
    let mut table = Table::new(heads.map(Column::text)).caption(caption);
    for p in &results.spec.printed {
        let digits = decimals(&p.metric);
        let here = results.stat(highlight, Some(&p.area), &results.sketches[0], &p.metric);
        let here =
            here.map_or_else(|| "–".to_owned(), |s| format!("{:.digits$} ± {:.digits$}", s.mean, s.sd));
        let sd = p.sd.map(|sd| format!(" ± {sd}")).unwrap_or_default();
        let printed = format!("{}{sd}", p.value);
        table =
            table.row([p.source.clone(), p.area.clone(), title(&p.metric), printed, here, p.note.clone()]);
    }
    table
}

/// Every system with every sketch in an area, or in the mean of all of them.
fn scores(results: &Results<'_>, area: Option<&str>) -> Table {
    let spec = results.spec;
    let with_sketch = results.sketches.len() > 1;
    let mut columns = vec![Column::text("System"), Column::number("n", 0)];
    if with_sketch {
        columns.insert(0, Column::text("Sketch"));
    }
    columns.extend(spec.metrics.iter().map(|metric| {
        let column = Column::number(title(metric), decimals(metric));
        match metric.as_str() {
            // The best of a column means something on equal terms only.
            _ if with_sketch => column,
            "mean_slope_ratio" => column.best(Best::NearestToOne),
            m if lower_is_better(m) => column.best(Best::Lowest),
            _ => column.best(Best::Highest),
        }
    }));
    let seeds = spec.seeds.len();
    let caption = match area {
        Some(area) => format!("{area}: mean ± standard deviation over n cells (patches x {seeds} seeds)."),
        None => "Mean ± standard deviation of the areas' means; n areas.".to_owned(),
    };
    let mut table = Table::new(columns).caption(caption);
    for sketch in &results.sketches {
        for system in &results.systems {
            let stat = |metric: &String| results.stat(system, area, sketch, metric);
            let mut entries: Vec<Entry> =
                if with_sketch { vec![Entry::from(sketch.as_str())] } else { Vec::new() };
            entries.push(Entry::from(system.as_str()));
            entries.push(Entry::from(stat(&spec.metrics[0]).map_or(0, |s| s.n)));
            entries.extend(spec.metrics.iter().map(|m| Entry::from(stat(m).map(|s| (s.mean, s.sd)))));
            table = table.row(entries);
        }
    }
    table
}

/// A plot of sets of scores, those that are empty left out; none when all of them are.
fn score_plot(
    words: String,
    metric: &str,
    highlight: &str,
    sets: impl Iterator<Item = (String, Vec<f64>)>,
    marks: impl Iterator<Item = (String, f64)>,
) -> Result<Option<Svg>> {
    let better = if lower_is_better(metric) { Better::Lower } else { Better::Higher };
    let mut plot = ScorePlot::new(words, title(metric), better).decimals(decimals(metric));
    let mut any = false;
    for (name, values) in sets.filter(|(_, values)| !values.is_empty()) {
        any = true;
        if name == highlight {
            plot = plot.highlight(name.clone());
        }
        plot = plot.system(name, values);
    }
    plot = marks.fold(plot, |plot, (name, value)| plot.mark(name, value));
    any.then(|| plot.draw()).transpose()
}

/// The first metrics: systems beside each other, or for several sketches the highlighted system's sketches.
fn distributions(results: &Results<'_>) -> Result<Vec<Plot>> {
    let (spec, highlight) = (results.spec, &results.highlight);
    let mut plots = Vec::new();
    for metric in spec.metrics.iter().take(PLOTTED) {
        let (plot, name, caption) = if let [sketch] = results.sketches.as_slice() {
            let sets = results.systems.iter().map(|s| (s.clone(), results.values(s, sketch, metric)));
            let plot = score_plot(spec.title.clone(), metric, highlight, sets, std::iter::empty())?;
            (
                plot,
                format!("{metric}-{}", plain(sketch)),
                "of every patch and seed, all areas together".to_owned(),
            )
        } else {
            let sets = results.sketches.iter().map(|s| (s.clone(), results.values(highlight, s, metric)));
            let plot = score_plot(spec.title.clone(), metric, highlight, sets, std::iter::empty())?;
            let words = format!("of {highlight}: a row for each sketch, all areas together");
            (plot, format!("{metric}-sketches"), words)
        };
        let caption = format!("{} {caption}. Box: quartiles and median; diamond: mean.", title(metric));
        plots.extend(plot.map(|plot| (name, plot, caption)));
    }
    Ok(plots)
}

/// The scores of an area beside printed numbers: a plot for each area and score that was printed.
fn printed_plots(results: &Results<'_>) -> Result<Vec<Plot>> {
    let mut plots: Vec<Plot> = Vec::new();
    let sketch = &results.sketches[0];
    for p in &results.spec.printed {
        let name = format!("printed-{}-{}", plain(&p.area), plain(&p.metric));
        if plots.iter().any(|(known, ..)| *known == name) {
            continue;
        }
        let same = results.spec.printed.iter().filter(|q| (&q.area, &q.metric) == (&p.area, &p.metric));
        let notes: Vec<&str> = same.clone().map(|q| q.note.as_str()).collect();
        let marks = same.map(|q| (format!("{}: {}", q.source, q.value), q.value));
        let cells = |s: &String| results.cells(s, &p.area, sketch, &p.metric).into_values().collect();
        let sets = results.systems.iter().map(|s| (s.clone(), cells(s)));
        let words = format!("{}, sketch \"{sketch}\"", p.area);
        let plot = score_plot(words, &p.metric, &results.highlight, sets, marks)?;
        let caption =
            format!("Every patch and seed; the line is the printed mean. Mind: {}.", notes.join("; "));
        plots.extend(plot.map(|plot| (name, plot, caption)));
    }
    Ok(plots)
}
