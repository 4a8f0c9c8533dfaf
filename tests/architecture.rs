//! The law of the house, read from the sources themselves: the rooms stand in `src/lib.rs` in the order in which data
//! flows, and a room imports only rooms listed above it. A few smaller laws beside it (`docs/architecture.md`).

#![allow(clippy::unwrap_used, reason = "a source that cannot be read fails the test")]

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use proc_macro2::{TokenStream, TokenTree};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use syn::visit::{self, Visit};

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
/// Longest name of a test, in letters.
const LONGEST_TEST_NAME: usize = 50;
/// Circles of files that are still to be broken; none may join them.
const CIRCLES: [&[&str]; 7] = [
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
    &["systems/gpnn/clusters.rs", "systems/gpnn/patches.rs", "systems/gpnn/synthesis.rs"],
    &["systems/region_gnn/checkpoint.rs", "systems/region_gnn/train.rs"],
    &[
        "systems/region_gnn/fused/op.rs",
        "systems/region_gnn/fused/pass.rs",
        "systems/region_gnn/network.rs",
        "systems/region_gnn/plain.rs",
    ],
    &[
        "systems/singan/checkpoint.rs",
        "systems/singan/detail.rs",
        "systems/singan/scale.rs",
        "systems/singan/train.rs",
    ],
];
/// So many names of tests are still longer; the number may only fall.
const LONG_TEST_NAMES: usize = 46;

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
    let mut long = BTreeSet::new();
    let mut all = 0;
    for path in files {
        let scan = Scan::of(Vec::new(), &fs::read_to_string(&path).unwrap());
        all += scan.tests.len();
        long.extend(scan.tests.into_iter().filter(|name| name.chars().count() > LONGEST_TEST_NAME));
    }
    assert!(all > 300, "tests were found: {all}");
    let listed =
        long.iter().map(|name| format!("{name}: {} letters", name.len())).collect::<Vec<_>>().join("\n");
    assert!(long.len() <= LONG_TEST_NAMES, "allowed: {LONGEST_TEST_NAME} letters\n{listed}");
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

/// What the rules look at.
struct House {
    /// In the order of `src/lib.rs`.
    rooms: Vec<String>,
    /// Names that `src/lib.rs` gives on, with their room.
    exports: Vec<(String, String)>,
    sources: Vec<Source>,
}

/// One file of the library.
struct Source {
    path: PathBuf,
    /// Its module: ["flow", "routing"] for `src/flow/routing.rs`.
    module: Vec<String>,
    text: String,
    scan: Scan,
    is_test: bool,
}

/// What a file says.
#[derive(Default)]
struct Scan {
    /// Names of tests.
    tests: Vec<String>,
    imports: Vec<Import>,
    words: Vec<Word>,
    /// The module at hand, and whether it or the item at hand is compiled for tests alone.
    here: Vec<String>,
    in_tests: bool,
}

#[derive(Clone)]
struct Import {
    from: Vec<String>,
    /// From the crate's root.
    to: Vec<String>,
    line: usize,
    in_tests: bool,
    /// `pub use`, which gives a name on.
    is_export: bool,
}

/// A name outside tests.
struct Word {
    text: String,
    /// The name after it in its path.
    next: String,
    is_macro: bool,
    line: usize,
}

impl Source {
    fn new(path: PathBuf, module: Vec<String>, text: &str) -> Self {
        let is_test = module.iter().any(|name| name == "tests" || name.ends_with("_tests"));
        Self { scan: Scan::of(module.clone(), text), path, module, text: text.to_owned(), is_test }
    }
}

impl House {
    fn read() -> Self {
        let src = root().join("src");
        let lib = syn::parse_file(&fs::read_to_string(src.join("lib.rs")).unwrap()).unwrap();
        let (mut rooms, mut exports) = (Vec::new(), Vec::new());
        for item in &lib.items {
            match item {
                syn::Item::Mod(module) => rooms.push(module.ident.to_string()),
                syn::Item::Use(item) => paths_of(&item.tree, &[], &mut |path, _| {
                    exports.push((path[path.len() - 1].clone(), path[0].clone()));
                }),
                _ => {}
            }
        }
        let mut files = Vec::new();
        collect(&src, &mut files);
        files.retain(|path| *path != src.join("lib.rs") && *path != src.join("main.rs"));
        let source = |path: PathBuf| {
            let inside = path.strip_prefix(&src).unwrap().with_extension("");
            let mut module: Vec<String> =
                inside.iter().map(|name| name.to_str().unwrap().to_owned()).collect();
            module.pop_if(|name| name == "mod");
            let text = fs::read_to_string(&path).unwrap();
            Source::new(path.strip_prefix(root()).unwrap().to_owned(), module, &text)
        };
        Self { rooms, exports, sources: files.into_iter().map(source).collect() }
    }

    fn imports(&self) -> impl Iterator<Item = &Import> {
        self.sources.iter().flat_map(|source| &source.scan.imports)
    }

    fn upward_imports(&self) -> Vec<String> {
        let place = |room: &str| self.rooms.iter().position(|r| r == room);
        let mut faults = Vec::new();
        for source in &self.sources {
            for Import { to, line, .. } in &source.scan.imports {
                let (at, here, named) = (source.path.display(), &source.module[0], &to[0]);
                let room =
                    self.exports.iter().find(|(name, _)| name == named).map_or(named, |(_, room)| room);
                match (place(here), place(room)) {
                    (Some(here), Some(there)) if there <= here => {}
                    (Some(_), Some(_)) => faults.push(format!(
                        "{at}:{line}: `{here}` imports `{room}`, which src/lib.rs lists below it"
                    )),
                    (None, _) => faults.push(format!("{at}:{line}: `{here}` is not a room of src/lib.rs")),
                    (_, None) => {
                        faults.push(format!("{at}:{line}: `crate::{named}` is not a room of src/lib.rs"))
                    }
                }
            }
        }
        // One use tree may name a room several times.
        faults.dedup();
        faults
    }

    fn sibling_imports(&self) -> Vec<String> {
        let mut faults = Vec::new();
        for source in &self.sources {
            for Import { to, line, .. } in &source.scan.imports {
                let ([first, here, ..], [other, there, ..]) = (source.module.as_slice(), to.as_slice())
                else {
                    continue;
                };
                let free = there == SHARED_BY_SYSTEMS;
                if first == "systems" && other == "systems" && here != there && !free {
                    let at = source.path.display();
                    faults.push(format!("{at}:{line}: system `{here}` imports system `{there}`"));
                }
            }
        }
        faults
    }

    /// Imports of a system by a room that is not `style`, or past the system's door; what tests look at is theirs.
    fn trespasses(&self) -> Vec<String> {
        let mut faults = Vec::new();
        for source in self.sources.iter().filter(|s| !s.is_test && s.module[0] != "systems") {
            for Import { to, line, .. } in source.scan.imports.iter().filter(|i| !i.in_tests) {
                let [room, system, rest @ ..] = to.as_slice() else { continue };
                if room != "systems" || system == SHARED_BY_SYSTEMS {
                    continue;
                }
                let at = source.path.display();
                if source.module[0] != KNOWS_ALL_SYSTEMS {
                    faults.push(format!("{at}:{line}: `{}` knows the system `{system}`", source.module[0]));
                } else if rest.len() > 1 {
                    faults.push(format!("{at}:{line}: goes past the door of the system `{system}`"));
                }
            }
        }
        faults
    }

    /// Words outside tests that `is_bad` names, in modules where they are.
    fn words(&self, is_bad: impl Fn(&Word) -> bool, here: impl Fn(&[String]) -> bool) -> Vec<String> {
        let mut faults = Vec::new();
        for source in self.sources.iter().filter(|s| !s.is_test && here(&s.module)) {
            let words = source.scan.words.iter().filter(|word| is_bad(word));
            faults.extend(words.map(|w| format!("{}:{}: names `{}`", source.path.display(), w.line, w.text)));
        }
        faults
    }

    /// The file that a path from the crate's root leads to, through the names that doors give on.
    fn file_of(&self, path: &[String], steps: usize) -> Option<usize> {
        let fits = |s: &Source| path.starts_with(&s.module);
        let found =
            self.sources.iter().enumerate().filter(|(_, s)| fits(s)).max_by_key(|(_, s)| s.module.len());
        let (index, source) = found?;
        let Some(name) = path.get(source.module.len()) else { return Some(index) };
        let given = source.scan.imports.iter().find(|i| i.is_export && i.to.last() == Some(name));
        match given {
            Some(import) if steps > 0 && import.to != path => self.file_of(&import.to, steps - 1),
            _ => Some(index),
        }
    }

    /// Files of one room that import each other in a circle, outside tests; sorted.
    fn circles(&self) -> Vec<Vec<String>> {
        let mut graph = DiGraphMap::<usize, ()>::new();
        for (index, source) in self.sources.iter().enumerate().filter(|(_, s)| !s.is_test) {
            for import in source.scan.imports.iter().filter(|i| !i.in_tests && !i.is_export) {
                let Some(other) = self.file_of(&import.to, 8) else { continue };
                if other != index && self.sources[other].module[0] == source.module[0] {
                    graph.add_edge(index, other, ());
                }
            }
        }
        let name = |index: usize| {
            let path = self.sources[index].path.display().to_string();
            path.strip_prefix("src/").map_or(path.clone(), str::to_owned)
        };
        let mut circles: Vec<Vec<String>> = tarjan_scc(&graph)
            .into_iter()
            .filter(|c| c.len() > 1)
            .map(|c| c.into_iter().map(name).collect())
            .collect();
        circles.iter_mut().for_each(|circle| circle.sort());
        circles.sort();
        circles
    }
}

impl Scan {
    fn of(module: Vec<String>, text: &str) -> Self {
        let mut scan = Self { here: module, ..Self::default() };
        scan.visit_file(&syn::parse_file(text).unwrap());
        scan
    }

    fn import(&mut self, path: &[String], line: usize, is_export: bool) {
        let mut to = match path[0].as_str() {
            "crate" => Vec::new(),
            "self" => self.here.clone(),
            "super" if !self.here.is_empty() => self.here[..self.here.len() - 1].to_vec(),
            _ => return,
        };
        for name in &path[1..] {
            match name.as_str() {
                "super" => drop(to.pop()),
                "self" => {}
                _ => to.push(name.clone()),
            }
        }
        if path.len() > 1 && !to.is_empty() {
            let (from, in_tests) = (self.here.clone(), self.in_tests);
            self.imports.push(Import { from, to, line, in_tests, is_export });
        }
    }

    fn word(&mut self, path: &[String], i: usize, line: usize, is_macro: bool) {
        if !self.in_tests {
            let next = path.get(i + 1).cloned().unwrap_or_default();
            self.words.push(Word { text: path[i].clone(), next, is_macro, line });
        }
    }

    fn path(&mut self, path: &[String], line: usize, is_export: bool) {
        self.import(path, line, is_export);
        (0..path.len()).for_each(|i| self.word(path, i, line, false));
    }

    /// Paths among tokens that only the macro understands.
    fn tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut line, mut colons) = (Vec::<String>::new(), 0, 0);
        for token in tokens {
            match token {
                TokenTree::Ident(ident) => {
                    if colons != 2 && !path.is_empty() {
                        self.path(&std::mem::take(&mut path), line, false);
                    }
                    (line, colons) = (ident.span().start().line, 0);
                    path.push(ident.to_string());
                }
                TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                TokenTree::Group(group) => self.tokens(group.stream()),
                _ => colons = 3,
            }
        }
        if !path.is_empty() {
            self.path(&path, line, false);
        }
    }
}

fn is_marked(attributes: &[syn::Attribute], name: &str, inside: &str) -> bool {
    attributes.iter().any(|attribute| {
        let list = attribute.meta.require_list().map(|list| list.tokens.to_string()).unwrap_or_default();
        attribute.path().is_ident(name) && list == inside
    })
}

/// Every path of a use tree: `a::{b, c::d}` gives a::b and a::c::d.
fn paths_of(tree: &syn::UseTree, before: &[String], found: &mut dyn FnMut(&[String], usize)) {
    let with = |ident: &syn::Ident| [before, &[ident.to_string()]].concat();
    match tree {
        syn::UseTree::Path(path) => paths_of(&path.tree, &with(&path.ident), found),
        syn::UseTree::Name(name) => found(&with(&name.ident), name.ident.span().start().line),
        syn::UseTree::Rename(name) => found(&with(&name.ident), name.ident.span().start().line),
        syn::UseTree::Glob(glob) => found(before, glob.star_token.span.start().line),
        syn::UseTree::Group(group) => group.items.iter().for_each(|tree| paths_of(tree, before, found)),
    }
}

impl<'ast> Visit<'ast> for Scan {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let attributes = match item {
            syn::Item::Mod(item) => &item.attrs,
            syn::Item::Fn(item) => &item.attrs,
            syn::Item::Use(item) => &item.attrs,
            syn::Item::Impl(item) => &item.attrs,
            syn::Item::Struct(item) => &item.attrs,
            syn::Item::Const(item) => &item.attrs,
            _ => &Vec::new(),
        };
        let before = self.in_tests;
        self.in_tests |= is_marked(attributes, "cfg", "test");
        visit::visit_item(self, item);
        self.in_tests = before;
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        self.here.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.here.pop();
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if is_marked(&item.attrs, "test", "") {
            self.tests.push(item.sig.ident.to_string());
        }
        visit::visit_item_fn(self, item);
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let is_export = !matches!(item.vis, syn::Visibility::Inherited);
        let mut paths = Vec::new();
        paths_of(&item.tree, &[], &mut |path, line| paths.push((path.to_vec(), line)));
        for (mut path, line) in paths {
            // `pub use a::A` in a door names its own file `a`.
            if is_export && !["crate", "super", "self"].contains(&path[0].as_str()) {
                path.insert(0, "self".to_owned());
            }
            self.path(&path, line, is_export);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        self.path(&names, path.segments[0].ident.span().start().line, false);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        if let Some(last) = item.path.segments.last() {
            self.word(&[last.ident.to_string()], 0, last.ident.span().start().line, true);
        }
        self.tokens(item.tokens.clone());
    }
}
