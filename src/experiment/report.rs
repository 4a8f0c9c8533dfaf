//! A record as one HTML page that can be read alone, with its plots as SVG files beside it.
//!
//! Everything on the page comes from the record's files, so that it can be made again without running anything.

use super::bounds;
use super::by_kind;
use super::findings;
use super::record::{MachineInfo, Record, TrainingRow};
use super::rows::ScoreTable;
use super::spec::{ExperimentSpec, Kind, lower_is_better};
use super::summary::{Stat, Summaries};
use crate::error::Result;
use crate::file;
use crate::viz::Picture;
use crate::viz::plot::{Better, Curves, Panel, ScorePlot, Svg};
use crate::viz::report::{Best, Column, Entry, Report, Table};
use std::path::PathBuf;
use std::time::Duration;

/// Largest picture of a record, bytes.
const LARGEST_PICTURE: u64 = 1 << 26;
/// Metrics that get a plot.
const PLOTTED: usize = 4;
/// Lost patches that are listed.
const LISTED: usize = 30;

/// Writes `report.html` and `plots/*.svg`; the path of the page.
///
/// # Errors
/// When the record is not finished, or a file cannot be read or written.
pub fn write(record: &Record) -> Result<PathBuf> {
    let (spec, table) = (record.spec()?, record.scores()?);
    let (machine, training) = (record.machine()?, record.training()?);
    let page = Page { spec: &spec, summaries: Summaries::new(&spec, &table)?, table: &table, record };
    let html = page.draw(&machine, &training)?;
    let path = record.path("report.html");
    file::write_bytes(&path, html.as_bytes())?;
    Ok(path)
}

pub(super) struct Page<'a> {
    pub(super) spec: &'a ExperimentSpec,
    pub(super) summaries: Summaries<'a>,
    table: &'a ScoreTable,
    pub(super) record: &'a Record,
}

/// The name of a score with its unit and how it is to be read.
pub(super) fn title(metric: &str) -> String {
    match metric {
        "ssim" => "SSIM".to_owned(),
        "psnr" => "PSNR, dB".to_owned(),
        "interior_ssim" => "SSIM without the 8-cell border".to_owned(),
        "interior_psnr" => "PSNR without the 8-cell border, dB".to_owned(),
        "border_psnr" => "PSNR of the 8-cell border, dB".to_owned(),
        "rmse" => "root mean square error, unit heights".to_owned(),
        "mean_slope_ratio" => "mean slope over the true one (1 is right)".to_owned(),
        "spectrum_distance" => "distance of the spectra, dB".to_owned(),
        other => other.replace('_', " "),
    }
}

pub(super) fn decimals(metric: &str) -> usize {
    match metric {
        m if m.ends_with("psnr") || m == "spectrum_distance" => 2,
        m if m.contains("l_g") => 6,
        _ => 4,
    }
}

impl Page<'_> {
    fn draw(&self, machine: &MachineInfo, training: &[TrainingRow]) -> Result<String> {
        let spec = self.spec;
        file::remove(&self.record.path("plots"))?;
        file::create_folder(&self.record.path("plots"))?;
        let mut report = Report::new(&spec.title).summary(&spec.question).summary(self.conditions(machine));
        report = report.section("What came out");
        let analysis = if spec.analysis.trim().is_empty() { "Not written yet." } else { &spec.analysis };
        for paragraph in analysis.split("\n\n") {
            report = report.paragraph(paragraph.replace('\n', " ").trim());
        }
        if !spec.bound.is_empty() {
            report = report.table(&self.bounds()?);
        }
        if !spec.printed.is_empty() {
            report = report.table(&self.printed()?);
        }
        let by_sketch = spec.kind.has_truth() && spec.kind != Kind::Exchange;
        if by_sketch {
            for sketch in spec.sketches() {
                report = self.scores(report, &sketch.name)?;
            }
        } else {
            report = by_kind::general(self, report)?;
        }
        report = by_kind::printed_plots(self, report)?;
        report = by_kind::exemplars(self, report)?;
        report = by_kind::states(self, report)?;
        report = by_kind::stages(self, report)?;
        if by_sketch && spec.sketches().len() > 1 {
            report = report.section("From dense to thin sketches");
            for metric in spec.metrics.iter().take(2) {
                if let Some(plot) = self.thinning(metric)? {
                    let caption =
                        "Mean of the areas' means; a point for each sketch, at its mean share of line cells.";
                    report = report.figure(self.kept(plot, &format!("thinning-{metric}"))?, caption);
                }
            }
        }
        if let Some(table) = self.lost()? {
            report = report.section("Where an interpolator wins").table(&table);
        }
        report = self.pictures(report)?;
        report = report.section("Training").table(&trainings(training));
        let seconds = |what: &str, s: f64| (what.to_owned(), Duration::from_secs_f64(s.max(0.0)));
        let all: f64 = machine.session.iter().map(|s| s.seconds).sum();
        let budget = spec.budget_minutes;
        report = report
            .section("Cost and conditions")
            .paragraph(format!(
                "{:.1} minutes in {} sessions; the budget is {budget} minutes.",
                all / 60.0,
                machine.session.len()
            ))
            .time_spent(machine.session.iter().enumerate().map(|(i, s)| {
                let what = format!(
                    "session {}: {} styles trained, {} rows, {} jobs, {} threads",
                    i + 1,
                    s.trained,
                    s.rows,
                    s.jobs,
                    s.threads
                );
                seconds(&what, s.seconds)
            }))
            .commands([
                "monadnock experiment run resolved.toml --out again",
                "cmp scores.csv again/scores.csv",
            ])
            .subsection("The experiment as it was run")
            .listing(spec.to_toml());
        Ok(report.finish())
    }

    fn conditions(&self, machine: &MachineInfo) -> String {
        let (spec, failed) = (self.spec, self.table.rows.iter().filter(|row| !row.error.is_empty()).count());
        let seeds: Vec<String> = spec.seeds.iter().map(u64::to_string).collect();
        let revision = if machine.revision.is_empty() { "unknown" } else { &machine.revision };
        let vector =
            if machine.vector.is_empty() { String::new() } else { format!(", vectors {}", machine.vector) };
        format!(
            "{} areas, seeds {}, {} rows of which {failed} failed. monadnock {}, revision {revision}; {}, {} cores, {} MB{vector}.",
            spec.area.len(),
            seeds.join(", "),
            self.table.rows.len(),
            machine.version,
            machine.system,
            machine.cores,
            machine.memory_mb
        )
    }

    fn bounds(&self) -> Result<Table> {
        let columns = ["Expected", "Found", "Where it is tightest", "Kept", "Why expected"];
        let mut table = Table::new(columns.map(Column::text)).caption("What was expected of the result.");
        for verdict in bounds::check(self.spec, self.table)? {
            let found = verdict.worst.map_or_else(|| "nothing to check".to_owned(), |w| format!("{w:.5}"));
            let kept = match (verdict.is_kept(), verdict.checked) {
                (true, _) => "yes".to_owned(),
                (false, n) => format!("NO: {} of {n} broken, {} failed", verdict.broken, verdict.failures),
            };
            table = table.row([verdict.bound, found, verdict.place, kept, verdict.reason]);
        }
        Ok(table)
    }

    fn printed(&self) -> Result<Table> {
        let highlight = self.spec.highlighted()?;
        let sketches = self.spec.sketches();
        let caption =
            format!("Beside printed numbers: {highlight}, mean ± standard deviation over patches and seeds.");
        let heads = ["Source", "Area", "Score", "Printed", "Here", "Mind"];
        let mut table = Table::new(heads.map(Column::text)).caption(caption);
        for p in &self.spec.printed {
            let digits = decimals(&p.metric);
            let here = self.summaries.of_area(&highlight, &p.area, &sketches[0].name, &p.metric);
            let here =
                here.map_or_else(|| "–".to_owned(), |s| format!("{:.digits$} ± {:.digits$}", s.mean, s.sd));
            let sd = p.sd.map(|sd| format!(" ± {sd}")).unwrap_or_default();
            let printed = format!("{}{sd}", p.value);
            table = table.row([
                p.source.clone(),
                p.area.clone(),
                title(&p.metric),
                printed,
                here,
                p.note.clone(),
            ]);
        }
        Ok(table)
    }

    /// A table for all areas and each of them, and a plot of the first metrics.
    fn scores(&self, mut report: Report, sketch: &str) -> Result<Report> {
        let (spec, systems) = (self.spec, self.spec.systems()?);
        report = report.section(format!("Scores, sketch \"{sketch}\""));
        let seeds = spec.seeds.len();
        let areas = spec.area.iter().map(|a| Some(a.name.as_str()));
        for area in (spec.area.len() > 1).then_some(None).into_iter().chain(areas) {
            let mut columns = vec![Column::text("System"), Column::number("n", 0)];
            columns.extend(spec.metrics.iter().map(|metric| {
                let best = if metric == "mean_slope_ratio" {
                    Best::NearestToOne
                } else if lower_is_better(metric) {
                    Best::Lowest
                } else {
                    Best::Highest
                };
                Column::number(title(metric), decimals(metric)).best(best)
            }));
            let caption = match area {
                Some(area) => {
                    format!("{area}: mean ± standard deviation over n cells (patches x {seeds} seeds).")
                }
                None => "Mean ± standard deviation of the areas' means; n areas.".to_owned(),
            };
            let mut table = Table::new(columns).caption(caption);
            for system in &systems {
                let stat = |metric: &str| match area {
                    Some(area) => self.summaries.of_area(system, area, sketch, metric),
                    None => self.summaries.of_all(system, sketch, metric),
                };
                let n = stat(&spec.metrics[0]).map_or(0, |s| s.n);
                let mut entries = vec![Entry::from(system.as_str()), Entry::from(n as f64)];
                entries
                    .extend(spec.metrics.iter().map(|m| Entry::from(stat(m).map(|s: Stat| (s.mean, s.sd)))));
                table = table.row(entries);
            }
            report = report.table(&table);
        }
        for metric in spec.metrics.iter().take(PLOTTED) {
            if let Some(plot) = self.distribution(metric, sketch)? {
                let name = format!("{metric}-{}", plain(sketch));
                let caption = format!(
                    "{} of every patch and seed, all areas together. Box: quartiles and median; diamond: mean.",
                    title(metric)
                );
                report = report.figure(self.kept(plot, &name)?, caption);
            }
        }
        Ok(report)
    }

    fn distribution(&self, metric: &str, sketch: &str) -> Result<Option<Svg>> {
        let better = if lower_is_better(metric) { Better::Lower } else { Better::Higher };
        let words = format!("{}, sketch \"{sketch}\"", self.spec.title);
        let mut plot = ScorePlot::new(words, title(metric), better).decimals(decimals(metric));
        let (highlight, mut any) = (self.spec.highlighted()?, false);
        for system in self.spec.systems()? {
            let areas = self.spec.area.iter();
            let values: Vec<f64> = areas
                .flat_map(|area| self.summaries.cells(&system, &area.name, sketch, metric).into_values())
                .collect();
            if values.is_empty() {
                continue;
            }
            any = true;
            if system == highlight {
                plot = plot.highlight(system.clone());
            }
            plot = plot.system(system, values);
        }
        any.then(|| plot.draw()).transpose()
    }

    /// Each system's mean over the share of line cells.
    fn thinning(&self, metric: &str) -> Result<Option<Svg>> {
        let sketches = self.spec.sketches();
        let share = |sketch: &str| {
            let rows = self.table.rows.iter().filter(|r| r.key.sketch == sketch && r.error.is_empty());
            Stat::of(&rows.map(|r| 100.0 * r.line_share).collect::<Vec<_>>()).map(|s| s.mean)
        };
        let mut panel = Panel::new(title(metric));
        let mut any = false;
        for system in self.spec.systems()? {
            let points = sketches.iter().filter_map(|s| {
                Some((share(&s.name)?, self.summaries.of_all(&system, &s.name, metric)?.mean))
            });
            let mut points: Vec<(f64, f64)> = points.collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            if !points.is_empty() {
                any = true;
                panel = panel.curve(system, points);
            }
        }
        let names: Vec<&str> = sketches.iter().map(|s| s.name.as_str()).collect();
        let words = format!("{}: {}", self.spec.title, names.join(", "));
        any.then(|| Curves::new(words, "line cells of a patch, %").panel(panel).draw()).transpose()
    }

    /// Patches on which an interpolator has the higher PSNR, the worst first.
    fn lost(&self) -> Result<Option<Table>> {
        if self.summaries.interpolators().is_empty() || self.table.column("psnr").is_none() {
            return Ok(None);
        }
        let found = findings::losses(self.spec, self.table, &self.summaries)?;
        let mean = |name: &str, why: Option<findings::Why>| {
            let words = |w: findings::Why| {
                format!(
                    " {name} patches have a mean relief of {:.0} m, lines on {:.1} % of their cells and {:.0} % of the squared error \
                     in the border.",
                    w.relief,
                    100.0 * w.line_share,
                    100.0 * w.border_share
                )
            };
            why.map(words).unwrap_or_default()
        };
        let caption = format!(
            "{} of {} patches on which an interpolator has the higher PSNR than {} (mean over seeds); the {} widest margins.{}{}",
            found.lost.len(),
            found.all,
            self.spec.highlighted()?,
            found.lost.len().min(LISTED),
            mean("Lost", found.of_lost),
            mean("Won", found.of_won)
        );
        let heads = [
            Column::text("Area"),
            Column::text("Row, column"),
            Column::text("Sketch"),
            Column::number("Margin", 2).unit("dB"),
            Column::text("Best interpolator there"),
            Column::number("Relief", 0).unit("m"),
            Column::number("Line cells", 1).unit("%"),
            Column::number("Error in the border", 0).unit("%"),
        ];
        let mut table = Table::new(heads).caption(caption);
        for loss in found.lost.iter().take(LISTED) {
            table = table.row([
                Entry::from(loss.area.as_str()),
                Entry::from(format!("{}, {}", loss.patch.0, loss.patch.1)),
                Entry::from(loss.sketch.as_str()),
                Entry::from(loss.margin),
                Entry::from(loss.winner.as_str()),
                Entry::from(loss.why.relief),
                Entry::from(100.0 * loss.why.line_share),
                Entry::from(100.0 * loss.why.border_share),
            ]);
        }
        Ok(Some(table))
    }

    fn pictures(&self, mut report: Report) -> Result<Report> {
        let files = self.record.list("pictures")?;
        if files.is_empty() {
            return Ok(report);
        }
        let words = match self.spec.kind {
            Kind::Drawings => "A sheet for each drawing and style, of the first seed.",
            Kind::Exchange => "The first seed.",
            Kind::Invariance => {
                "Of each area the first patch: lines as moved, and their terrain as it came. The first seed."
            }
            _ => {
                "Of each area in turn the patch with the worst and the best margin to the interpolators. Numbers are of the first \
                 seed."
            }
        };
        report = report.section("Pictures").paragraph(words);
        for path in files {
            let picture = Picture::from_png(&file::read_whole(&path, LARGEST_PICTURE)?)
                .map_err(|e| e.in_file(&path))?;
            let name = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            report = report.figure(picture, name);
        }
        Ok(report)
    }

    /// Writes a plot beside the page and gives it back.
    pub(super) fn kept(&self, plot: Svg, name: &str) -> Result<Svg> {
        plot.write(&self.record.path("plots").join(format!("{name}.svg")))?;
        Ok(plot)
    }
}

fn trainings(rows: &[TrainingRow]) -> Table {
    let columns = [
        Column::text("Style"),
        Column::text("Area"),
        Column::text("Seed"),
        Column::number("Weights", 0),
        Column::number("Epochs", 0),
        Column::number("Training", 1).unit("s"),
        Column::number("Preparation", 1).unit("s"),
        Column::number("An epoch", 4).unit("s"),
        Column::number("Detail", 1).unit("s"),
        Column::number("Its strength", 2),
        Column::number("Exemplar rebuilt", 1).unit("dB"),
        Column::text("Failed"),
    ];
    let mut table =
        Table::new(columns).caption("Every training; times are those of the machine and its other work.");
    for r in rows {
        table = table.row([
            Entry::from(r.style.as_str()),
            Entry::from(r.area.as_str()),
            Entry::from(r.seed.to_string()),
            Entry::from(r.parameters as f64),
            Entry::from(r.epochs as f64),
            Entry::from(r.seconds),
            Entry::from(r.preparation_seconds),
            Entry::from(r.seconds_per_epoch),
            Entry::from(r.detail.map(|d| d.seconds)),
            Entry::from(r.detail.map(|d| d.gain)),
            Entry::from(r.detail.and_then(|d| d.psnr)),
            Entry::from(r.error.as_str()),
        ]);
    }
    table
}

pub(super) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}
