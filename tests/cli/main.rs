//! The program as a user meets it: help, round trips on bundled terrain, messages for bad input.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod detail;

use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What a run printed and how it ended.
struct Answer {
    code: i32,
    out: String,
    err: String,
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
    assert!(answer.err.starts_with("error: "), "{args:?}: {}", answer.err);
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
fn every_verb_has_help_with_examples_and_the_program_documents_its_exit_codes() {
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
fn the_examples_with_bundled_terrain_run_as_they_are_written() {
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
fn a_sketch_of_bundled_terrain_goes_round() {
    let folder = temporary();
    let crop = ["--crop", "100,140,192x160"];
    let extract = |more: &[&str], out: &str| {
        let args = [&["extract", "sierra", "-o", out], &crop[..], more].concat();
        done(folder.path(), &args).out
    };
    let report = extract(&[], "a.geojson");
    let info = done(folder.path(), &["info", "a.geojson"]).out;
    // What `extract` reports about the lines is what `info` finds in the file.
    for label in ["ridges", "valleys", "line cells"] {
        let line = report.lines().find(|l| l.starts_with(label)).unwrap();
        assert!(info.lines().any(|l| l == line), "{line:?} is not in: {info}");
    }
    assert!(report.contains("parts") && report.contains("Strahler") && report.contains("wrote a.geojson"));

    let json: Value =
        serde_json::from_str(&done(folder.path(), &["info", "a.geojson", "--json"]).out).unwrap();
    assert_eq!((&json["kind"], &json["rows"], &json["cols"]), (&"sketch".into(), &192.into(), &160.into()));
    assert_eq!((&json["unit"], &json["warnings"]), (&"metres".into(), &Value::Array(vec![])));
    let cells = json["line_cells"].as_u64().unwrap();
    assert!((1500..9000).contains(&cells), "{cells} line cells of {}", 192 * 160);
    let of_kind = |kind: &str| json[kind]["line_cells"].as_u64().unwrap();
    assert_eq!(of_kind("ridges") + of_kind("valleys"), cells);
    assert!(json["valleys"]["streams_by_order"].as_array().unwrap().len() >= 2);
    let terrain: Value =
        serde_json::from_str(&done(folder.path(), &["info", "sierra", "--json"]).out).unwrap();
    assert_eq!((&terrain["kind"], &terrain["rows"]), (&"terrain".into(), &512.into()));
    assert_eq!(json["georeference"]["epsg"], terrain["georeference"]["epsg"]);

    // Stricter limits leave fewer lines; lines found with the terrain around them are others.
    extract(&["--min-order", "3", "--accumulation", "40"], "b.geojson");
    let fewer: Value =
        serde_json::from_str(&done(folder.path(), &["info", "b.geojson", "--json"]).out).unwrap();
    assert!(fewer["line_cells"].as_u64().unwrap() * 2 < cells);
    extract(&["--with-context"], "c.geojson");
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_ne!(read("a.geojson"), read("c.geojson"));
    extract(&["--paper"], "d.geojson");
    assert_ne!(read("a.geojson"), read("d.geojson"));

    done(folder.path(), &[&["render", "sierra", "-o", "a.png", "--scale", "2"], &crop[..]].concat());
    let drawn = [&["render", "sierra", "-o", "b.png", "--scale", "2", "--sketch", "a.geojson"], &crop[..]];
    done(folder.path(), &drawn.concat());
    let [plain, overlay] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    assert_eq!((png_size(&plain), png_size(&overlay)), ((320, 384), (320, 384)));
    let (plain, overlay) = (pixels(&plain), pixels(&overlay));
    let changed = plain.chunks(3).zip(overlay.chunks(3)).filter(|(a, b)| a != b).count() as u64;
    assert!((cells..12 * cells).contains(&changed), "{changed} pixels for {cells} line cells");
}

#[test]
fn a_configuration_file_works_with_and_without_a_section_and_options_overrule_it() {
    let folder = temporary();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("plain.toml", "min_order = 3\nmin_accumulation = 30\n");
    write("section.toml", "[extraction]\nmin_order = 3\nmin_accumulation = 30\n[model]\nepochs = 5\n");
    let extract = |more: &[&str]| {
        done(folder.path(), &[&["extract", "sierra", "--crop", "0,0,128", "-o", "s.geojson"], more].concat());
        std::fs::read_to_string(folder.path().join("s.geojson")).unwrap()
    };
    let by_options = extract(&["--min-order", "3", "--accumulation", "30"]);
    assert_eq!(extract(&["--config", "plain.toml"]), by_options);
    assert_eq!(extract(&["--config", "section.toml"]), by_options);
    assert_ne!(extract(&["--config", "plain.toml", "--min-order", "2"]), by_options);

    write("typo.toml", "min_ordr = 3\n");
    let extract = ["extract", "sierra", "-o", "x.geojson", "--config"];
    fails(folder.path(), &[&extract[..], &["typo.toml"]].concat(), 1, &["typo.toml", "min_ordr"]);
    write("range.toml", "min_order = 99\n");
    fails(folder.path(), &[&extract[..], &["range.toml"]].concat(), 1, &["range.toml", "99", "1 to 30"]);
    fails(folder.path(), &[&extract[..], &["gone.toml"]].concat(), 1, &["gone.toml"]);
}

#[test]
fn sketches_lie_where_they_were_drawn() {
    let folder = temporary();
    write_hill(&folder.path().join("hill.asc"), 96);
    // One valley from cell to cell on the map of the whole terrain, in columns and rows.
    let sketch = |rows: usize, points: &str| {
        let text = format!(
            r#"{{"type":"FeatureCollection","monadnock":{{"rows":{rows},"cols":{rows},"unit":"normalised"}},"features":[
            {{"type":"Feature","properties":{{"kind":"valley"}},"geometry":{{"type":"LineString","coordinates":{points}}}}}]}}"#
        );
        std::fs::write(folder.path().join("s.geojson"), text).unwrap();
    };
    // Rows and columns between which the overlay changes the picture.
    let reach = |crop: &[&str]| {
        done(folder.path(), &[&["render", "hill.asc", "-o", "a.png"], crop].concat());
        done(
            folder.path(),
            &[&["render", "hill.asc", "-o", "b.png", "--sketch", "s.geojson"], crop].concat(),
        );
        let [a, b] = ["a.png", "b.png"].map(|name| pixels(&folder.path().join(name)));
        let width = png_size(&folder.path().join("a.png")).0 as usize;
        let changed: Vec<usize> =
            (0..a.len() / 3).filter(|i| a[3 * i..3 * i + 3] != b[3 * i..3 * i + 3]).collect();
        let rows: Vec<usize> = changed.iter().map(|i| i / width).collect();
        let cols: Vec<usize> = changed.iter().map(|i| i % width).collect();
        (
            *rows.iter().min().unwrap(),
            *rows.iter().max().unwrap(),
            *cols.iter().min().unwrap(),
            *cols.iter().max().unwrap(),
        )
    };
    let near = |found: (usize, usize, usize, usize), wanted: (usize, usize, usize, usize)| {
        let apart = [(found.0, wanted.0), (found.1, wanted.1), (found.2, wanted.2), (found.3, wanted.3)];
        assert!(apart.iter().all(|(a, b)| a.abs_diff(*b) <= 1), "{found:?}, not {wanted:?}");
    };
    sketch(96, "[[50,40,0.5],[70,40,0.6]]");
    near(reach(&[]), (40, 40, 50, 70));
    // Of the whole terrain, seen in a window; then drawn on the window itself; then on a map half as large.
    near(reach(&["--crop", "30,44,32"]), (10, 10, 6, 26));
    sketch(32, "[[5,10,0.5],[25,10,0.6]]");
    near(reach(&["--crop", "30,44,32"]), (10, 10, 5, 25));
    sketch(48, "[[20,10,0.5],[30,10,0.6]]");
    near(reach(&[]), (20, 21, 40, 61));
}

#[test]
fn palettes_and_grey_differ() {
    let folder = temporary();
    let draw = |more: &[&str]| {
        done(folder.path(), &[&["render", "grand-canyon", "--crop", "0,0,64", "-o", "p.png"], more].concat());
        pixels(&folder.path().join("p.png"))
    };
    assert_ne!(draw(&["--palette", "arid"]), draw(&[]));
    assert_eq!(draw(&["--palette", "alpine"]), draw(&[]));
    let grey = draw(&["--grey"]);
    assert_eq!(grey, draw(&["--no-colour"]));
    let spread = grey.chunks(3).map(|p| p.iter().max().unwrap() - p.iter().min().unwrap()).max().unwrap();
    assert!(spread < 40, "a grey picture has next to no hue: {spread}");
    fails(
        folder.path(),
        &["render", "sierra", "-o", "p.png", "--palette", "pink"],
        2,
        &["pink", "alpine", "lunar"],
    );
}

#[test]
fn info_describes_terrain_and_says_what_it_assumes() {
    let folder = temporary();
    let text = done(folder.path(), &["info", "grand-canyon"]).out;
    for word in ["GeoTIFF", "512 rows x 512 columns", "cell size", "elevation", "voids", "none", "credit"] {
        assert!(text.contains(word), "{word:?} is missing in: {text}");
    }
    write_hill(&folder.path().join("hill.asc"), 20);
    let json = |args: &[&str]| -> Value {
        serde_json::from_str(&done(folder.path(), &[&["info", "hill.asc", "--json"], args].concat()).out)
            .unwrap()
    };
    let hill = json(&[]);
    assert_eq!((&hill["format"], &hill["voids"]), (&"ascii-grid".into(), &0.into()));
    assert_eq!((&hill["cell_size"]["x"], &hill["cell_size"]["source"]), (&25.0.into(), &"file".into()));
    let told = json(&["--cell-size", "10,12.5"]);
    assert_eq!((&told["cell_size"]["y"], &told["cell_size"]["source"]), (&12.5.into(), &"caller".into()));
    let mean = hill["elevation"]["mean"].as_f64().unwrap();
    assert!(
        hill["elevation"]["lowest"].as_f64().unwrap() < mean
            && mean < hill["elevation"]["highest"].as_f64().unwrap()
    );
}

#[test]
fn bad_input_is_named() {
    let folder = temporary();
    let at = folder.path();
    std::fs::write(at.join("torn.tif"), b"II*\0\x08\0\0\0").unwrap();
    std::fs::write(at.join("bad.geojson"), r#"{"type":"FeatureCollection","features":[{"type":"Feature",
        "properties":{"kind":"motorway"},"geometry":{"type":"LineString","coordinates":[[1,2,3],[4,5,6]]}}]}"#).unwrap();
    std::fs::write(at.join("no.safetensors"), b"nothing").unwrap();
    std::fs::write(
        at.join("level.asc"),
        format!("ncols 30\nnrows 30\nxllcorner 0\nyllcorner 0\ncellsize 1\n{}", "7 ".repeat(900)),
    )
    .unwrap();
    write_hill(&at.join("hill.asc"), 40);

    // Failures: exit code 1.
    fails(at, &["info", "gone.tif"], 1, &["gone.tif", "not there"]);
    fails(at, &["info", "atlantis"], 1, &["atlantis", "sierra, grand-canyon"]);
    fails(at, &["info", "torn.tif"], 1, &["torn.tif"]);
    fails(at, &["info", "bad.geojson"], 1, &["bad.geojson", "motorway", "ridge"]);
    fails(at, &["info", "no.safetensors"], 1, &["no.safetensors"]);
    fails(at, &["info", "hill.asc", "--band", "2"], 1, &["hill.asc", "2"]);
    fails(
        at,
        &["render", "sierra", "--crop", "500,0,64", "-o", "x.png"],
        1,
        &["--crop", "64x64 at row 500", "512x512"],
    );
    fails(at, &["render", "sierra", "--scale", "65", "-o", "x.png"], 1, &["65", "1 to 64"]);
    fails(at, &["render", "hill.asc", "-o", "no/x.png"], 1, &["no/x.png", "folder"]);
    fails(at, &["render", "hill.asc", "-o", "x.png", "--sketch", "gone.geojson"], 1, &["gone.geojson"]);
    fails(
        at,
        &["extract", "hill.asc", "-o", "x.geojson", "--min-order", "0"],
        1,
        &["min_order", "0", "1 to 30"],
    );
    fails(at, &["extract", "level.asc", "-o", "x.geojson"], 1, &["level.asc", "ridges and valleys is 0"]);

    // Command lines that cannot be understood: exit code 2.
    fails(at, &["extract", "sierra", "-o", "x", "--crop", "1,2"], 2, &["--crop", "1,2", "ROWSxCOLS"]);
    fails(at, &["info", "sierra", "--elevation", "900,-3"], 2, &["--elevation", "900,-3", "MIN,MAX"]);
    fails(at, &["info", "sierra", "--cell-size", "-30"], 2, &["--cell-size", "-30"]);
    fails(at, &["info", "sierra", "--threads", "many"], 2, &["--threads", "many"]);
    fails(at, &["info", "sierra", "--threads", "100000"], 2, &["--threads", "100000", "1024"]);
    fails(at, &["info", "sierra", "--seed", "-1"], 2, &["-1"]);
    fails(at, &["extract", "sierra"], 2, &["--output"]);
    fails(at, &["extract", "sierra", "-o", "x", "--with-context"], 2, &["--crop"]);
    fails(at, &["dig", "sierra"], 2, &["dig"]);
    fails(at, &["completions", "abacus"], 2, &["abacus", "bash"]);

    let left = std::fs::read_dir(at).unwrap().map(|entry| entry.unwrap().path());
    let new: Vec<PathBuf> = left.filter(|p| p.file_stem().is_some_and(|s| s == "x")).collect();
    assert!(new.is_empty(), "a failed run leaves no file: {new:?}");
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

#[test]
fn a_style_is_trained_used_and_scored() {
    let folder = temporary();
    let at = folder.path();
    let train = ["train", "sierra", "-o", "s.safetensors", "--crop", "128,0,128", "--epochs", "3"];
    let settings = ["--set", "model.extractions=2", "--set", "model.splits=1", "--no-detail"];
    done(at, &[&train[..], &settings[..]].concat());
    let info: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    assert_eq!(info["training"]["epochs"], 3);
    assert!(info["training"]["ssim"].as_f64().unwrap() > 0.5);
    assert_eq!(info["exemplar"]["row"], 128);

    done(
        at,
        &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", "a.tif", "--elevation", "100,900"],
    );
    done(
        at,
        &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", "b.tif", "--elevation", "100,900"],
    );
    assert_eq!(std::fs::read(at.join("a.tif")).unwrap(), std::fs::read(at.join("b.tif")).unwrap());
    done(
        at,
        &["generate", "s.safetensors", "--sketch", "single-stroke", "-o", "c.tif", "--random-sketches", "12"],
    );

    let eval = ["eval", "s.safetensors", "sierra", "--systems", "gnn,laplace"];
    let files = ["--patches", "0,0;128,0;256,256", "--csv", "s.csv", "--json", "s.json", "--save", "rebuilt"];
    let answer = done(at, &[&eval[..], &files[..]].concat());
    assert!(answer.out.contains("1 patch overlaps the exemplar"), "{}", answer.out);
    let rows = std::fs::read_to_string(at.join("s.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 2 * 2, "{rows}");
    let json: Value = serde_json::from_slice(&std::fs::read(at.join("s.json")).unwrap()).unwrap();
    assert_eq!(json["systems"].as_array().unwrap().len(), 2);
    for file in ["truth.tif", "sketch.geojson", "gnn.tif", "laplace.tif"] {
        assert!(at.join("rebuilt/0_0").join(file).exists(), "{file}");
    }

    fails(at, &["train", "sierra", "-o", "x.safetensors", "--crop", "0,0,16"], 1, &["16x16", "32"]);
    fails(at, &["train", "sierra", "-o", "x.safetensors", "--set", "model.width=33"], 1, &["width", "33"]);
    fails(at, &["train", "sierra", "-o", "x.safetensors", "--set", "model.widht=32"], 1, &["widht"]);
    fails(at, &["eval", "s.safetensors", "sierra", "--systems", "magic"], 1, &["magic", "natural-neighbour"]);
    fails(at, &["eval", "s.safetensors", "sierra", "--patches", "500,0"], 1, &["500", "512"]);
    fails(
        at,
        &["generate", "s.safetensors", "--sketch", "none.geojson", "-o", "d.tif"],
        1,
        &["none.geojson"],
    );
    fails(at, &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", "d.xyz"], 1, &["d.xyz"]);
    std::fs::write(at.join("torn.safetensors"), b"torn").unwrap();
    fails(
        at,
        &["generate", "torn.safetensors", "--sketch", "lambda-ring", "-o", "d.tif"],
        1,
        &["torn.safetensors"],
    );
}

/// What the help of a verb lists under a heading.
fn under_heading(help: &str, heading: &str) -> String {
    let inside = help.lines().skip_while(|line| *line != heading).skip(1);
    inside.take_while(|line| line.is_empty() || line.starts_with(' ')).collect::<Vec<_>>().join("\n")
}

#[test]
fn options_stand_under_the_heading_that_they_belong_to() {
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

#[test]
fn options_for_another_format_are_refused_by_name() {
    let folder = temporary();
    let at = folder.path();
    write_hill(&at.join("hill.asc"), 40);
    for file in ["hill.asc", "sierra"] {
        let with_range = ["info", file, "--elevation", "300,2100"];
        fails(at, &with_range, 1, &[file, "--elevation", "300,2100", "PNG"]);
    }
    done(at, &["train", "sierra", "-o", "s.safetensors", "--crop", "0,0,64", "--epochs", "1", "-q"]);
    done(
        at,
        &["generate", "s.safetensors", "--sketch", "single-stroke", "-o", "a.png", "--elevation", "300,900"],
    );
    done(at, &["info", "a.png", "--elevation", "0,1000"]);
    fails(at, &["info", "a.png", "--nodata", "0"], 1, &["a.png", "--nodata", "0", "not for PNG"]);
    fails(at, &["info", "a.png", "--nodata", "none"], 1, &["a.png", "--nodata", "none", "not for PNG"]);
    fails(
        at,
        &["info", "a.png", "--metres-per-unit", "0.3048"],
        1,
        &["a.png", "--metres-per-unit", "0.3048", "not for PNG", "--elevation"],
    );
    // They still do what they are for.
    let lowest = |args: &[&str]| {
        let out = done(at, &[&["info", "hill.asc", "--json"], args].concat()).out;
        serde_json::from_str::<Value>(&out).unwrap()["elevation"]["lowest"].as_f64().unwrap()
    };
    assert!((lowest(&["--metres-per-unit", "0.5"]) - lowest(&[]) / 2.0).abs() < 1e-3);
}

#[test]
fn bundled_names_mean_the_same_to_every_verb() {
    let folder = temporary();
    let at = folder.path();
    let sketch: Value = serde_json::from_str(&done(at, &["info", "lambda-ring", "--json"]).out).unwrap();
    assert_eq!((&sketch["kind"], &sketch["rows"]), (&"sketch".into(), &128.into()));
    done(at, &["render", "sierra", "--crop", "0,0,128", "-o", "plain.png"]);
    done(at, &["render", "sierra", "--crop", "0,0,128", "-o", "lines.png", "--sketch", "lambda-ring"]);
    let [plain, lines] = ["plain.png", "lines.png"].map(|name| pixels(&at.join(name)));
    assert_ne!(plain, lines);
    // A file of that name comes first, and unknown names list the known ones.
    std::fs::write(at.join("meander"), b"not a sketch").unwrap();
    fails(at, &["render", "sierra", "--sketch", "meander", "-o", "x.png"], 1, &["meander", "JSON"]);
    fails(at, &["render", "sierra", "--sketch", "omega", "-o", "x.png"], 1, &["omega", "lambda-ring"]);
    fails(at, &["info", "omega"], 1, &["omega", "sierra", "lambda-ring"]);
    let about = done(at, &["info", "--help"]).out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(about.contains("sierra, grand-canyon") && about.contains("lambda-ring"), "{about}");
}

#[test]
fn a_sketch_of_the_whole_map_is_cropped_quietly() {
    let folder = temporary();
    let at = folder.path();
    // Bundled terrain has a place on the Earth, and so has what is extracted from it.
    done(at, &["extract", "sierra", "-o", "whole.geojson"]);
    let draw = |sketch: &str, crop: &str, out: &str| {
        done(at, &["render", "sierra", "--crop", crop, "--sketch", sketch, "-o", out])
    };
    let answer = draw("whole.geojson", "128,200,96", "a.png");
    assert_eq!(answer.err, "");
    assert!(!answer.out.contains("stretched"), "{}", answer.out);
    // The same pixels as when the whole is drawn and the window cut out of it.
    done(at, &["render", "sierra", "--sketch", "whole.geojson", "-o", "whole.png"]);
    done(at, &["render", "sierra", "-o", "bare.png"]);
    done(at, &["render", "sierra", "--crop", "128,200,96", "-o", "bare-window.png"]);
    let [whole, bare, window, bare_window] =
        ["whole.png", "bare.png", "a.png", "bare-window.png"].map(|name| pixels(&at.join(name)));
    let inner = |row: usize, col: usize| (4..92).contains(&row) && (4..92).contains(&col);
    let (mut lines, mut agreeing) = (0, 0);
    for (row, col) in (0..96).flat_map(|r| (0..96).map(move |c| (r, c))).filter(|&(r, c)| inner(r, c)) {
        let (i, j) = (3 * (row * 96 + col), 3 * ((row + 128) * 512 + col + 200));
        let drawn_here = window[i..i + 3] != bare_window[i..i + 3];
        let drawn_there = whole[j..j + 3] != bare[j..j + 3];
        lines += usize::from(drawn_there);
        agreeing += usize::from(drawn_here && drawn_there);
    }
    assert!(lines > 500 && agreeing * 100 > lines * 98, "{agreeing} of {lines}");
    // A sketch of the window alone lies where it was, and one without a line in the window is told.
    done(at, &["extract", "sierra", "--crop", "128,200,96", "-o", "window.geojson"]);
    assert_eq!(draw("window.geojson", "128,200,96", "b.png").err, "");
    let elsewhere = draw("window.geojson", "400,0,64", "c.png");
    assert!(elsewhere.err.contains("no line of the sketch lies in"), "{}", elsewhere.err);
    // As a geographic information system writes it: coordinates of the terrain, nothing said about the map.
    let mut bare: Value = serde_json::from_slice(&std::fs::read(at.join("whole.geojson")).unwrap()).unwrap();
    bare.as_object_mut().unwrap().remove("monadnock");
    std::fs::write(at.join("gis.geojson"), bare.to_string()).unwrap();
    assert!(!draw("gis.geojson", "128,200,96", "e.png").err.contains("off the map"));
    assert!(pixels(&at.join("e.png")) == pixels(&at.join("a.png")), "with and without the member");
    // What is off the whole map is still worth a word.
    let text = std::fs::read_to_string(at.join("whole.geojson")).unwrap();
    std::fs::write(
        at.join("far.geojson"),
        text.replacen("\"coordinates\":[[", "\"coordinates\":[[-9e9,-9e9,0],[", 1),
    )
    .unwrap();
    assert!(draw("far.geojson", "128,200,96", "d.png").err.contains("partly off the map of 512x512"));
}

#[test]
fn a_map_size_scales_the_drawing() {
    let folder = temporary();
    let at = folder.path();
    done(at, &["train", "sierra", "-o", "s.safetensors", "--crop", "0,0,64", "--epochs", "1", "-q"]);
    let generate = |sketch: &str, size: &[&str], out: &str| {
        done(at, &[&["generate", "s.safetensors", "--sketch", sketch, "-o", out], size].concat())
    };
    let described =
        |file: &str| -> Value { serde_json::from_str(&done(at, &["info", file, "--json"]).out).unwrap() };
    let shape = |file: &str| {
        let info = described(file);
        (info["rows"].as_u64().unwrap(), info["cols"].as_u64().unwrap())
    };
    generate("lambda-ring", &[], "own.tif");
    assert_eq!(shape("own.tif"), (128, 128));
    let answer = generate("lambda-ring", &["--size", "96x160"], "bundled.tif");
    assert_eq!(shape("bundled.tif"), (96, 160));
    assert!(answer.out.contains("scaled") && answer.out.contains("128x128"), "{}", answer.out);

    // A file that states its size is scaled, one that does not is drawn on a map of the size.
    let points = "[[10,10,0.2],[40,30,0.8]]";
    let sketch = |member: &str| {
        format!(
            r#"{{"type":"FeatureCollection",{member}"features":[{{"type":"Feature","properties":{{"kind":"ridge"}},
            "geometry":{{"type":"LineString","coordinates":{points}}}}}]}}"#
        )
    };
    let stated = r#""monadnock":{"rows":64,"cols":64,"unit":"normalised"},"#;
    std::fs::write(at.join("stated.geojson"), sketch(stated)).unwrap();
    std::fs::write(at.join("open.geojson"), sketch("")).unwrap();
    generate("stated.geojson", &["--size", "128"], "stated.tif");
    generate("open.geojson", &["--size", "128"], "open.tif");
    assert_eq!((shape("stated.tif"), shape("open.tif")), ((128, 128), (128, 128)));
    // Sketch heights are exact: the end of the ridge tells where the drawing went.
    let height = |file: &str, row: usize, col: usize| -> f32 {
        let dem =
            monadnock::dem::io::read(&at.join(file), &monadnock::dem::io::ReadOptions::default()).unwrap();
        dem.heights()[monadnock::grid::Cell::new(row, col)]
    };
    let style: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    let metre = |name: &str| style["normalization"][name].as_f64().unwrap() as f32;
    let end = metre("low") + 0.8 * (metre("high") - metre("low"));
    let near = |z: f32| (z - end).abs() < 0.02 * (metre("high") - metre("low"));
    let [scaled, placed] =
        ["stated.tif", "open.tif"].map(|file| (height(file, 60, 80), height(file, 30, 40)));
    assert!(near(scaled.0) && !near(scaled.1), "{scaled:?}, not {end} at (60, 80)");
    assert!(near(placed.1) && !near(placed.0), "{placed:?}, not {end} at (30, 40)");

    // A georeferenced sketch keeps its ground: twice the cells, half the cell size.
    done(at, &["extract", "sierra", "--crop", "64,64,64", "-o", "placed.geojson"]);
    generate("placed.geojson", &["--size", "128"], "placed.tif");
    let placed = described("placed.tif");
    assert_eq!((shape("placed.tif"), &placed["cell_size"]["x"]), ((128, 128), &15.0.into()));
    let help = done(at, &["help", "generate"]).out;
    assert!(help.contains("scaled"), "{help}");
}

#[test]
fn info_of_a_style_is_a_summary_and_its_json_is_everything() {
    let folder = temporary();
    let at = folder.path();
    done(
        at,
        &["train", "sierra", "-o", "s.safetensors", "--crop", "0,0,64", "--epochs", "3", "--no-detail", "-q"],
    );
    let text = done(at, &["info", "s.safetensors"]).out;
    for label in [
        "epochs",
        "seconds",
        "seconds per epoch",
        "SSIM",
        "PSNR",
        "l_gt",
        "peak memory",
        "last losses",
        "exemplar",
        "parameters",
    ] {
        assert!(text.contains(label), "{label:?} is missing in: {text}");
    }
    assert!(!text.contains("history"), "{text}");
    assert!(text.lines().count() < 75 && text.lines().all(|line| line.len() < 200), "{text}");
    let json: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    let history = json["training"]["history"].as_array().unwrap();
    assert_eq!(history.len(), 3);
    // The last losses are those of the last epoch.
    let last = history[2]["losses"]["ground_truth"].as_f64().unwrap();
    assert!(text.contains(&format!("{last:.2e}")), "{last:.2e} is missing in: {text}");
}

#[test]
fn what_is_read_is_never_written_over() {
    let folder = temporary();
    let at = folder.path();
    write_hill(&at.join("hill.asc"), 48);
    let before = std::fs::read(at.join("hill.asc")).unwrap();
    for verb in ["extract", "train", "render"] {
        fails(at, &[verb, "hill.asc", "-o", "./hill.asc"], 1, &["./hill.asc", "the same file as hill.asc"]);
    }
    assert_eq!(std::fs::read(at.join("hill.asc")).unwrap(), before);
    let style = ["train", "hill.asc", "-o", "s.safetensors", "--epochs", "1", "--set", "model.extractions=1"];
    done(at, &style);
    for name in ["s.safetensors", "t.xyz", "t.tif.gz"] {
        let words = if name == "s.safetensors" { "the same file as" } else { "file extension" };
        fails(at, &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", name], 1, &[name, words]);
    }
}

/// Hills on cells of `dx` by `dy` metres, the same ground whatever the cells.
fn write_ground(path: &Path, dx: f64, dy: f64) {
    let (rows, cols) = ((2400.0 / dy) as usize, (2400.0 / dx) as usize);
    let mut text = format!("ncols {cols}\nnrows {rows}\nxllcorner 0\nyllcorner 0\ndx {dx}\ndy {dy}\n");
    for row in 0..rows {
        for col in 0..cols {
            let (x, y) = ((col as f64 + 0.5) * dx / 260.0, (row as f64 + 0.5) * dy / 310.0);
            text += &format!("{:.2} ", 500.0 + 80.0 * x.sin() * y.cos() + 40.0 * (x * 0.7 - y).sin());
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn terrain_on_cells_that_are_not_square_is_resampled_and_said_so() {
    let folder = temporary();
    let at = folder.path();
    write_ground(&at.join("wide.asc"), 50.0, 25.0);
    write_ground(&at.join("square.asc"), 25.0, 25.0);
    let said = done(at, &["extract", "wide.asc", "-o", "wide.geojson"]).out;
    assert!(said.contains("50.00 m west-east and 25.00 m north-south"), "{said}");
    assert!(said.contains("68x68 square cells of 35.29 m"), "{said}");
    let kept = done(at, &["extract", "wide.asc", "-o", "kept.geojson", "--keep-cells"]);
    assert!(kept.err.contains("as if they were square") && !kept.out.contains("resampled"), "{}", kept.err);
    let square = done(at, &["extract", "square.asc", "-o", "square.geojson"]);
    assert!(!(square.out + &square.err).contains("square cells"), "nothing to say");

    // The lines lie where those of the same ground on square cells lie, within two cells.
    let vertices = |name: &str| -> Vec<(f64, f64)> {
        let json: Value = serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap();
        let points = json["features"].as_array().unwrap().iter();
        let points = points.flat_map(|f| f["geometry"]["coordinates"].as_array().unwrap());
        points.map(|v| (v[0].as_f64().unwrap(), v[1].as_f64().unwrap())).collect()
    };
    let (wide, truth) = (vertices("wide.geojson"), vertices("square.geojson"));
    let near = |p: &&(f64, f64)| truth.iter().any(|t| (t.0 - p.0).hypot(t.1 - p.1) < 72.0);
    let share = wide.iter().filter(near).count() as f64 / wide.len() as f64;
    assert!(wide.len() > 20 && share > 0.9, "{share} of {}", wide.len());

    let train = ["train", "wide.asc", "-o", "s.safetensors", "--epochs", "2", "--set", "model.extractions=1"];
    assert!(done(at, &train).out.contains("resampled"));
    let style: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    assert_eq!((&style["exemplar"]["rows"], &style["exemplar"]["cols"]), (&68.into(), &68.into()));
    assert!(done(at, &["info", "wide.asc"]).out.contains("cells are not square"));
}

#[test]
fn a_training_that_diverges_fails_and_keeps_its_last_good_state() {
    let folder = temporary();
    let at = folder.path();
    let common = ["train", "sierra", "-o", "s.safetensors", "--crop", "192,192,64", "--preset", "paper"];
    let settings = ["--set", "model.normalize=false", "--epochs", "200", "--checkpoint-every", "0s"];
    let train = |more: &[&'static str]| run(at, &[&common[..], &settings[..], more].concat());
    let wild = train(&["--set", "model.learning_rate=1"]);
    assert_eq!(wild.code, 1, "{}{}", wild.out, wild.err);
    for words in
        ["error: training diverged at epoch", "lower learning rate", "s.safetensors.checkpoint", "--resume"]
    {
        assert!(wild.err.contains(words), "{words:?} is missing in: {}", wild.err);
    }
    assert!(!at.join("s.safetensors").exists() && at.join("s.safetensors.checkpoint").exists());

    // What was kept is good: the training goes on from there.
    let tame = train(&["--set", "model.learning_rate=1e-3", "--resume"]);
    assert_eq!(tame.code, 0, "{}{}", tame.out, tame.err);
    assert!(at.join("s.safetensors").exists() && !at.join("s.safetensors.checkpoint").exists());
}
