//! Experiments from the outside: their files, a run with its record, continuing and repeating it, reports and documents.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::experiment::areas::Terrain;
use crate::experiment::documents::{self, Form};
use crate::experiment::events::Event;
use crate::experiment::record::{Record, TrainingRow};
use crate::experiment::resolve::resolve;
use crate::experiment::run::{RunOptions, run};
use crate::experiment::spec::DetailSpec;
use crate::experiment::{ExperimentSpec, Kind, bounds, report};
use crate::machine::VectorLevel;
use crate::style::{GeneratorConfig, Style};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Two systems beside an interpolator on two patches with two seeds, in a few seconds.
const SMALL: &str = include_str!("../../../tests/fixtures/small-experiment.toml");

fn spec(text: &str) -> crate::Result<ExperimentSpec> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    fs::write(&path, text).unwrap();
    ExperimentSpec::read(&path)
}

fn options(out: &Path, jobs: usize) -> RunOptions {
    fs::create_dir_all(out).unwrap();
    RunOptions { out: out.to_owned(), jobs, restart: false, styles: None }
}

fn scores(out: &Path) -> String {
    fs::read_to_string(out.join("scores.csv")).unwrap()
}

/// The files of a folder of experiments by name.
fn experiments(folder: &str) -> Vec<(String, ExperimentSpec)> {
    let files = fs::read_dir(root().join("experiments").join(folder)).unwrap();
    let mut paths: Vec<PathBuf> = files.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let tomls = paths.into_iter().filter(|p| p.extension().is_some_and(|e| e == "toml"));
    tomls
        .map(|p| (p.file_stem().unwrap().to_str().unwrap().to_owned(), ExperimentSpec::read(&p).unwrap()))
        .collect()
}

#[test]
fn every_experiment_can_be_run_and_has_a_quick_twin() {
    let (full, quick) = (experiments("full"), experiments("quick"));
    assert!(full.len() >= 14, "{}", full.len());
    for (name, spec) in &full {
        assert!(spec.seeds.len() >= 3, "{name}: {} seeds", spec.seeds.len());
        assert!(!spec.bound.is_empty(), "{name} expects nothing");
        let twin =
            quick.iter().find(|(twin, _)| twin == name).unwrap_or_else(|| panic!("{name} has no twin"));
        assert_eq!(twin.1.kind, spec.kind, "{name}");
    }
    for (name, spec) in &quick {
        assert!(full.iter().any(|(other, _)| other == name), "{name} is the twin of nothing");
        // The embedded tiles alone.
        resolve(spec, &Terrain::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    let kinds: Vec<Kind> = full.iter().map(|(_, spec)| spec.kind).collect();
    for kind in Kind::ALL {
        assert!(kinds.contains(&kind), "{kind:?}");
    }
}

#[test]
fn bad_values_are_named_with_what_is_allowed() {
    spec(SMALL).unwrap();
    let refused = |from: &str, to: &str, words: &[&str]| {
        assert!(SMALL.contains(from), "{from}");
        let message = spec(&SMALL.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(message.contains("small.toml"), "{message}");
        words.iter().for_each(|word| assert!(message.contains(word), "{word:?} is missing in: {message}"));
    };
    refused("kind = \"neighbours\"", "kind = \"magic\"", &["magic", "neighbours"]);
    refused("title = \"Small\"", "title = \"Small\"\ntitel = 3", &["titel"]);
    refused("title = \"Small\"", "title = \" \"", &["title", "empty"]);
    refused("seeds = [1, 2]", "seeds = []", &["seeds", "at least one"]);
    refused("seeds = [1, 2]", "seeds = [1, 1]", &["seeds is 1", "once"]);
    refused("budget_minutes = 1", "budget_minutes = 0", &["budget_minutes is 0", "above 0"]);
    refused("\"psnr\"]", "\"pnsr\"]", &["metrics", "pnsr", "interior_ssim"]);
    refused("[\"nearest\"]", "[\"closest\"]", &["interpolators", "closest", "natural-neighbour"]);
    refused("patches_per_area = 2", "patches_per_area = 0", &["patches_per_area"]);
    refused("epochs = 2", "epochs = 0", &["style \"one\"", "epochs", "1 to"]);
    refused("epochs = 2", "epoch = 2", &["style \"one\"", "epoch"]);
    refused("name = \"thin\"", "name = \"one\"", &["style names", "one"]);
    refused("name = \"thin\"", "name = \"a b\"", &["a b", "letters"]);
    refused("name = \"thin\"", "name = \"thin\"\nsystems = [\"gan\"]", &["thin", "gan", "gnn"]);
    refused("exemplar = [128, 0, 64]", "exemplar = [128]", &["exemplar", "sierra", "[128]"]);
    refused("exemplar", "patches = [[0, 0], [0, 0]]\nexemplar", &["patches", "[0, 0]", "once"]);
    refused("metric = \"ssim\"", "metric = \"mse\"", &["metric of bound 1", "mse"]);
    refused("min = 0.5", "min = 2\nmax = 1", &["min of bound 1", "2"]);
    refused("min = 0.5", "", &["min and max of bound 1"]);
    refused("min = 0.5", "min = 0\nagainst = { system = \"none\" }", &["against.system", "none", "nearest"]);
    refused("kind = \"neighbours\"", "kind = \"sparse\"", &["number of sketches is 0", "at least 2"]);
    refused("kind = \"neighbours\"", "kind = \"fit\"", &["fit"]);
    refused("title = \"Small\"", "title = \"Small\"\nbaseline = \"one\"", &["baseline", "ablation"]);
    refused("title = \"Small\"", "title = \"Small\"\nhighlight = \"two\"", &["highlight", "two", "thin"]);

    let unresolved = |from: &str, to: &str, words: &[&str]| {
        let spec = spec(&SMALL.replacen(from, to, 1)).unwrap();
        let message = resolve(&spec, &Terrain::default()).unwrap_err().to_string();
        words.iter().for_each(|word| assert!(message.contains(word), "{word:?} is missing in: {message}"));
    };
    unresolved("name = \"sierra\"", "name = \"alps\"", &["alps", "sierra, grand-canyon", "--data"]);
    unresolved("[128, 0, 64]", "[500, 0, 64]", &["500", "sierra"]);
    unresolved("exemplar", "fingerprint = \"00\"\nexemplar", &["fingerprint", "sierra", "00"]);
    let overlap = &["patch 64,60", "shares cells", "128,0", "apart"];
    unresolved("exemplar", "patches = [[0, 128], [64, 60]]\nexemplar", overlap);
    unresolved("exemplar", "patches = [[500, 0]]\nexemplar", &["500"]);
}

#[test]
fn detail_has_names_or_settings() {
    let style = |detail: &str| {
        let text = SMALL.replace("name = \"thin\"", &format!("name = \"thin\"\ndetail = {detail}"));
        spec(&text).map(|spec| spec.style[1].detail.clone().unwrap())
    };
    assert!(matches!(style("\"patches\"").unwrap(), DetailSpec::Patches(_)));
    for (detail, config) in [
        ("\"generators\"", GeneratorConfig::default()),
        ("\"paper\"", GeneratorConfig::paper()),
        ("{ steps = 3 }", GeneratorConfig { steps: 3, ..GeneratorConfig::default() }),
    ] {
        assert_eq!(style(detail).unwrap(), DetailSpec::Generators(config), "{detail}");
    }
    let error = style("\"published\"").unwrap_err().to_string();
    for words in ["small.toml", "published", "patches", "generators", "paper"] {
        assert!(error.contains(words), "{words:?} is missing in: {error}");
    }
}

/// With detail and without, and from before there were columns for it.
#[test]
fn trainings_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let record = Record::new(folder.path());
    let row = TrainingRow {
        style: "one".into(),
        area: "sierra".into(),
        seed: 2,
        parameters: 100,
        epochs: 3,
        seconds: 1.5,
        preparation_seconds: 0.25,
        seconds_per_epoch: 0.5,
        ..TrainingRow::default()
    };
    let failed = TrainingRow { error: "failed, twice".into(), ..row.clone() };
    let patches = TrainingRow { detail_seconds: Some(122.5), detail_gain: Some(1.25), ..row };
    let generators = TrainingRow { detail_psnr: Some(32.125), ..patches.clone() };
    let rows = [failed, patches, generators];
    record.write_table("training.csv", &rows).unwrap();
    assert_eq!(record.table::<TrainingRow>("training.csv").unwrap(), rows);

    let old = "style,area,seed,parameters,epochs,seconds,preparation_seconds,seconds_per_epoch,error\n\
               one,sierra,2,100,3,1.5,0.25,0.5,\"failed, twice\"\n";
    fs::write(record.path("training.csv"), old).unwrap();
    assert_eq!(record.table::<TrainingRow>("training.csv").unwrap(), rows[..1]);
}

#[test]
fn interrupted_and_repeated_runs_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let resolved = resolve(&spec(SMALL).unwrap(), &Terrain::default()).unwrap();
    let outcome = run(&resolved, &options(&at("a"), 1), &|_| {}).unwrap();
    assert_eq!((outcome.rows, outcome.failed), (2 * 2 * 3, 0));
    let first = scores(&at("a"));
    assert_eq!(first.lines().count(), 1 + outcome.rows);
    assert!(first.lines().next().unwrap().contains("interior_ssim"));
    assert!(fs::read_dir(at("a/pictures")).unwrap().count() == 1);
    let record = Record::new(&at("a"));
    let training: Vec<TrainingRow> = record.table("training.csv").unwrap();
    assert_eq!(training.len(), 4);
    assert!(
        training.iter().all(|t| t.epochs == 2 && t.seconds > 0.0 && t.parameters > 100 && t.error.is_empty())
    );
    // Interpolators draw nothing at random; trained styles do.
    let table = record.scores().unwrap();
    let of = |system: &str, seed: u64| -> Vec<Option<f64>> {
        let rows = table.rows.iter().filter(|r| r.key.system == system && r.key.seed == seed);
        rows.map(|r| r.values[0]).collect()
    };
    assert_eq!(of("nearest", 1), of("nearest", 2));
    assert_ne!(of("one", 1), of("one", 2));
    assert_ne!(of("one", 1), of("thin", 1));

    // As if it had been killed in the middle of a line: nothing that was finished is done again.
    let journal = fs::read_to_string(at("a/journal.csv")).unwrap();
    let lines: Vec<&str> = journal.split_inclusive('\n').collect();
    assert_eq!(lines.len(), 12);
    let torn = lines[..6].concat() + &lines[6][..lines[6].len() / 2];
    fs::write(at("a/journal.csv"), &torn).unwrap();
    fs::remove_file(at("a/scores.csv")).unwrap();
    let events = Mutex::new(Vec::new());
    run(&resolved, &options(&at("a"), 1), &|event| events.lock().unwrap().push(event)).unwrap();
    assert_eq!(scores(&at("a")), first);
    let events = events.into_inner().unwrap();
    assert!(events.contains(&Event::Training { styles: 4, cached: 4, steps: 0 }), "{events:?}");
    assert!(events.contains(&Event::Scoring { rows: 6, kept: 6 }), "{events:?}");
    assert!(fs::read_to_string(at("a/journal.csv")).unwrap().starts_with(&lines[..6].concat()));
    assert_eq!(record.machine().unwrap().session.len(), 2);

    // A style file that is torn is trained again; the journal alone does not make a run.
    let style = fs::read_dir(at("a/styles")).unwrap().next().unwrap().unwrap().path();
    fs::write(&style, b"torn").unwrap();
    run(&resolved, &options(&at("a"), 2), &|_| {}).unwrap();
    assert_eq!(scores(&at("a")), first);

    // From the record's own file, with other jobs.
    let again = ExperimentSpec::read(&at("a/resolved.toml")).unwrap();
    assert_eq!(again, resolved.spec);
    let again = resolve(&again, &Terrain::default()).unwrap();
    assert_eq!(again.spec, resolved.spec, "nothing is left open in a resolved file");
    run(&again, &options(&at("b"), 3), &|_| {}).unwrap();
    assert_eq!(scores(&at("b")), first);
    assert_eq!(fs::read(at("a/resolved.toml")).unwrap(), fs::read(at("b/resolved.toml")).unwrap());

    // Another experiment or another build does not get mixed in.
    let other =
        resolve(&spec(&SMALL.replace("epochs = 2", "epochs = 3")).unwrap(), &Terrain::default()).unwrap();
    let message = run(&other, &options(&at("b"), 1), &|_| {}).unwrap_err().to_string();
    assert!(message.contains("another experiment") && message.contains("--restart"), "{message}");
    let mut machine = Record::new(&at("b")).machine().unwrap();
    machine.program_sha256 = "another".into();
    Record::new(&at("b")).write_machine(&machine).unwrap();
    let message = run(&resolved, &options(&at("b"), 1), &|_| {}).unwrap_err().to_string();
    assert!(message.contains("another build") && message.contains("--restart"), "{message}");
    let restart = RunOptions { restart: true, ..options(&at("b"), 1) };
    run(&other, &restart, &|_| {}).unwrap();
    assert_ne!(scores(&at("b")), first);
    // Words may change, and so may what is expected.
    let mut reworded = other.clone();
    reworded.spec.analysis = "Now it is clear.".into();
    reworded.spec.bound.clear();
    run(&reworded, &options(&at("b"), 1), &|_| {}).unwrap();
    assert_eq!(Record::new(&at("b")).spec().unwrap().analysis, "Now it is clear.");
    // Nor do two levels of vector instructions.
    let level = VectorLevel::chosen().unwrap().name().to_owned();
    let mut machine = Record::new(&at("b")).machine().unwrap();
    assert_eq!(machine.vector, level);
    machine.vector = "another".into();
    Record::new(&at("b")).write_machine(&machine).unwrap();
    let message = run(&reworded, &options(&at("b"), 1), &|_| {}).unwrap_err().to_string();
    assert!(
        message.contains("another") && message.contains(&level) && message.contains("--restart"),
        "{message}"
    );
    machine.vector = level;
    Record::new(&at("b")).write_machine(&machine).unwrap();
    // A damaged journal is not passed over.
    fs::write(at("b/journal.csv"), "one,sierra,many\n").unwrap();
    assert!(
        run(&reworded, &options(&at("b"), 1), &|_| {})
            .unwrap_err()
            .to_string()
            .contains("journal.csv: line 1")
    );
}

#[test]
fn experiments_share_styles_of_the_same_training() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let shared = |name: &str| RunOptions { styles: Some(at("styles")), ..options(&at(name), 1) };
    let trained = |text: &str, options: &RunOptions| {
        let seen = Mutex::new(None);
        let watch = |event: Event| {
            if let Event::Training { styles, cached, .. } = event {
                *seen.lock().unwrap() = Some(styles - cached);
            }
        };
        run(&resolve(&spec(text).unwrap(), &Terrain::default()).unwrap(), options, &watch).unwrap();
        seen.into_inner().unwrap().unwrap()
    };
    let unblended = format!("{SMALL}\n[overrides.generation]\nblend = \"never\"\n");
    let uncorrected = format!("{SMALL}\n[overrides.generation]\ncorrection = \"harmonic\"\n");
    assert_eq!(trained(SMALL, &shared("a")), 4);
    assert_eq!(trained(&unblended, &shared("b")), 0);
    assert_ne!(scores(&at("a")), scores(&at("b")));
    assert_eq!(trained(&unblended, &options(&at("alone"), 1)), 4);
    assert_eq!(scores(&at("alone")), scores(&at("b")));
    assert_eq!(trained(&uncorrected, &shared("c")), 4);
}

/// An exemplar on which a style finds no line cannot be learned from: rows with that error, no hole, and a broken bound.
#[test]
fn what_fails_is_a_row_with_its_error() {
    let folder = tempfile::tempdir().unwrap();
    let text = SMALL.replace("set.model.width = 16", "set.extraction.min_accumulation = 4000000000");
    let text =
        text.replace("seeds = [1, 2]", "seeds = [3]").replace("min = 0.5", "system = \"thin\"\nmin = 0.5");
    let resolved = resolve(&spec(&text).unwrap(), &Terrain::default()).unwrap();
    let told = Mutex::new(0);
    let outcome = run(&resolved, &options(folder.path(), 1), &|event| {
        *told.lock().unwrap() += usize::from(matches!(event, Event::Failed(_)));
    })
    .unwrap();
    assert_eq!((outcome.rows, outcome.failed), (6, 2));
    assert!(told.into_inner().unwrap() >= 3, "the training and two rows");
    let record = Record::new(folder.path());
    let table = record.scores().unwrap();
    for row in table.rows.iter().filter(|row| row.key.system == "thin") {
        assert!(row.error.contains("number of line cells is 0"), "{}", row.error);
        assert!(row.values.iter().all(Option::is_none));
    }
    assert!(record.table::<TrainingRow>("training.csv").unwrap()[1].error.contains("line cells"));
    let verdict = bounds::check(&resolved.spec, &table).unwrap().remove(0);
    assert!(!verdict.is_kept() && verdict.failures == 2, "{verdict}");
    let page = fs::read_to_string(report::write(&record).unwrap()).unwrap();
    assert!(page.contains("of which 2 failed") && page.contains("number of line cells is 0"));
}

#[test]
fn a_fit_agrees_with_the_styles_own_record() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"
kind = "fit"
title = "Fit"
question = "How close?"
seeds = [5]
budget_minutes = 1
metrics = ["ssim", "l_gt"]
interpolators = ["laplace"]
[[style]]
name = "anchored"
set.model = { epochs = 3, extractions = 2, splits = 1 }
[[area]]
name = "grand-canyon"
exemplar = [64, 64, 64]
"#;
    let resolved = resolve(&spec(text).unwrap(), &Terrain::default()).unwrap();
    run(&resolved, &options(folder.path(), 1), &|_| {}).unwrap();
    let table = Record::new(folder.path()).scores().unwrap();
    assert_eq!(table.rows.len(), 2);
    let style = fs::read_dir(folder.path().join("styles")).unwrap().next().unwrap().unwrap().path();
    let style = Style::load(&style).unwrap();
    let training = style.network().unwrap().training();
    let value = |row: usize, name: &str| table.rows[row].values[table.column(name).unwrap()];
    let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-6 * b.abs(), "{a} {b}");
    near(value(0, "ssim").unwrap(), training.ssim.unwrap());
    near(value(0, "psnr").unwrap(), training.psnr);
    near(value(0, "l_gt").unwrap(), training.l_gt);
    let last = training.history.last().unwrap().losses;
    near(value(0, "train_l_gradient").unwrap(), last.gradient);
    near(value(0, "train_l_sketch").unwrap(), last.sketch);
    near(value(0, "train_ssim").unwrap(), 1.0 - last.ssim);
    assert_eq!((value(1, "train_l_gt"), value(1, "l_gt").is_some()), (None, true), "laplace learns nothing");
}

/// What the project's own documents show is what the records say.
#[test]
fn tables_in_documents_are_those_of_the_records() {
    let records = root().join("experiments/records");
    for document in ["README.md", "docs/results.md", "docs/papers/region_gnn.md"] {
        assert!(!documents::markers(&root().join(document)).unwrap().is_empty(), "{document}");
        let path = root().join(document);
        assert_eq!(documents::stale(&path, &records).unwrap(), Vec::<String>::new(), "{document}");
    }

    let folder = tempfile::tempdir().unwrap();
    let (records, document) = (folder.path().join("records"), folder.path().join("README.md"));
    let text = "# Title\n<!-- experiment small -->\nformer text\n<!-- /experiment small -->\nend\n";
    fs::write(&document, text).unwrap();
    assert_eq!(documents::stale(&document, &records).unwrap(), ["small"], "there is no record");
    let small = SMALL.replace("seeds = [1, 2]", "seeds = [1]").replace("pictures = 1", "pictures = 0");
    let resolved = resolve(&spec(&small).unwrap(), &Terrain::default()).unwrap();
    run(&resolved, &options(&records.join("small"), 1), &|_| {}).unwrap();
    let record = Record::new(&records.join("small"));
    let content = documents::of_record(&record, Form::Markdown).unwrap();
    assert_eq!(documents::stale(&document, &records).unwrap(), ["small"]);
    assert!(documents::splice(&document, "small", &content).unwrap());
    assert!(!documents::splice(&document, "small", &content).unwrap(), "the second time changes nothing");
    assert_eq!(documents::stale(&document, &records).unwrap(), Vec::<String>::new());
    let spliced = fs::read_to_string(&document).unwrap();
    assert!(
        spliced.starts_with("# Title\n<!-- experiment small -->\n") && spliced.ends_with("\nend\n"),
        "{spliced}"
    );
    assert!(
        spliced.contains("| sierra | 2 |") && spliced.contains("`one`") && !spliced.contains("former"),
        "{spliced}"
    );
    // Another number in the record, or in the document.
    let scores = fs::read_to_string(records.join("small/scores.csv")).unwrap();
    let altered: Vec<String> = scores.lines().map(|l| l.replace(",0.9", ",0.8")).collect();
    fs::write(records.join("small/scores.csv"), altered.join("\n")).unwrap();
    assert_eq!(documents::stale(&document, &records).unwrap(), ["small"]);
    assert!(
        documents::splice(&document, "large", "x")
            .unwrap_err()
            .to_string()
            .contains("<!-- experiment large -->")
    );
    fs::write(&document, "<!-- experiment small -->\n").unwrap();
    assert!(documents::markers(&document).unwrap_err().to_string().contains("without an end"));
}
