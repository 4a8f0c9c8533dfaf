//! What is written, and what is refused before any work: every option of every verb that writes.

use super::{done, fails, run, temporary, write_hill};
use std::path::Path;

/// Everything that writes: the command without the option, the option, a wrong ending, and a good name. `STYLE` is a file
/// that is no style: whoever read it before looking at the outputs would complain about it.
const WRITERS: [(&[&str], &str, &str, &str); 14] = [
    (&["extract", "hill.asc"], "--output", "x.shp", "x.geojson"),
    (&["train", "hill.asc"], "--output", "x.pt", "x.safetensors"),
    (&["generate", "STYLE", "--sketch", "lambda-ring"], "--output", "x.jpg", "x.tif"),
    (&["generate", "STYLE", "--sketch", "lambda-ring", "-o", "y.tif"], "--check-json", "x.txt", "x.json"),
    (&["generate", "STYLE", "--sketch", "lambda-ring", "-o", "y.tif"], "--sources", "x.jpg", "x.npz"),
    (&["amplify", "STYLE", "hill.asc", "--factor", "2"], "--output", "x.obj", "x.tif"),
    (&["sample", "STYLE", "--size", "64"], "--output", "x.bmp", "x.png"),
    (&["render", "hill.asc"], "--output", "x.jpg", "x.png"),
    (&["eval", "STYLE", "hill.asc"], "--csv", "x.xlsx", "x.csv"),
    (&["eval", "STYLE", "hill.asc"], "--json", "x.txt", "x.json"),
    (&["eval", "STYLE", "hill.asc"], "--save", "hill.asc", "saved"),
    (&["demo"], "--out", "hill.asc", "shown"),
    (&["experiment", "run", "experiment.toml"], "--out", "hill.asc", "record"),
    (&["data", "add", "hill.asc"], "--manifest", "x.yaml", "x.toml"),
];

fn prepare(at: &Path) {
    write_hill(&at.join("hill.asc"), 40);
    std::fs::write(at.join("STYLE"), "no style").unwrap();
    let experiment = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/quick/neighbours.toml");
    std::fs::copy(experiment, at.join("experiment.toml")).unwrap();
}

fn names(at: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn false_names_are_refused_before_the_work() {
    let folder = temporary();
    let at = folder.path();
    prepare(at);
    let before = names(at);
    for (command, option, wrong, good) in WRITERS {
        fn with<'a>(command: &[&'a str], option: &'a str, value: &'a str) -> Vec<&'a str> {
            [command, &[option, value]].concat()
        }
        let ending = if wrong == "hill.asc" { "a file" } else { "file extension" };
        fails(at, &with(command, option, wrong), 1, &[wrong, ending, "allowed"]);
        if !["saved", "shown", "record"].contains(&good) {
            fails(
                at,
                &with(command, option, &format!("none/{good}")),
                1,
                &[good, "folder", "none", "not there"],
            );
            fails(at, &with(command, option, "hill.asc/x"), 1, &["hill.asc"]);
            std::fs::create_dir(at.join(good)).unwrap();
            fails(at, &with(command, option, good), 1, &[good, "a folder"]);
            std::fs::remove_dir(at.join(good)).unwrap();
        }
        if cfg!(target_os = "linux") {
            // Not even the superuser creates files there.
            let nowhere = format!("/proc/{good}");
            fails(at, &with(command, option, &nowhere), 1, &[&nowhere, option, "cannot be written"]);
        }
    }
    assert_eq!(names(at), before, "a refused run leaves nothing behind");
}

/// A verb or option that is missing in the table above would be checked by nobody.
#[test]
fn the_table_knows_every_option_that_writes() {
    let folder = temporary();
    for (verb, options) in [
        ("extract", &["--output"][..]),
        ("train", &["--output"]),
        ("generate", &["--output", "--sources", "--check-json"]),
        ("amplify", &["--output"]),
        ("sample", &["--output"]),
        ("render", &["--output"]),
        ("eval", &["--csv", "--json", "--save"]),
        ("demo", &["--out"]),
    ] {
        let help = done(folder.path(), &[verb, "-h"]).out;
        let writes: Vec<&str> = help
            .lines()
            .filter(|line| ["to write", " Write ", "folder to"].iter().any(|word| line.contains(word)))
            .filter_map(|line| line.split_whitespace().find(|word| word.starts_with("--")))
            .collect();
        assert_eq!(writes, options, "{verb}: {help}");
        for option in options {
            assert!(
                WRITERS.iter().any(|(command, known, ..)| command[0] == verb && known == option),
                "{verb} {option}"
            );
        }
    }
}

#[test]
fn two_outputs_to_one_path_are_refused() {
    let folder = temporary();
    let at = folder.path();
    prepare(at);
    std::fs::create_dir(at.join("a")).unwrap();
    for (one, two) in [("x.json", "./x.json"), ("a/x.json", "a/../a/x.json")] {
        // The table is written as JSON's name asks, so that only the path is wrong.
        let args = ["eval", "STYLE", "hill.asc", "--save", one, "--json", two];
        fails(at, &args, 1, &["--json", "--save", "x.json", "a path of its own"]);
    }
    fails(
        at,
        &["experiment", "run", "experiment.toml", "--out", "r", "--styles", "./r"],
        1,
        &["--styles", "--out", "a path of its own"],
    );
}

#[test]
fn endings_count_in_any_case() {
    let folder = temporary();
    let at = folder.path();
    prepare(at);
    done(at, &["render", "hill.asc", "-o", "X.PNG"]);
    done(at, &["extract", "hill.asc", "-o", "X.GeoJSON"]);
    done(at, &["extract", "hill.asc", "-o", "x.json"]);
    if cfg!(unix) {
        done(at, &["render", "hill.asc", "-o", "/dev/null"]);
        let answer = run(at, &["extract", "hill.asc", "-o", "/dev/stdout", "-q"]);
        assert!(answer.code == 0 && answer.out.contains("FeatureCollection"), "{}{}", answer.out, answer.err);
    }
}
