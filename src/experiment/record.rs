//! The folder of a run: what was asked, what came out, on which machine.
//!
//! | file | what |
//! |---|---|
//! | `resolved.toml` | the experiment with nothing left open; written first |
//! | `machine.toml` | program, revision, machine, and how long each session took |
//! | `journal.csv` | rows as they are finished, with their seconds; lets an interrupted run continue |
//! | `styles/` | the trained styles, by a hash of configuration, exemplar and seed |
//! | `scores.csv` | all rows in the experiment's order; the same bytes in every run |
//! | `timings.csv`, `training.csv` | seconds of every row, and of every training |
//! | `exemplars.csv`, `states.csv`, `stages.csv` | what some kinds know beside the scores  |
//! | `pictures/`, `plots/` | PNG of a few patches, SVG of the scores |
//! | `report.html` | all of it to be read |

use super::extras::STAGE_HEAD;
use super::rows::{Key, ScoreRow, ScoreTable, csv_lines};
use super::spec::ExperimentSpec;
use crate::error::{Error, Result};
use crate::file;
use crate::machine::{self, VECTOR_VARIABLE, VectorLevel};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// No file of a record is larger.
const LARGEST: u64 = 1 << 30;

/// A record's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    folder: PathBuf,
}

/// The program and the machine of a record.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MachineInfo {
    /// Version of the program.
    pub version: String,
    /// Revision of its source, as far as known.
    pub revision: String,
    /// SHA-256 of the program's file.
    pub program_sha256: String,
    /// Operating system and processor architecture.
    pub system: String,
    /// Cores that the process may use.
    pub cores: usize,
    /// Memory of the machine, MB.
    pub memory_mb: u64,
    /// Vector instructions of the kernels (`scalar`, `avx2`, `avx512`); empty in records from before they could be chosen.
    pub vector: String,
    /// One entry each time the run was started or continued.
    pub session: Vec<Session>,
}

/// One stretch of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Seconds from beginning to end.
    pub seconds: f64,
    /// Styles trained at once.
    pub jobs: usize,
    /// Threads in all.
    pub threads: usize,
    /// Styles trained.
    pub trained: usize,
    /// Rows scored.
    pub rows: usize,
    /// Largest memory of the process, MB.
    pub peak_memory_mb: u64,
}

/// What is known of one training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingRow {
    /// The style.
    pub style: String,
    /// The area.
    pub area: String,
    /// The seed.
    pub seed: u64,
    /// Weights of the network.
    pub parameters: usize,
    /// Steps.
    pub epochs: usize,
    /// Seconds of the steps.
    pub seconds: f64,
    /// Seconds before them.
    pub preparation_seconds: f64,
    /// Median seconds of a step.
    pub seconds_per_epoch: f64,
    /// What is known of its detail; none without.
    pub detail: Option<DetailRow>,
    /// Why it failed; empty when it did not.
    pub error: String,
}

/// What is known of the detail of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetailRow {
    /// Seconds of its training.
    pub seconds: f64,
    /// What strength 1 is worth.
    pub gain: f64,
    /// PSNR of the rebuilt exemplar, decibels; patches rebuild none.
    pub psnr: Option<f64>,
}

/// A finished row with the seconds that it took.
pub type Timed = (ScoreRow, f64);

impl MachineInfo {
    /// This program on this machine.
    #[must_use]
    pub fn here() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: machine::revision().unwrap_or_default(),
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
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// A file of the record.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Opens the record for a run of `spec` (resolved) and writes it down. A record of the same experiment by the same build
    /// of the program is continued.
    ///
    /// # Errors
    /// When the folder holds a record of another experiment or build and `restart` is false; when it cannot be written.
    pub fn begin(&self, spec: &ExperimentSpec, restart: bool) -> Result<MachineInfo> {
        let here = MachineInfo::here();
        let path = self.path("resolved.toml");
        if restart {
            for name in [
                "journal.csv",
                "machine.toml",
                "styles",
                "scores.csv",
                "timings.csv",
                "training.csv",
                "exemplars.csv",
                "states.csv",
                "stages.csv",
                "peers.csv",
            ] {
                file::remove(&self.path(name))?;
            }
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
                    "this is another build of the program ({}): add --restart to begin anew, because one record does not mix \
                     two",
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
        }
        file::create_folder(&self.path(""))?;
        file::write_bytes(&path, spec.to_toml().as_bytes())?;
        self.write_machine(&here)?;
        file::append(&self.path("journal.csv"), "")?;
        Ok(here)
    }

    /// The experiment as it was run.
    ///
    /// # Errors
    /// When the record has none, or it cannot be read.
    pub fn spec(&self) -> Result<ExperimentSpec> {
        ExperimentSpec::read(&self.path("resolved.toml"))
    }

    /// Program and machine.
    ///
    /// # Errors
    /// When the record does not say, or it cannot be read.
    pub fn machine(&self) -> Result<MachineInfo> {
        let path = self.path("machine.toml");
        toml::from_str(&self.text("machine.toml")?)
            .map_err(|e| Error::file(&path, "machine", e, "allowed: what a run writes"))
    }

    /// Writes down program and machine.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// Never: it is plain data.
    pub fn write_machine(&self, info: &MachineInfo) -> Result<()> {
        let text = toml::to_string(info).expect("plain data");
        file::write_bytes(&self.path("machine.toml"), text.as_bytes())
    }

    /// All rows of a finished run.
    ///
    /// # Errors
    /// When there are none yet, or they cannot be read.
    pub fn scores(&self) -> Result<ScoreTable> {
        ScoreTable::of_csv(&self.path("scores.csv"), &self.text("scores.csv")?)
    }

    /// The rows that are finished so far. Half a line at the end, left by a crash, is cut off the file.
    ///
    /// # Errors
    /// When the journal cannot be read, or is damaged elsewhere.
    pub fn journal(&self, columns: usize) -> Result<BTreeMap<Key, Timed>> {
        let path = self.path("journal.csv");
        let text = self.text("journal.csv")?;
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        if whole.len() < text.len() {
            file::write_bytes(&path, whole.as_bytes())?;
        }
        let bad = |line: usize, e: &dyn std::fmt::Display| {
            Error::file(
                &path,
                format!("line {line}"),
                e,
                "the journal is damaged: add --restart to begin anew",
            )
        };
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(whole.as_bytes());
        let mut rows = BTreeMap::new();
        for (i, line) in reader.records().enumerate() {
            let line = line.map_err(|e| bad(i + 1, &e))?;
            let fields: Vec<&str> = line.iter().collect();
            let (seconds, fields) = fields.split_last().ok_or_else(|| bad(i + 1, &"empty"))?;
            let seconds = seconds.parse().map_err(|_| bad(i + 1, seconds))?;
            let row = ScoreRow::of_fields(fields, columns).map_err(|e| bad(i + 1, &e))?;
            rows.insert(row.key.clone(), (row, seconds));
        }
        Ok(rows)
    }

    /// Adds finished rows to the journal, all in one write.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn note(&self, rows: &[Timed]) -> Result<()> {
        let lines = rows.iter().map(|(row, seconds)| {
            let mut fields = row.fields();
            fields.push(format!("{seconds:.4}"));
            fields
        });
        file::append(&self.path("journal.csv"), &csv_lines(lines))
    }

    /// Writes `scores.csv` and `timings.csv`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write_scores(&self, columns: &[&str], rows: &[Timed]) -> Result<()> {
        let names = columns.iter().map(|&name| name.to_owned()).collect();
        let table = ScoreTable { columns: names, rows: rows.iter().map(|(row, _)| row.clone()).collect() };
        let header =
            ["system", "area", "row", "col", "seed", "sketch", "seconds"].map(str::to_owned).to_vec();
        let times = rows.iter().map(|(row, seconds)| {
            let mut fields = row.fields();
            fields.truncate(6);
            fields.push(format!("{seconds:.4}"));
            fields
        });
        file::write_bytes(
            &self.path("timings.csv"),
            csv_lines(std::iter::once(header).chain(times)).as_bytes(),
        )?;
        file::write_bytes(&self.path("scores.csv"), table.to_csv().as_bytes())
    }

    /// Writes `training.csv`.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_training(&self, rows: &[TrainingRow]) -> Result<()> {
        let header = "style,area,seed,parameters,epochs,seconds,preparation_seconds,seconds_per_epoch,\
                      detail_seconds,detail_gain,detail_psnr,error";
        let lines = rows.iter().map(|r| {
            let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.3}"));
            vec![
                r.style.clone(),
                r.area.clone(),
                r.seed.to_string(),
                r.parameters.to_string(),
                r.epochs.to_string(),
                format!("{:.3}", r.seconds),
                format!("{:.3}", r.preparation_seconds),
                format!("{:.5}", r.seconds_per_epoch),
                number(r.detail.map(|d| d.seconds)),
                number(r.detail.map(|d| d.gain)),
                number(r.detail.and_then(|d| d.psnr)),
                r.error.replace(['\n', '\r'], " "),
            ]
        });
        let header = header.split(',').map(str::to_owned).collect();
        file::write_bytes(
            &self.path("training.csv"),
            csv_lines(std::iter::once(header).chain(lines)).as_bytes(),
        )
    }

    /// The trainings of a finished run.
    ///
    /// # Errors
    /// When there are none yet, or they cannot be read.
    pub fn training(&self) -> Result<Vec<TrainingRow>> {
        let path = self.path("training.csv");
        let text = self.text("training.csv")?;
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let head =
            reader.headers().map_err(|e| Error::file(&path, "line 1", e, "allowed: what a run writes"))?;
        let column = |name: &str| head.iter().position(|h| h == name);
        // Records from before styles had detail here lack its columns.
        let [detail_seconds, detail_gain, detail_psnr, error] =
            ["detail_seconds", "detail_gain", "detail_psnr", "error"].map(column);
        let row = |(i, line): (usize, csv::Result<csv::StringRecord>)| {
            let bad = |e: &dyn std::fmt::Display| {
                Error::file(&path, format!("line {}", i + 2), e, "allowed: what a run writes")
            };
            let line = line.map_err(|e| bad(&e))?;
            let field = |k: usize| line.get(k).unwrap_or_default();
            let number = |k: usize| field(k).parse::<f64>().map_err(|_| bad(&field(k)));
            let optional = |k: Option<usize>| k.filter(|&k| !field(k).is_empty()).map(number).transpose();
            let detail = match (optional(detail_seconds)?, optional(detail_gain)?) {
                (Some(seconds), Some(gain)) => {
                    Some(DetailRow { seconds, gain, psnr: optional(detail_psnr)? })
                }
                _ => None,
            };
            Ok(TrainingRow {
                style: field(0).to_owned(),
                area: field(1).to_owned(),
                seed: field(2).parse().map_err(|_| bad(&field(2)))?,
                parameters: number(3)? as usize,
                epochs: number(4)? as usize,
                seconds: number(5)?,
                preparation_seconds: number(6)?,
                seconds_per_epoch: number(7)?,
                detail,
                error: error.map_or("", field).to_owned(),
            })
        };
        reader.records().enumerate().map(row).collect()
    }

    /// Writes a table beside the scores.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_table(&self, name: &str, head: &[&str], rows: Vec<Vec<String>>) -> Result<()> {
        let head = head.iter().map(|&name| name.to_owned()).collect();
        file::write_bytes(&self.path(name), csv_lines(std::iter::once(head).chain(rows)).as_bytes())
    }

    /// The rows of a table beside the scores, without its head; none when the record has no such table.
    ///
    /// # Errors
    /// When the file cannot be read or a line has not as many fields as `head`.
    pub fn table(&self, name: &str, head: &[&str]) -> Result<Option<Vec<Vec<String>>>> {
        let path = self.path(name);
        if !path.is_file() {
            return Ok(None);
        }
        let text = self.text(name)?;
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let bad = |line: usize, found: &dyn std::fmt::Display| {
            Error::file(&path, format!("line {line}"), found, format!("allowed: {}", head.join(",")))
        };
        let row = |(i, line): (usize, csv::Result<csv::StringRecord>)| {
            let line = line.map_err(|e| bad(i + 2, &e))?;
            let fields: Vec<String> = line.iter().map(str::to_owned).collect();
            if fields.len() == head.len() { Ok(fields) } else { Err(bad(i + 2, &fields.join(","))) }
        };
        reader.records().enumerate().map(row).collect::<Result<_>>().map(Some)
    }

    /// Takes seconds and memory that others measured into the record: a CSV file with the columns of `stages.csv`.
    ///
    /// # Errors
    /// When the file cannot be read or is not such a table.
    pub fn add_peers(&self, path: &Path) -> Result<()> {
        let text = String::from_utf8(file::read_whole(path, LARGEST)?)
            .map_err(|e| Error::file(path, "text", e, "allowed: UTF-8"))?;
        let head = text.lines().next().unwrap_or_default().trim();
        if head != STAGE_HEAD.join(",") {
            return Err(Error::file(path, "line 1", head, format!("allowed: {}", STAGE_HEAD.join(","))));
        }
        file::write_bytes(&self.path("peers.csv"), text.as_bytes())?;
        self.table("peers.csv", &STAGE_HEAD).map(|_| ())
    }

    /// Files of a folder of the record, in the order of their names.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn list(&self, name: &str) -> Result<Vec<PathBuf>> {
        file::list(&self.path(name))
    }

    fn text(&self, name: &str) -> Result<String> {
        let path = self.path(name);
        String::from_utf8(file::read_whole(&path, LARGEST)?)
            .map_err(|e| Error::file(&path, "text", e, "allowed: UTF-8"))
    }
}
