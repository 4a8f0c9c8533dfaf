//! `experiment`: comparisons as data files, their records and reports.

use super::Context;
use super::args::tell;
use super::console::Progress;
use super::outputs::{OutputKind, Outputs};
use crate::error::{Error, Result};
use crate::experiment::areas::Terrain;
use crate::experiment::documents::{self, Form};
use crate::experiment::events::Event;
use crate::experiment::record::Record;
use crate::experiment::resolve::resolve;
use crate::experiment::run::{RunOptions, run as run_experiment};
use crate::experiment::{ExperimentSpec, bounds, report};
use crate::file;
use crate::viz::duration;
use crate::viz::report::{Column, Table};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

const EXAMPLES: &str = "\
Examples:
  monadnock experiment list
  monadnock experiment run experiments/quick/neighbours.toml
  monadnock experiment run experiments/full/neighbours.toml --data ../shared/data --jobs 2
  monadnock experiment run experiments/full/sparse.toml --data ../shared/data --styles /tmp/styles
  monadnock experiment run experiments/full/neighbours.toml --quick
  monadnock experiment report experiments/full/neighbours.toml --splice docs/results.md
  monadnock experiment report all

The record of experiments/full/X.toml is in experiments/records/X, that of a quick one in experiments/records/quick/X, of any
other file in records/X beside it. A run that was interrupted continues where it stopped. docs/experiments.md describes the
files. The exit code is 1 when a bound of the experiment is broken.";

/// Arguments of `experiment`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ExperimentArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Run an experiment, or the rest of an interrupted one, and write its record
    Run(RunArgs),
    /// Write the report of a record again, and its tables into a document
    Report(ReportArgs),
    /// Keep of a record what a repository should hold: a summary, compressed tables, the resolved experiment
    Pack(PackArgs),
    /// List the experiments of a folder and how far their records are
    List(ListArgs),
}

#[derive(clap::Args)]
struct RunArgs {
    /// The experiment (TOML), or the resolved.toml of a record to repeat it
    file: PathBuf,
    /// The twin of the same name in the folder `quick` beside the file's
    #[arg(long)]
    quick: bool,
    /// Styles trained at once
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// A folder with a manifest.toml, whose areas come before the bundled ones
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The record's folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Start over, whatever the record holds
    #[arg(long)]
    restart: bool,
    /// The folder of trained styles: what one experiment has trained, others need not (default: in the record)
    #[arg(long, value_name = "DIR")]
    styles: Option<PathBuf>,
    /// Seconds and memory of others to stand beside ours: a table like stages.csv of a record
    #[arg(long, value_name = "CSV")]
    peers: Option<PathBuf>,
}

#[derive(clap::Args)]
struct ReportArgs {
    /// The experiment, or `all` of the folder experiments/full that have a record
    file: PathBuf,
    /// The record's folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the result table between the experiment's markers in this document
    #[arg(long, value_name = "DOCUMENT")]
    splice: Option<PathBuf>,
}

#[derive(clap::Args)]
struct PackArgs {
    /// The experiment, or `all` of the folder experiments/full that have a record
    file: PathBuf,
    /// The record's folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(clap::Args)]
struct ListArgs {
    /// The folder with the folders `full` and `quick`
    #[arg(default_value = "experiments")]
    folder: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the experiment, its data or its record; a broken bound.
pub(super) fn run(args: &ExperimentArgs, context: &Context) -> Result<()> {
    match &args.action {
        Action::Run(args) => start(args, context),
        Action::Report(args) => reports(args, context),
        Action::Pack(args) => each_record(&args.file, args.out.as_deref(), |_, record| {
            record.pack(&documents::of_record(record, Form::Markdown)?)?;
            context.console.line(format!("packed {}", record.path("").display()));
            Ok(())
        }),
        Action::List(args) => list(&args.folder, context),
    }
}

/// Where the record of an experiment file is.
fn record_of(path: &Path, out: Option<&Path>) -> PathBuf {
    if let Some(out) = out {
        return out.to_owned();
    }
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let stem = path.file_stem().unwrap_or_default();
    let above = || folder.parent().map(Path::to_owned).unwrap_or_default();
    match folder.file_name().and_then(|name| name.to_str()) {
        Some("full") => above().join("records").join(stem),
        Some("quick") => above().join("records").join("quick").join(stem),
        _ => folder.join("records").join(stem),
    }
}

/// The quick twin of an experiment file.
fn twin(path: &Path) -> Result<PathBuf> {
    let above = path.parent().and_then(Path::parent).unwrap_or(Path::new(""));
    let twin = above.join("quick").join(path.file_name().unwrap_or_default());
    if twin.is_file() {
        return Ok(twin);
    }
    Err(Error::file(
        path,
        "--quick",
        format!("no twin {}", twin.display()),
        "allowed: with a file of that name there",
    ))
}

fn start(args: &RunArgs, context: &Context) -> Result<()> {
    let path = if args.quick { twin(&args.file)? } else { args.file.clone() };
    let spec = ExperimentSpec::read(&path)?;
    let repeats = path.file_name().is_some_and(|name| name == "resolved.toml");
    if repeats && args.out.is_none() {
        let allowed = "allowed: with --out DIR, so that the record that is repeated stays as it is";
        return Err(Error::file(&path, "--out", "missing", allowed));
    }
    let out = record_of(&path, args.out.as_deref());
    Outputs::new()
        .writes("--out", &out, OutputKind::Folder)
        .writes("--styles", &args.styles, OutputKind::Folder)
        .reads(&args.peers)
        .check()?;
    let terrain = Terrain::new(args.data.as_deref())?;
    let resolved = resolve(&spec, &terrain).map_err(|e| e.in_file(&path))?;
    // Several areas may be windows of one file, which is told once.
    let mut told: Vec<&Path> = Vec::new();
    for area in &resolved.areas {
        if !told.contains(&area.file.as_path()) {
            tell(&area.file, &area.description, &context.console);
            told.push(&area.file);
        }
    }
    file::create_folder(&out)?;
    let options = RunOptions {
        out: out.clone(),
        jobs: args.jobs.into(),
        restart: args.restart,
        styles: args.styles.clone(),
    };
    let watch = Watch { context, bar: Mutex::new(None) };
    let outcome = run_experiment(&resolved, &options, &|event| watch.tell(event))?;
    drop(watch);
    let record = Record::new(&out);
    if let Some(peers) = &args.peers {
        record.add_peers(peers)?;
    }
    let page = report::write(&record)?;
    let console = &context.console;
    console.line(documents::of_record(&record, Form::Text)?.trim_end());
    let spent = duration(Duration::from_secs_f64(outcome.seconds));
    console.line(format!("{} rows, {} failed, {spent}; {}", outcome.rows, outcome.failed, page.display()));
    if outcome.seconds > 60.0 * spec.budget_minutes {
        console.warning(format!("{spent} are more than the budget of {} minutes", spec.budget_minutes));
    }
    verdicts(&path, &record, context)
}

/// Prints how the bounds fared.
fn verdicts(path: &Path, record: &Record, context: &Context) -> Result<()> {
    let verdicts = bounds::check(&record.spec()?, &record.scores()?)?;
    for verdict in &verdicts {
        context.console.line(verdict.to_string());
    }
    let broken: Vec<&str> = verdicts.iter().filter(|v| !v.is_kept()).map(|v| v.bound.as_str()).collect();
    if broken.is_empty() {
        return Ok(());
    }
    let allowed = format!("allowed: none ({})", broken.join("; "));
    Err(Error::file(path, "broken bounds", broken.len(), allowed))
}

/// Shows how far a run is.
struct Watch<'a> {
    context: &'a Context,
    bar: Mutex<Option<Progress>>,
}

impl Watch<'_> {
    fn tell(&self, event: Event) {
        let mut bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        let console = &self.context.console;
        match event {
            Event::Training { styles, cached, steps } => {
                if cached > 0 {
                    console.line(format!("{cached} of {styles} styles are trained already"));
                }
                *bar = (steps > 0).then(|| console.progress(steps, "training"));
            }
            Event::Scoring { rows, kept } => {
                if kept > 0 {
                    console.line(format!("{kept} of {} rows are there already", kept + rows));
                }
                *bar = (rows > 0).then(|| console.progress(rows, "scoring"));
            }
            Event::Steps(n) | Event::Scored(n) => bar.iter().for_each(|bar| bar.advance(n)),
            Event::Failed(what) => console.warning(what),
        }
    }
}

fn reports(args: &ReportArgs, context: &Context) -> Result<()> {
    Outputs::new().writes("--splice", &args.splice, OutputKind::Document).check()?;
    let markers = args.splice.as_deref().map(documents::markers).transpose()?;
    each_record(&args.file, args.out.as_deref(), |path, record| {
        context.console.line(report::write(record)?.display().to_string());
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (Some(document), Some(markers)) = (&args.splice, &markers) else { return Ok(()) };
        let of_this = |marker: &&String| documents::experiment_of(marker) == name;
        let mut wanted: Vec<&str> = markers.iter().filter(of_this).map(String::as_str).collect();
        if wanted.is_empty() && args.file.as_os_str() != "all" {
            // Says that the document has no place for it.
            wanted.push(&name);
        }
        for marker in wanted {
            let changed = documents::splice(document, marker, &documents::of_marker(record, marker)?)?;
            let word = if changed { "tables written" } else { "unchanged" };
            context.console.line(format!("{}: {marker}: {word}", document.display()));
        }
        Ok(())
    })
}

/// Does `act` with the record of an experiment file, or with those of all finished ones in experiments/full.
fn each_record(file: &Path, out: Option<&Path>, act: impl Fn(&Path, &Record) -> Result<()>) -> Result<()> {
    if file.as_os_str() != "all" {
        let folder = record_of(file, out);
        Outputs::new().writes("--out", &folder, OutputKind::Folder).check()?;
        return act(file, &Record::new(&folder));
    }
    if let Some(out) = out {
        return Err(Error::value("--out", out.display(), "allowed: with one experiment, not with all"));
    }
    let folder = Path::new("experiments/full");
    let records = experiments(folder)?.into_iter().map(|path| (Record::new(&record_of(&path, None)), path));
    let finished: Vec<(Record, PathBuf)> = records.filter(|(record, _)| record.has("scores.csv")).collect();
    if finished.is_empty() {
        let allowed = "at least one record is needed: `monadnock experiment run FILE` writes it";
        return Err(Error::file(folder, "records", 0, allowed));
    }
    finished.iter().try_for_each(|(record, path)| act(path, record))
}

/// The experiment files of a folder.
fn experiments(folder: &Path) -> Result<Vec<PathBuf>> {
    let is_toml = |path: &PathBuf| path.extension().is_some_and(|e| e == "toml");
    Ok(file::list(folder)?.into_iter().filter(is_toml).collect())
}

fn list(folder: &Path, context: &Context) -> Result<()> {
    let heads = ["file", "kind", "areas", "seeds", "minutes", "record"];
    let (mut table, mut found) = (Table::new(heads.map(Column::text)), 0);
    for kind in ["full", "quick"] {
        for path in experiments(&folder.join(kind))? {
            let spec = ExperimentSpec::read(&path)?;
            let record = Record::new(&record_of(&path, None));
            let state = if record.has("scores.csv") {
                let (was_run, scores) = (record.spec()?, record.scores()?);
                let kept = bounds::check(&was_run, &scores)?.iter().filter(|v| v.is_kept()).count();
                format!("{} rows, {kept} of {} bounds kept", scores.rows.len(), was_run.bound.len())
            } else if record.has("journal.csv") {
                "interrupted".to_owned()
            } else {
                "not run".to_owned()
            };
            table = table.row([
                path.display().to_string(),
                spec.kind.to_string(),
                spec.area.len().to_string(),
                spec.seeds.len().to_string(),
                spec.budget_minutes.to_string(),
                state,
            ]);
            found += 1;
        }
    }
    if found == 0 {
        let allowed = "allowed: a folder with full/*.toml or quick/*.toml";
        return Err(Error::file(folder, "experiments", 0, allowed));
    }
    context.console.line(table.text());
    Ok(())
}
