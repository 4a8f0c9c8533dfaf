//! The program as a user meets it: help, examples, what it prints and how it ends. Helpers for the other files.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a test fails by panicking, and says what it skips"
)]

mod detail;
mod cases;
mod experiments;
mod input;
mod outputs;
mod sketches;
mod training;
mod tree;

use assert_cmd::Command;
use std::path::Path;

/// What a run printed and how it ended.
struct Answer {
    code: i32,
    out: String,
    err: String,
}

impl Answer {
    /// The report, and what was noted and warned of on the way.
    fn all(&self) -> String {
        format!("{}{}", self.out, self.err)
    }
}

fn run(folder: &Path, args: &[&str]) -> Answer {
    let output = Command::cargo_bin("monadnock").unwrap().current_dir(folder).args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Answer { code: output.status.code().unwrap_or(-1), out: text(output.stdout), err: text(output.stderr) }
}

/// Runs and expects success.
fn done(folder: &Path, args: &[&str]) -> Answer {
    let answer = run(folder, args);
    assert_eq!(answer.code, 0, "{args:?}: {}", answer.err);
    answer
}

/// Runs and expects a failure with exit code `code` whose message holds all of `words`.
fn fails(folder: &Path, args: &[&str], code: i32, words: &[&str]) {
    let answer = run(folder, args);
    assert_eq!(answer.code, code, "{args:?}: {}{}", answer.out, answer.err);
    assert!(answer.out.is_empty(), "{args:?} reported {}", answer.out);
    // Before it, what was assumed of the terrain.
    let mut lines =
        answer.err.lines().skip_while(|line| line.starts_with("note: ") || line.starts_with("warning: "));
    assert!(lines.next().is_some_and(|line| line.starts_with("error: ")), "{args:?}: {}", answer.err);
    assert!(!answer.err.contains("panicked"), "{args:?}: {}", answer.err);
    for word in words {
        assert!(answer.err.contains(word), "{args:?}: {word:?} is missing in: {}", answer.err);
    }
}

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// A level-by-level hill without a place on the Earth, as an ESRI ASCII grid of `side` x `side` cells.
fn write_hill(path: &Path, side: usize) {
    let mut text = format!("ncols {side}\nnrows {side}\nxllcorner 0\nyllcorner 0\ncellsize 25\n");
    for row in 0..side {
        for col in 0..side {
            let (x, y) = (col as f64 / 9.0, row as f64 / 11.0);
            text +=
                &format!("{:.2} ", 500.0 + 80.0 * x.sin() * y.cos() + 40.0 * (x * 0.7 - y).sin() + 3.0 * y);
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

fn png_size(path: &Path) -> (u32, u32) {
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    (number(16), number(20))
}

fn pixels(path: &Path) -> Vec<u8> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

#[test]
fn every_verb_has_help_and_exit_codes_are_listed() {
    let folder = temporary();
    let help = done(folder.path(), &["--help"]).out;
    for word in
        ["Exit codes:", "0  done", "1  failed", "2  the command line", "--threads", "--seed", "--quiet"]
    {
        assert!(help.contains(word), "{word:?} is missing in: {help}");
    }
    let verbs = verbs_of(&help);
    assert!(verbs.len() >= 4, "{verbs:?}");
    for verb in verbs {
        let long = done(folder.path(), &[&verb, "--help"]).out;
        assert_eq!(long, done(folder.path(), &["help", &verb]).out);
        assert!(long.contains("Examples:"), "{verb}: {long}");
        assert!(long.contains(&format!("  monadnock {verb} ")), "{verb}: {long}");
        assert!(long.contains("--threads") && long.contains("--seed") && long.contains("--quiet"), "{verb}");
        let about = long.lines().next().unwrap();
        assert!(help.contains(about), "{verb}: its help begins with another sentence: {about}");
    }
    assert!(done(folder.path(), &["--version"]).out.starts_with("monadnock "));
}

/// A level of vector instructions that is none, or that the processor does not have, is refused, and those that it has are named.
#[test]
fn a_wrong_vector_level_is_named_with_those_allowed() {
    let folder = temporary();
    let with = |level: &str| {
        let mut command = Command::cargo_bin("monadnock").unwrap();
        let output = command
            .current_dir(folder.path())
            .env("MONADNOCK_VECTOR", level)
            .args(["info", "sierra"])
            .output();
        let output = output.unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    for level in ["wide", ""] {
        let (code, message) = with(level);
        assert_eq!(code, 1, "{message}");
        let start = format!("error: MONADNOCK_VECTOR is {level:?}; allowed on this processor: scalar");
        assert!(message.starts_with(&start), "{message}");
    }
    assert_eq!(with("scalar"), (0, String::new()));
    assert!(done(folder.path(), &["--help"]).out.contains("MONADNOCK_VECTOR"));
}

/// The verbs that the help lists.
fn verbs_of(help: &str) -> Vec<String> {
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let verbs = listed.take_while(|line| !line.is_empty()).filter_map(|line| {
        let is_verb = line.starts_with("  ") && !line.starts_with("   ");
        is_verb.then(|| line.split_whitespace().next().unwrap().to_owned())
    });
    verbs.filter(|verb| verb != "help").collect()
}

/// Only lines that can be run as they stand in a folder without any files.
#[test]
fn examples_of_the_help_run_as_written() {
    let folder = temporary();
    let mut count = 0;
    let help = done(folder.path(), &["--help"]).out;
    let texts = ["extract", "render", "info"].map(|verb| done(folder.path(), &["help", verb]).out);
    for text in std::iter::once(&help).chain(&texts) {
        for line in text.lines().filter_map(|line| line.strip_prefix("  monadnock ")) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let runs = words.iter().any(|w| ["sierra", "grand-canyon"].contains(w))
                && ["extract", "render", "info"].contains(&words[0]);
            if runs {
                done(folder.path(), &words);
                count += 1;
            }
        }
    }
    assert!(count >= 6, "only {count} examples were run");
}

#[test]
fn quiet_runs_print_nothing_but_what_was_asked_for() {
    let folder = temporary();
    for args in [
        &["--quiet", "extract", "sierra", "--crop", "0,0,128", "-o", "s.geojson"][..],
        &["render", "sierra", "--crop", "0,0,128", "-o", "s.png", "--sketch", "s.geojson", "-q"],
    ] {
        let answer = done(folder.path(), args);
        assert_eq!((answer.out.as_str(), answer.err.as_str()), ("", ""), "{args:?}");
    }
    assert!(done(folder.path(), &["info", "sierra", "--quiet"]).out.contains("512"));
    fails(folder.path(), &["info", "gone.tif", "--quiet"], 1, &["gone.tif"]);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let folder = temporary();
    let make = |threads: &str| {
        let sketch = format!("{threads}.geojson");
        let picture = format!("{threads}.png");
        let extract = ["extract", "sierra", "-o", &sketch, "--threads", threads, "--seed", "7"];
        let report = done(folder.path(), &extract).out.replace(&sketch, "");
        done(folder.path(), &["render", "sierra", "-o", &picture, "--sketch", &sketch, "--threads", threads]);
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        (report, read(&sketch), read(&picture))
    };
    let [one, two, all] = ["1", "2", "0"].map(make);
    assert!(one == two, "one thread and two");
    assert!(one == all, "one thread and all");
}

#[test]
fn completions_know_every_verb() {
    let folder = temporary();
    let verbs = verbs_of(&done(folder.path(), &["--help"]).out);
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = done(folder.path(), &["completions", shell]).out;
        assert!(verbs.iter().all(|verb| script.contains(verb)), "{shell}");
    }
}

/// `monadnock info sierra | head -0`: nobody reads, and nobody is hurt.
#[cfg(unix)]
#[test]
fn a_reader_that_stops_listening_is_no_failure() {
    use std::process::{Command, Stdio};
    let folder = temporary();
    for args in [&["info", "sierra"][..], &["completions", "bash"], &["--help"]] {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("monadnock"));
        command.args(args).current_dir(&folder).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &[][..]), "{args:?}");
    }
}

/// A report that cannot be written is a failure, but the work is done.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_under_the_report_is_told() {
    use std::process::Command;
    let folder = temporary();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("monadnock"));
    command.args(["extract", "sierra", "--crop", "0,0,96", "-o", "s.geojson"]);
    let output = command.current_dir(&folder).stdout(full).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("standard output"), "{message}");
    assert!(folder.path().join("s.geojson").exists());
}

/// What the help of a verb lists under a heading.
fn under_heading(help: &str, heading: &str) -> String {
    let inside = help.lines().skip_while(|line| *line != heading).skip(1);
    inside.take_while(|line| line.is_empty() || line.starts_with(' ')).collect::<Vec<_>>().join("\n")
}

#[test]
fn options_stand_under_their_heading() {
    let folder = temporary();
    for verb in ["extract", "train", "eval", "render", "info"] {
        let help = done(folder.path(), &[verb, "--help"]).out;
        let reading = under_heading(&help, "Reading terrain:");
        for option in ["--elevation", "--cell-size", "--nodata", "--band", "--metres-per-unit"] {
            assert!(reading.contains(option), "{verb}: {option} is missing in: {reading}");
        }
        for option in ["--output", "--crop", "--patches", "--sketch", "--json", "--config"] {
            assert!(!reading.contains(option), "{verb}: {option} is no matter of reading terrain: {reading}");
        }
        let own = under_heading(&help, "Options:");
        let options = help.lines().filter_map(|line| line.split_whitespace().next());
        assert!(own.matches("  --").count() >= 1, "{verb}: {own}");
        assert_eq!(options.filter(|word| *word == "Options:").count(), 1, "{verb}: {help}");
    }
    let render = done(folder.path(), &["render", "--help"]).out;
    assert!(render.contains("stretched over the terrain"), "{render}");
    assert!(!render.contains("as `generate` does"), "{render}");
}
