//! The parts of a report that only some kinds of experiment have.

use super::extras::{EXEMPLAR_HEAD, STAGE_HEAD, STATE_HEAD};
use super::findings;
use super::report::{Page, decimals, plain, title};
use super::spec::{Kind, lower_is_better};
use crate::error::Result;
use crate::viz::plot::{Better, Scatter, ScorePlot};
use crate::viz::report::{Column, Entry, Report, Table};

/// Metrics that get a plot.
const PLOTTED: usize = 2;

/// Tables of experiments without a truth, or with two areas a row: for each area a row for each sketch and system.
pub(super) fn general(page: &Page<'_>, mut report: Report) -> Result<Report> {
    let (spec, systems) = (page.spec, page.spec.systems()?);
    report = report.section("Scores");
    let seeds = spec.seeds.len();
    for area in &spec.area {
        let mut columns = vec![Column::text("Sketch"), Column::text("System"), Column::number("n", 0)];
        columns.extend(spec.metrics.iter().map(|m| {
            let digits = if m.ends_with("_difference") { 6 } else { decimals(m) };
            Column::number(title(m), digits)
        }));
        let word = if spec.kind == Kind::Exchange { "Style of " } else { "" };
        let caption = format!("{word}{}: mean ± standard deviation over n cells ({seeds} seeds).", area.name);
        let mut table = Table::new(columns).caption(caption);
        for sketch in spec.sketches() {
            for system in &systems {
                let stat = |metric: &str| page.summaries.of_area(system, &area.name, &sketch.name, metric);
                let n = stat(&spec.metrics[0]).map_or(0, |s| s.n);
                let mut entries = vec![
                    Entry::from(sketch.name.as_str()),
                    Entry::from(system.as_str()),
                    Entry::from(n as f64),
                ];
                entries.extend(spec.metrics.iter().map(|m| Entry::from(stat(m).map(|s| (s.mean, s.sd)))));
                table = table.row(entries);
            }
        }
        report = report.table(&table);
    }
    let highlight = spec.highlighted()?;
    for metric in spec.metrics.iter().take(PLOTTED) {
        let better = if lower_is_better(metric) { Better::Lower } else { Better::Higher };
        let mut plot = ScorePlot::new(spec.title.as_str(), title(metric), better).decimals(decimals(metric));
        let mut any = false;
        for sketch in spec.sketches() {
            let values: Vec<f64> = spec
                .area
                .iter()
                .flat_map(|a| page.summaries.cells(&highlight, &a.name, &sketch.name, metric).into_values())
                .collect();
            if !values.is_empty() {
                any = true;
                plot = plot.system(sketch.name, values);
            }
        }
        if any {
            let caption =
                format!("{} of {highlight}: a row for each sketch, all areas together.", title(metric));
            report = report.figure(page.kept(plot.draw()?, &format!("{}-sketches", plain(metric)))?, caption);
        }
    }
    Ok(report)
}

/// The scores of an area beside a printed number: a plot for each such number.
pub(super) fn printed_plots(page: &Page<'_>, mut report: Report) -> Result<Report> {
    let spec = page.spec;
    let (sketches, highlight) = (spec.sketches(), spec.highlighted()?);
    let mut done: Vec<(&str, &str)> = Vec::new();
    for printed in &spec.printed {
        let what = (printed.area.as_str(), printed.metric.as_str());
        if done.contains(&what) {
            continue;
        }
        if done.is_empty() {
            report = report.section("Beside printed numbers");
        }
        done.push(what);
        let (area, metric) = what;
        let better = if lower_is_better(metric) { Better::Lower } else { Better::Higher };
        let words = format!("{area}, sketch \"{}\"", sketches[0].name);
        let mut plot = ScorePlot::new(words, title(metric), better).decimals(decimals(metric));
        let mut any = false;
        for system in spec.systems()? {
            let values: Vec<f64> =
                page.summaries.cells(&system, area, &sketches[0].name, metric).into_values().collect();
            if values.is_empty() {
                continue;
            }
            any = true;
            if system == highlight {
                plot = plot.highlight(system.clone());
            }
            plot = plot.system(system, values);
        }
        let mut notes = Vec::new();
        for p in spec.printed.iter().filter(|p| (p.area.as_str(), p.metric.as_str()) == what) {
            plot = plot.mark(format!("{}: {}", p.source, p.value), p.value);
            notes.push(p.note.as_str());
        }
        if any {
            let caption =
                format!("Every patch and seed; the line is the printed mean. Mind: {}.", notes.join("; "));
            let name = format!("printed-{}-{}", plain(area), plain(metric));
            report = report.figure(page.kept(plot.draw()?, &name)?, caption);
        }
    }
    Ok(report)
}

/// What tells a good exemplar.
pub(super) fn exemplars(page: &Page<'_>, mut report: Report) -> Result<Report> {
    let rules = findings::rules(page.spec, &page.summaries, page.record)?;
    let Some(known) = page.record.table("exemplars.csv", &EXEMPLAR_HEAD)? else { return Ok(report) };
    report = report.section("Which exemplar");
    let columns = [
        Column::text("Statistic of the exemplar"),
        Column::number("Rank correlation", 2),
        Column::number("Terrains", 0),
        Column::number("Gain", 2).unit("dB"),
    ];
    let caption = "Spearman's rank correlation of a statistic with the score of the style, within each terrain, mean over \
                   terrains; gain: the score of the exemplar that the statistic would choose, above the terrain's mean.";
    let mut table = Table::new(columns).caption(caption);
    for rule in &rules {
        table = table.row([
            Entry::from(rule.statistic.as_str()),
            Entry::from(rule.correlation),
            Entry::from(rule.terrains as f64),
            Entry::from(rule.gain),
        ]);
    }
    report = report.table(&table);
    let taught = findings::taught(page.spec, &page.summaries)?;
    let first = rules.first().map_or(EXEMPLAR_HEAD[4], |rule| rule.statistic.as_str());
    let column = EXEMPLAR_HEAD.iter().position(|name| *name == first).unwrap_or(4);
    let y = if page.summaries.interpolators().is_empty() {
        "PSNR, dB"
    } else {
        "PSNR above the best interpolator, dB"
    };
    let mut plot = Scatter::new("Every patch as the exemplar", first.replace('_', " "), y);
    let mut terrains: Vec<&str> = Vec::new();
    for t in &taught {
        if !terrains.contains(&t.terrain.as_str()) {
            terrains.push(&t.terrain);
        }
    }
    for terrain in terrains {
        let points = taught.iter().filter(|t| t.terrain == terrain).filter_map(|t| {
            let row = known.iter().find(|row| row[0] == t.area)?;
            Some((row[column].parse::<f64>().ok()?, t.score))
        });
        plot = plot.group(terrain, points);
    }
    if taught.is_empty() {
        return Ok(report);
    }
    let caption =
        "A point for each exemplar: the statistic with the strongest rank correlation, and the score.";
    Ok(report.figure(page.kept(plot.draw()?, "exemplars")?, caption))
}

/// The t-SNE of region states.
pub(super) fn states(page: &Page<'_>, mut report: Report) -> Result<Report> {
    let Some(rows) = page.record.table("states.csv", &STATE_HEAD)? else { return Ok(report) };
    report = report.section("Region states in two dimensions");
    let mut sets: Vec<(&str, &str, &str)> = Vec::new();
    for row in &rows {
        let set = (row[0].as_str(), row[1].as_str(), row[2].as_str());
        if !sets.contains(&set) {
            sets.push(set);
        }
    }
    for (system, area, patch) in sets {
        let mut plot = Scatter::new(format!("{system}, {area} {patch}"), "t-SNE 1", "t-SNE 2");
        for kind in ["valley", "ridge"] {
            let of = rows
                .iter()
                .filter(|r| (r[0].as_str(), r[1].as_str(), r[2].as_str()) == (system, area, patch));
            let points = of.filter(|r| r[3] == kind);
            plot = plot.group(kind, points.filter_map(|r| Some((r[4].parse().ok()?, r[5].parse().ok()?))));
        }
        let name = format!("states-{}-{}", plain(system), plain(area));
        let caption =
            "A point for each region of the patch after message passing; axes of a t-SNE have no unit.";
        report = report.figure(page.kept(plot.draw()?, &name)?, caption);
    }
    Ok(report)
}

/// Seconds and memory of each stage.
pub(super) fn stages(page: &Page<'_>, mut report: Report) -> Result<Report> {
    for (name, words) in
        [("stages.csv", "Stages"), ("peers.csv", "Others, on the machine that made their file")]
    {
        let Some(rows) = page.record.table(name, &STAGE_HEAD)? else { continue };
        let columns = [
            Column::text("Stage"),
            Column::text("System"),
            Column::number("n", 0),
            Column::number("Mean", 4).unit("s"),
            Column::number("Peak memory up to then", 0).unit("MB"),
        ];
        let caption = format!("{words}: mean over n, and the largest memory of the process until then.");
        let mut table = Table::new(columns).caption(caption);
        for row in rows {
            let number = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN);
            table = table.row([
                Entry::from(row[0].as_str()),
                Entry::from(row[1].as_str()),
                Entry::from(number(&row[2])),
                Entry::from(number(&row[3])),
                Entry::from(number(&row[4])),
            ]);
        }
        report = report.table(&table);
    }
    Ok(report)
}
