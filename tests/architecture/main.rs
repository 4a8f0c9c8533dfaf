//! The law of the house, read from the sources themselves: the rooms stand in `src/lib.rs` in the order in which data
//! flows, and a room imports only rooms listed above it. A few smaller laws beside it (`docs/architecture.md`).

#![allow(clippy::unwrap_used, reason = "a source that cannot be read fails the test")]

mod house;

use house::{House, Scan, Source, Word};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Rooms that may name candle: what is trained, the room it stands on, and the error that it can cause.
const CANDLE: [&str; 3] = ["learn", "systems", "error"];
/// Systems without anything to learn, which therefore do not name candle either.
const UNTRAINED: [&str; 4] = ["classical", "gpnn", "landscape", "task"];
/// What systems share: every system may import it.
const SHARED_BY_SYSTEMS: &str = "task";
/// The one room that may know every system; the others know what they share, and the style.
const KNOWS_ALL_SYSTEMS: &str = "style";
/// Rooms that open files themselves.
const OPEN_FILES: [&str; 3] = ["file", "machine", "cli"];
/// Rooms that print.
const PRINT: [&str; 1] = ["cli"];
/// Names that say nothing.
const EMPTY_NAMES: [&str; 6] = ["util", "utils", "common", "helper", "helpers", "manager"];
/// Longest file, in lines.
const LONGEST_FILE: usize = 600;
/// Lines that begin with `pub`: the promise to users, and what benchmarks and tests of the house reach.
const PUBLIC_LINES: usize = 760;
/// Longest name of a test, in letters.
const LONGEST_TEST_NAME: usize = 50;
/// Circles of files that are still to be broken; none may join them.
const CIRCLES: [&[&str]; 3] = [
    &[
        "dem/io/archive.rs",
        "dem/io/ascii_grid.rs",
        "dem/io/description.rs",
        "dem/io/format.rs",
        "dem/io/hgt.rs",
        "dem/io/markers.rs",
        "dem/io/mask.rs",
        "dem/io/npy.rs",
        "dem/io/place.rs",
        "dem/io/png.rs",
        "dem/io/reading.rs",
        "dem/io/samples.rs",
        "dem/io/sidecars.rs",
    ],
    &["dem/io/geotiff/decode.rs", "dem/io/geotiff/masks.rs"],
    &["dem/io/geotiff/layout.rs", "dem/io/geotiff/unpack.rs"],
];

#[test]
fn rooms_import_only_rooms_above_them() {
    let house = house();
    assert!(house.rooms.len() > 10 && house.sources.len() > 50, "the house was read");
    assert!(house.imports().filter(|i| i.to[0] != i.from[0]).count() > 100, "imports were found");
    report(house.upward_imports());
}

#[test]
fn systems_do_not_import_each_other() {
    report(house().sibling_imports());
}

#[test]
fn systems_are_met_in_style_and_by_their_doors() {
    report(house().trespasses());
}

#[test]
fn no_circle_of_files_inside_a_room() {
    let found = house().circles();
    let known: Vec<Vec<String>> =
        CIRCLES.iter().map(|files| files.iter().map(|&file| file.to_owned()).collect()).collect();
    let new = found.iter().filter(|circle| !known.contains(circle));
    let mut faults: Vec<String> = new.map(|circle| format!("a circle: {}", circle.join(" -> "))).collect();
    let broken = known.iter().filter(|circle| !found.contains(circle));
    faults.extend(broken.map(|circle| format!("no circle any more, take it off the list: {circle:?}")));
    report(faults);
}

#[test]
fn only_trained_systems_and_learn_name_candle() {
    let elsewhere = |module: &[String]| {
        !CANDLE.contains(&module[0].as_str())
            || module[0] == "systems" && module.get(1).is_none_or(|s| UNTRAINED.contains(&s.as_str()))
    };
    report(house().words(|word| word.text.starts_with("candle"), elsewhere));
}

#[test]
fn only_the_doors_open_files() {
    let opens = |word: &Word| match word.text.as_str() {
        "fs" | "OpenOptions" | "tempfile" => true,
        // Our own types have variants of that name.
        "File" => ["open", "create", "create_new", "options"].contains(&word.next.as_str()),
        _ => false,
    };
    report(house().words(opens, |module| !OPEN_FILES.contains(&module[0].as_str())));
}

#[test]
fn only_the_command_line_prints() {
    let prints = |word: &Word| {
        word.is_macro && ["println", "print", "eprintln", "eprint", "dbg"].contains(&word.text.as_str())
    };
    report(house().words(prints, |module| !PRINT.contains(&module[0].as_str())));
}

#[test]
fn names_of_tests_are_short() {
    let mut files = Vec::new();
    collect(&root().join("src"), &mut files);
    collect(&root().join("tests"), &mut files);
    let mut faults = Vec::new();
    let mut all = 0;
    for path in files {
        let scan = Scan::of(Vec::new(), &fs::read_to_string(&path).unwrap());
        all += scan.tests.len();
        faults.extend(scan.tests.into_iter().filter(|name| name.len() > LONGEST_TEST_NAME));
    }
    assert!(all > 300, "tests were found: {all}");
    report(faults);
}

#[test]
fn the_public_face_is_small() {
    let public = |source: &Source| source.text.lines().filter(|l| l.trim_start().starts_with("pub ")).count();
    let sources = &house().sources;
    let count: usize = sources.iter().filter(|source| !source.is_test).map(public).sum();
    assert!(count > 100, "lines were found: {count}");
    let fullest = || {
        let mut files: Vec<_> = sources.iter().map(|s| (public(s), s.path.display().to_string())).collect();
        files.sort();
        files.split_off(files.len() - 12)
    };
    assert!(count <= PUBLIC_LINES, "{count} public lines, allowed {PUBLIC_LINES}; most in {:?}", fullest());
}

#[test]
fn every_room_and_system_is_documented() {
    let house = house();
    let mut faults = Vec::new();
    for source in &house.sources {
        let path = source.path.display();
        if !source.is_test && !source.text.starts_with("//!") {
            faults.push(format!("{path}: does not begin with a module comment (//!)"));
        }
        let lines = source.text.lines().count();
        if lines > LONGEST_FILE {
            faults.push(format!("{path}: {lines} lines, allowed: {LONGEST_FILE}"));
        }
        if source.module.iter().any(|name| EMPTY_NAMES.contains(&name.as_str())) {
            faults.push(format!("{path}: a name that says nothing"));
        }
    }
    let architecture = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let table: Vec<&str> = architecture
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
        .map(|(room, _)| room)
        .collect();
    if table != house.rooms {
        faults.push(format!("docs/architecture.md lists {table:?}, src/lib.rs {:?}", house.rooms));
    }
    let systems: BTreeSet<&String> =
        house.sources.iter().filter(|s| s.module[0] == "systems").filter_map(|s| s.module.get(1)).collect();
    for system in systems {
        let paper = format!("docs/papers/{system}.md");
        let is_shared = system == SHARED_BY_SYSTEMS;
        if !is_shared && !root().join(&paper).is_file() {
            faults.push(format!("{paper} is missing"));
        }
    }
    report(faults);
}

/// The scanner itself: rules that cannot fail protect nothing.
#[test]
fn the_scanner_finds_what_is_wrong_and_only_that() {
    let rooms = ["error", "grid", "flow", "systems"].map(String::from).to_vec();
    let house = |files: &[(&str, &str)]| House {
        rooms: rooms.clone(),
        exports: vec![("Error".into(), "error".into())],
        sources: files
            .iter()
            .map(|(module, text)| {
                let module: Vec<String> = module.split("::").map(String::from).collect();
                Source::new(PathBuf::from(format!("{}.rs", module.join("/"))), module, text)
            })
            .collect(),
    };
    let upward = |module: &str, text: &str| house(&[(module, text)]).upward_imports();
    for (module, bad) in [
        ("grid", "use crate::flow::Surface;"),
        ("grid", "use crate::{error::Error, flow::{self, Surface}};"),
        ("grid", "use crate::error::Error;\nfn f() -> crate::flow::Surface { todo() }"),
        ("grid", "use super::flow;"),
        ("grid::cell", "use super::super::flow;\n"),
        ("grid::cell", "mod tests { use super::super::super::flow::Surface; }"),
        ("grid", "fn f<'a>(c: &'a str) -> bool { c == \"\\\"\" && crate::flow::x() }"),
        ("grid", "fn f() { vec![(1, crate::flow::route())]; }"),
        ("grid", "use crate::nowhere::Thing;"),
    ] {
        assert_eq!(upward(module, bad).len(), 1, "{bad}: {:?}", upward(module, bad));
    }
    for good in [
        "use crate::error::Error; use crate::Error;",
        "use crate::grid::Cell; use self::flow; mod flow { use super::flow; }",
        "// use crate::flow::Surface;\n/* crate::flow /* crate::flow */ crate::flow */",
        "/// [`route`](crate::flow::route)\nconst TEXT: &str = \"crate::flow::route\";",
        "const TEXT: &str = r#\"a \" crate::flow::route\"#; const BYTES: &[u8] = b\"crate::flow\";",
        "pub(in crate::grid) fn f() {} pub(super) fn g() {} pub(crate) fn h() {}",
        "mod tests { use super::flow; }",
    ] {
        assert_eq!(upward("grid", good), Vec::<String>::new(), "{good}");
    }
    let message = &upward("grid", "\n\nuse crate::flow::Surface;")[0];
    assert_eq!(message, "grid.rs:3: `grid` imports `flow`, which src/lib.rs lists below it");

    let siblings = |module: &str, text: &str| house(&[(module, text)]).sibling_imports().len();
    assert_eq!(siblings("systems::a::net", "use crate::systems::b::Net;"), 1);
    assert_eq!(siblings("systems::a::net", "use super::super::b::Net;"), 1);
    let allowed = "use super::super::task::T; use super::other; use crate::systems::a::X;";
    assert_eq!(siblings("systems::a::net", allowed), 0);
    let trespasses = |module: &str, text: &str| house(&[(module, text)]).trespasses().len();
    assert_eq!(trespasses("cli::train", "use crate::systems::a::Net;"), 1);
    let quiet = "use crate::systems::task::Part; #[cfg(test)] mod t { use crate::systems::a::X; }";
    assert_eq!(trespasses("cli::train", quiet), 0);
    assert_eq!(trespasses("style", "use crate::systems::a::Net;"), 0);
    assert_eq!(trespasses("style", "use crate::systems::a::net::Net;"), 1);

    let words = |text: &str, name: &str| house(&[("grid", text)]).words(|w| w.text == name, |_| true).len();
    assert_eq!(words("use candle_core::Tensor;", "candle_core"), 1);
    let quiet = "// candle_core\nconst N: &str = \"candle_core\"; #[cfg(test)] mod t { use candle_core::T; }";
    assert_eq!(words(quiet, "candle_core"), 0);
    assert_eq!(words("fn f() { println!(\"x\"); }", "println"), 1);
    assert_eq!(words("#[cfg(test)]\n#[test]\nfn f() { if true { println!(); } }\n", "println"), 0);
    assert_eq!(words("#[cfg(test)] mod tests; fn f() { println!() }", "println"), 1);

    let circle = |a: &str, b: &str, door: &str| {
        house(&[("grid", door), ("grid::a", a), ("grid::b", b)]).circles().concat()
    };
    assert_eq!(circle("use super::b::B;", "use super::a::A;", ""), ["grid/a.rs", "grid/b.rs"]);
    // Through the door, and in a function.
    let door = "mod a; mod b; pub use a::A; pub use b::B; pub const SIDE: usize = 3;";
    assert_eq!(circle("use super::B;", "fn f() { crate::grid::A::new() }", door), ["grid/a.rs", "grid/b.rs"]);
    assert!(circle("use super::B; use super::SIDE;", "use super::SIDE;", door).is_empty());
    assert!(circle("use super::B;", "#[cfg(test)] mod tests { use super::super::A; }", door).is_empty());
}

/// Read once for all rules.
fn house() -> &'static House {
    static HOUSE: OnceLock<House> = OnceLock::new();
    HOUSE.get_or_init(House::read)
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn report(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
}
