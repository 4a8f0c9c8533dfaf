//! The folder of a run: the experiment, its scores, the machine.
//!
//! | file | what |
//! |---|---|
//! | `resolved.toml` | the experiment with nothing left open; written first |
//! | `machine.toml` | program, revision, machine, and how long each session took |
//! | `journal.csv` | rows as they are finished, with their seconds; lets an interrupted run continue |
//! | `windows/` | `strokes`: features of the windows of each terrain, until all are told apart |
//! | `styles/` | the trained styles, by a hash of configuration, exemplar and seed |
//! | `scores.csv` | all rows in the experiment's order; the same bytes in every run |
//! | `timings.csv`, `training.csv` | seconds of every row, and of every training |
//! | `exemplars.csv`, `states.csv`, `stages.csv` | what some protocols know beside the scores |
//! | `pictures/`, `plots/`, `report.html` | to be looked at |
//!
//! [`pack`](Record::pack) keeps of it what a repository should hold: tables as `.csv.xz`, which are read like the others, and
//! `summary.md`.

use super::rows::{Key, ScoreRow, ScoreTable, Timed, complaint};
use super::spec::ExperimentSpec;
use crate::error::{Error, Result};
use crate::file::{self, csv_lines, csv_table};
use crate::machine::{self, VECTOR_VARIABLE, VectorLevel};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// No file of a record is larger.
const LARGEST: u64 = 1 << 30;
/// Tables that are kept, compressed.
const KEPT: [&str; 6] =
    ["scores.csv", "training.csv", "exemplars.csv", "states.csv", "stages.csv", "peers.csv"];
/// What a run needs to continue or makes for the eye.
const PASSING: [&str; 7] =
    ["journal.csv", "timings.csv", "styles", "windows", "pictures", "plots", "report.html"];

/// A record's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Record {
    folder: PathBuf,
}

/// The program and the machine of a record.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct MachineInfo {
    /// Version of the program.
    pub(crate) version: String,
    /// Revision of its source, as far as known.
    pub(crate) revision: String,
    /// SHA-256 of the program's file.
    pub(crate) program_sha256: String,
    /// Operating system and processor architecture.
    pub(crate) system: String,
    /// Cores that the process may use.
    pub(crate) cores: usize,
    /// Memory of the machine, MB.
    pub(crate) memory_mb: u64,
    /// Vector instructions of the kernels (`scalar`, `avx2`, `avx512`); empty in records from before they could be chosen.
    pub(crate) vector: String,
    /// One entry each time the run was started or continued.
    pub(crate) session: Vec<Session>,
}

/// One stretch of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Session {
    /// Seconds from beginning to end.
    pub(crate) seconds: f64,
    /// Styles trained at once.
    pub(crate) jobs: usize,
    /// Threads in all.
    pub(crate) threads: usize,
    /// Styles trained.
    pub(crate) trained: usize,
    /// Rows scored.
    pub(crate) rows: usize,
    /// Largest memory of the process, MB.
    pub(crate) peak_memory_mb: u64,
}

/// What is known of one training: a row of `training.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct TrainingRow {
    /// The style.
    pub(crate) style: String,
    /// The area.
    pub(crate) area: String,
    /// The seed.
    pub(crate) seed: u64,
    /// Weights of the network.
    pub(crate) parameters: usize,
    /// Steps.
    pub(crate) epochs: usize,
    /// Seconds of the steps.
    pub(crate) seconds: f64,
    /// Seconds before them.
    pub(crate) preparation_seconds: f64,
    /// Median seconds of a step.
    pub(crate) seconds_per_epoch: f64,
    /// Seconds to learn the detail; none without.
    pub(crate) detail_seconds: Option<f64>,
    /// What strength 1 of the detail is worth.
    pub(crate) detail_gain: Option<f64>,
    /// PSNR of the exemplar that generators rebuild, decibels; patches rebuild none.
    pub(crate) detail_psnr: Option<f64>,
    /// Why it failed; empty when it did not.
    pub(crate) error: String,
}

/// Seconds and memory of a stage: a row of `stages.csv`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StageRow {
    pub(super) stage: String,
    pub(super) system: String,
    /// How often it was measured.
    pub(super) n: usize,
    /// Mean.
    pub(super) seconds: f64,
    /// Largest memory of the process up to then.
    pub(super) peak_memory_mb: Option<u64>,
}

impl StageRow {
    /// The mean of several measurements.
    pub(super) fn new(stage: &str, system: &str, seconds: &[f64], peak: Option<u64>) -> Self {
        let mean = seconds.iter().sum::<f64>() / seconds.len().max(1) as f64;
        Self {
            stage: stage.to_owned(),
            system: system.to_owned(),
            n: seconds.len(),
            seconds: (mean * 1e5).round() / 1e5,
            peak_memory_mb: peak.map(|bytes| bytes / 1_000_000),
        }
    }
}

impl MachineInfo {
    /// This program on this machine.
    #[must_use]
    pub(crate) fn here() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: machine::revision().unwrap_or_default().to_owned(),
            program_sha256: machine::program_sha256().unwrap_or_default(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            cores: machine::cores().unwrap_or_default(),
            memory_mb: machine::total_memory().unwrap_or_default() / 1_000_000,
            vector: VectorLevel::chosen().map(|level| level.name().to_owned()).unwrap_or_default(),
            session: Vec::new(),
        }
    }
}

impl Record {
    /// The record in a folder, which need not be there yet.
    #[must_use]
    pub(crate) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// A file of the record.
    #[must_use]
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Opens the record for a run of `spec` (resolved) and writes it down. A record of the same experiment by the same build
    /// of the program is continued.
    ///
    /// # Errors
    /// When the folder holds a record of another experiment or build and `restart` is false; when it cannot be written.
    pub(crate) fn begin(&self, spec: &ExperimentSpec, restart: bool) -> Result<MachineInfo> {
        let here = MachineInfo::here();
        let path = self.path("resolved.toml");
        if restart {
            for name in KEPT {
                file::remove(&self.path(name))?;
                file::remove(&self.path(&format!("{name}.xz")))?;
            }
            PASSING.iter().try_for_each(|name| file::remove(&self.path(name)))?;
        } else if path.exists() && self.path("journal.csv").exists() {
            let mut old = ExperimentSpec::read(&path)?;
            // Words may change as long as nothing that is computed does.
            old.analysis.clone_from(&spec.analysis);
            (old.bound, old.printed) = (spec.bound.clone(), spec.printed.clone());
            if old != *spec {
                let allowed = "it holds a record of another experiment: name another --out, or add --restart to replace it";
                return Err(Error::file(&path, "experiment", format!("{:?}", old.title), allowed));
            }
            let machine = self.machine()?;
            if machine.program_sha256 != here.program_sha256 {
                let allowed = format!(
                    "this is another build of the program ({}): add --restart to start over, because one record does not mix two",
                    here.revision
                );
                return Err(Error::file(&self.path("machine.toml"), "revision", machine.revision, allowed));
            }
            if machine.vector != here.vector {
                let allowed = format!(
                    "this run would use {:?} ({VECTOR_VARIABLE}), and one record does not mix two: choose the record's, or add \
                     --restart to begin anew",
                    here.vector
                );
                return Err(Error::file(&self.path("machine.toml"), "vector", machine.vector, allowed));
            }
            file::write_bytes(&path, spec.to_toml().as_bytes())?;
            return Ok(machine);
        } else if self.has("scores.csv") {
            let allowed = "it holds a finished record: name another --out, or add --restart to replace it";
            return Err(Error::file(&self.folder, "record", "packed", allowed));
        }
        file::create_folder(&self.folder)?;
        file::write_bytes(&path, spec.to_toml().as_bytes())?;
        self.write_machine(&here)?;
        file::append(&self.path("journal.csv"), "")?;
        Ok(here)
    }

    /// The experiment as it was run.
    ///
    /// # Errors
    /// When the record has none, or it cannot be read.
    pub(crate) fn spec(&self) -> Result<ExperimentSpec> {
        ExperimentSpec::read(&self.path("resolved.toml"))
    }

    /// Program and machine.
    ///
    /// # Errors
    /// When the record does not say, or it cannot be read.
    pub(crate) fn machine(&self) -> Result<MachineInfo> {
        let bad = |e| Error::file(&self.path("machine.toml"), "machine", e, "allowed: what a run writes");
        toml::from_str(&self.text("machine.toml")?).map_err(bad)
    }

    /// Writes down program and machine.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// Never: it is plain data.
    pub(crate) fn write_machine(&self, info: &MachineInfo) -> Result<()> {
        let text = toml::to_string(info).expect("plain data");
        file::write_bytes(&self.path("machine.toml"), text.as_bytes())
    }

    /// All rows of a finished run.
    ///
    /// # Errors
    /// When there are none yet, or they cannot be read.
    pub(crate) fn scores(&self) -> Result<ScoreTable> {
        ScoreTable::of_csv(&self.path("scores.csv"), &self.text("scores.csv")?)
    }

    /// The rows that are finished so far. Half a line at the end, left by a crash, is cut off the file.
    ///
    /// # Errors
    /// When the journal cannot be read, or is damaged elsewhere.
    pub(crate) fn journal(&self, columns: usize) -> Result<BTreeMap<Key, Timed>> {
        let path = self.path("journal.csv");
        let text = self.text("journal.csv")?;
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        if whole.len() < text.len() {
            file::write_bytes(&path, whole.as_bytes())?;
        }
        let bad = |line: usize, e: &dyn std::fmt::Display| {
            let allowed = "the journal is damaged: add --restart to start over";
            Error::file(&path, format!("line {line}"), e, allowed)
        };
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(whole.as_bytes());
        let mut rows = BTreeMap::new();
        for (i, line) in reader.records().enumerate() {
            let mut line = line.map_err(|e| bad(i + 1, &e))?;
            let seconds = line.get(line.len().saturating_sub(1)).unwrap_or_default();
            let seconds: f64 = seconds.parse().map_err(|_| bad(i + 1, &seconds))?;
            line.truncate(line.len() - 1);
            let row = ScoreRow::read(&line, columns).map_err(|e| bad(i + 1, &e))?;
            rows.insert(row.key.clone(), (row, seconds));
        }
        Ok(rows)
    }

    /// Adds finished rows to the journal, all in one write.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn note(&self, rows: &[Timed]) -> Result<()> {
        let lines = rows.iter().map(|(row, seconds)| (row, format!("{seconds:.4}")));
        file::append(&self.path("journal.csv"), &csv_lines(lines)?)
    }

    /// Writes `scores.csv` and `timings.csv`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn write_scores(&self, columns: &[&str], rows: &[Timed]) -> Result<()> {
        let columns = columns.iter().map(|&name| name.to_owned()).collect();
        let table = ScoreTable { columns, rows: rows.iter().map(|(row, _)| row.clone()).collect() };
        let header = ["system", "area", "row", "col", "seed", "sketch", "seconds"];
        let times = csv_lines(rows.iter().map(|(row, seconds)| (&row.key, format!("{seconds:.4}"))))?;
        file::write_bytes(&self.path("timings.csv"), (csv_lines([header])? + &times).as_bytes())?;
        file::write_bytes(&self.path("scores.csv"), table.to_csv()?.as_bytes())
    }

    /// Writes a table, whose header names the fields of its rows.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn write_table<T: Serialize>(&self, name: &str, rows: &[T]) -> Result<()> {
        file::write_bytes(&self.path(name), csv_table(rows)?.as_bytes())
    }

    /// The rows of a table; none when the record has no such table.
    ///
    /// # Errors
    /// When the file cannot be read or a line is not such a row.
    pub(crate) fn table<T: DeserializeOwned>(&self, name: &str) -> Result<Vec<T>> {
        if !self.has(name) {
            return Ok(Vec::new());
        }
        table_of(&self.path(name), &self.text(name)?)
    }

    /// Takes seconds and memory that others measured into the record: a CSV file with the columns of `stages.csv`.
    ///
    /// # Errors
    /// When the file cannot be read or is not such a table.
    pub(crate) fn add_peers(&self, path: &Path) -> Result<()> {
        let text = file::read_text(path, LARGEST)?;
        let head = text.lines().next().unwrap_or_default().trim();
        let expected = "stage,system,n,seconds,peak_memory_mb";
        if head != expected {
            return Err(Error::file(path, "line 1", head, format!("allowed: {expected}")));
        }
        table_of::<StageRow>(path, &text)?;
        file::write_bytes(&self.path("peers.csv"), text.as_bytes())
    }

    /// Files of a folder of the record, in the order of their names.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub(crate) fn list(&self, name: &str) -> Result<Vec<PathBuf>> {
        file::list(&self.path(name))
    }

    /// Whether the record holds a file, as it is or compressed.
    #[must_use]
    pub(crate) fn has(&self, name: &str) -> bool {
        self.path(name).is_file() || self.path(&format!("{name}.xz")).is_file()
    }

    /// Keeps what a repository should hold: `summary.md` with the given text, compressed tables, experiment and machine. A run
    /// cannot be continued after it.
    ///
    /// # Errors
    /// When the record is not finished, or a file cannot be read or written.
    pub(crate) fn pack(&self, summary: &str) -> Result<()> {
        self.scores()?;
        file::write_bytes(&self.path("summary.md"), summary.as_bytes())?;
        for name in KEPT {
            let path = self.path(name);
            if !path.is_file() {
                continue;
            }
            file::write_packed(&self.path(&format!("{name}.xz")), &file::read_whole(&path, LARGEST)?)?;
            file::remove(&path)?;
        }
        PASSING.iter().try_for_each(|name| file::remove(&self.path(name)))
    }

    fn text(&self, name: &str) -> Result<String> {
        let packed = self.path(&format!("{name}.xz"));
        if self.path(name).exists() || !packed.is_file() {
            return file::read_text(&self.path(name), LARGEST);
        }
        file::read_packed(&packed, LARGEST)
    }
}

fn table_of<T: DeserializeOwned>(path: &Path, text: &str) -> Result<Vec<T>> {
    let bad = |line: usize, e: &dyn std::fmt::Display| {
        Error::file(path, format!("line {line}"), e, "allowed: what a run writes")
    };
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let head = reader.headers().map_err(|e| bad(1, &e))?.clone();
    let row = |(i, line): (usize, csv::Result<csv::StringRecord>)| {
        let line = line.map_err(|e| bad(i + 2, &e))?;
        line.deserialize(Some(&head)).map_err(|e| bad(i + 2, &complaint(&e, &line)))
    };
    reader.records().enumerate().map(row).collect()
}
