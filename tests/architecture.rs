//! The law of the house, read from the sources themselves: the rooms stand in `src/lib.rs` in the order in which data
//! flows, and a room imports only rooms listed above it. A few smaller laws beside it (`docs/architecture.md`).
//!
//! Free of dependencies, so that it can be compiled alone: `rustc --test tests/architecture.rs --edition 2024` with
//! `CARGO_MANIFEST_DIR` set.

#![allow(clippy::unwrap_used, reason = "a source that cannot be read fails the test")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms and files that may name candle: what is trained, the room it stands on, and the error that it can cause.
const CANDLE: [&str; 3] = ["learn", "systems", "error"];
/// Systems without anything to learn, which therefore do not name candle either.
const UNTRAINED: [&str; 4] = ["classical", "gpnn", "landscape", "task"];
/// What systems share: every system may import it.
const SHARED_BY_SYSTEMS: &str = "task";
/// Files of `systems` that may know several systems.
const KNOW_ALL_SYSTEMS: [&str; 2] = ["registry", "pipeline"];
/// Places that open files themselves. The last two do on their own what `file` does; take them off when they call it.
const OPEN_FILES: [&str; 3] = ["file", "machine", "cli"];
/// Rooms that print.
const PRINT: [&str; 1] = ["cli"];
/// Names that say nothing.
const EMPTY_NAMES: [&str; 6] = ["util", "utils", "common", "helper", "helpers", "manager"];
/// Longest file, in lines.
const LONGEST_FILE: usize = 600;

#[test]
fn rooms_import_only_rooms_above_them() {
    let house = House::read();
    assert!(house.rooms.len() > 10 && house.sources.len() > 50, "the house was read");
    assert!(
        house.imports().filter(|import| import.to[0] != import.from[0]).count() > 100,
        "imports were found"
    );
    report(house.upward_imports());
}

#[test]
fn systems_do_not_import_each_other() {
    report(House::read().sibling_imports());
}

#[test]
fn only_trained_systems_and_the_learning_room_name_candle() {
    report(House::read().named(
        |word| word.starts_with("candle"),
        |module| {
            !CANDLE.contains(&module[0].as_str())
                || module[0] == "systems" && module.get(1).is_none_or(|s| UNTRAINED.contains(&s.as_str()))
        },
    ));
}

#[test]
fn only_the_doors_open_files() {
    let house = House::read();
    let opens = |tokens: &[Token], i: usize| match tokens[i].text.as_str() {
        "fs" | "OpenOptions" | "tempfile" => true,
        // Our own types have variants of that name.
        "File" => {
            tokens.get(i + 2).is_some_and(|t| ["open", "create", "create_new", "options"].contains(&&*t.text))
        }
        _ => false,
    };
    let allowed = |module: &[String]| {
        let path = module.join("::");
        OPEN_FILES.iter().any(|open| path == *open || path.starts_with(&format!("{open}::")))
    };
    report(house.words(opens, |module| !allowed(module)));
    for open in OPEN_FILES.iter().filter(|open| open.contains("::")) {
        let still = house.words(opens, |module| module.join("::") == **open);
        assert!(!still.is_empty(), "{open} opens no files any more: take it off the list");
    }
}

#[test]
fn only_the_command_line_prints() {
    let prints = |word: &str| ["println", "print", "eprintln", "eprint", "dbg"].contains(&word);
    report(House::read().macros_named(prints, |module| !PRINT.contains(&module[0].as_str())));
}

#[test]
fn every_room_and_system_is_documented() {
    let house = House::read();
    let mut faults = Vec::new();
    for source in &house.sources {
        if !source.is_test && !source.text.starts_with("//!") {
            faults.push(format!("{}: does not begin with a module comment (//!)", source.path.display()));
        }
        let lines = source.text.lines().count();
        if lines > LONGEST_FILE {
            faults.push(format!("{}: {lines} lines, allowed: {LONGEST_FILE}", source.path.display()));
        }
        if source.module.iter().any(|name| EMPTY_NAMES.contains(&name.as_str())) {
            faults.push(format!("{}: a name that says nothing", source.path.display()));
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
        let is_shared = system == SHARED_BY_SYSTEMS || KNOW_ALL_SYSTEMS.contains(&system.as_str());
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
    let house = |module: &str, text: &str| House {
        rooms: rooms.clone(),
        exports: vec![("Error".into(), "error".into())],
        sources: vec![Source::new(
            PathBuf::from("made-up.rs"),
            module.split("::").map(String::from).collect(),
            text,
        )],
    };
    let upward = |module: &str, text: &str| house(module, text).upward_imports();

    for bad in [
        "use crate::flow::Surface;",
        "use crate::{error::Error, flow::{self, Surface}};",
        "use crate::error::Error;\nfn f() -> crate::flow::Surface { todo() }",
        "use super::flow;",
        "use super::super::flow;\n", // from grid::cell, below
        "mod tests { use super::super::flow::Surface; }",
        "fn f<'a>(c: &'a str) -> bool { c == \"\\\"\" && crate::flow::x() }",
        "fn f() { let quote = '\"'; crate::flow::route(); let quote = '\"'; }",
        "use crate::nowhere::Thing;",
    ] {
        let module =
            if bad.contains("below") || bad.starts_with("use super::super") { "grid::cell" } else { "grid" };
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
    assert_eq!(message, "made-up.rs:3: `grid` imports `flow`, which src/lib.rs lists below it");

    let siblings = |module: &str, text: &str| house(module, text).sibling_imports().len();
    assert_eq!(siblings("systems::a::net", "use crate::systems::b::Net;"), 1);
    assert_eq!(siblings("systems::a::net", "use super::super::b::Net;"), 1);
    assert_eq!(
        siblings("systems::a::net", "use super::super::task::T; use super::other; use crate::systems::a::X;"),
        0
    );
    assert_eq!(siblings("systems::registry", "use super::{a, b};"), 0);

    let candle = |text: &str| house("grid", text).named(|w| w.starts_with("candle"), |_| true).len();
    assert_eq!(candle("use candle_core::Tensor;"), 1);
    assert_eq!(
        candle(
            "// candle_core\nconst NAME: &str = \"candle_core\"; #[cfg(test)] mod t { use candle_core::T; }"
        ),
        0
    );
    let prints = |text: &str| house("grid", text).macros_named(|w| w == "println", |_| true).len();
    assert_eq!(prints("fn f() { println!(\"x\"); }"), 1);
    assert_eq!(prints("fn println() {} #[cfg(test)]\n#[test]\nfn f() { if true { println!(); } }\n"), 0);
    assert_eq!(prints("#[cfg(test)] mod tests; fn f() { println!() }"), 1);
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn report(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
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
    tokens: Vec<Token>,
    is_test: bool,
}

struct Import {
    from: Vec<String>,
    to: Vec<String>,
    /// "file:line".
    place: String,
}

#[derive(Clone, Debug, PartialEq)]
struct Token {
    text: String,
    line: usize,
}

impl House {
    fn read() -> Self {
        let src = root().join("src");
        let lib = tokens(&fs::read_to_string(src.join("lib.rs")).unwrap());
        let rooms = lib
            .windows(3)
            .filter(|w| w[0].text == "mod" && w[2].text == ";")
            .map(|w| w[1].text.clone())
            .collect();
        let mut exports = Vec::new();
        for (i, _) in lib.iter().enumerate().filter(|(_, token)| token.text == "use") {
            for path in use_tree(&lib, i + 1).into_iter().filter(|path| path.len() > 1) {
                exports.push((path[path.len() - 1].clone(), path[0].clone()));
            }
        }
        let mut files = Vec::new();
        collect(&src, &mut files);
        files.sort();
        let sources = files
            .into_iter()
            .filter(|path| *path != src.join("lib.rs") && *path != src.join("main.rs"))
            .map(|path| {
                let inside = path.strip_prefix(&src).unwrap().with_extension("");
                let mut module: Vec<String> =
                    inside.iter().map(|name| name.to_str().unwrap().to_owned()).collect();
                module.pop_if(|name| name == "mod");
                let text = fs::read_to_string(&path).unwrap();
                Source::new(path.strip_prefix(root()).unwrap().to_owned(), module, &text)
            })
            .collect();
        Self { rooms, exports, sources }
    }

    fn imports(&self) -> impl Iterator<Item = Import> {
        self.sources.iter().flat_map(Source::imports)
    }

    fn upward_imports(&self) -> Vec<String> {
        let place = |room: &str| self.rooms.iter().position(|r| r == room);
        let mut faults = Vec::new();
        for Import { from, to, place: at } in self.imports() {
            let named = &to[0];
            let room = self.exports.iter().find(|(name, _)| name == named).map_or(named, |(_, room)| room);
            match (place(&from[0]), place(room)) {
                (Some(here), Some(there)) if there <= here => {}
                (Some(_), Some(_)) => faults
                    .push(format!("{at}: `{}` imports `{room}`, which src/lib.rs lists below it", from[0])),
                (None, _) => faults.push(format!("{at}: `{}` is not a room of src/lib.rs", from[0])),
                (_, None) => faults.push(format!("{at}: `crate::{named}` is not a room of src/lib.rs")),
            }
        }
        // One use tree may name a room several times.
        faults.dedup();
        faults
    }

    fn sibling_imports(&self) -> Vec<String> {
        let mut faults = Vec::new();
        for Import { from, to, place } in self.imports() {
            if from[0] != "systems" || to[0] != "systems" || from.len() < 2 || to.len() < 2 {
                continue;
            }
            let (here, there) = (&from[1], &to[1]);
            let free = KNOW_ALL_SYSTEMS.contains(&here.as_str());
            if here != there && there != SHARED_BY_SYSTEMS && !free {
                faults.push(format!("{place}: system `{here}` imports system `{there}`"));
            }
        }
        faults
    }

    /// Words outside tests that `forbidden` names, in modules where they are.
    fn named(&self, forbidden: impl Fn(&str) -> bool, here: impl Fn(&[String]) -> bool) -> Vec<String> {
        self.words(|tokens, i| forbidden(&tokens[i].text), here)
    }

    fn macros_named(
        &self,
        forbidden: impl Fn(&str) -> bool,
        here: impl Fn(&[String]) -> bool,
    ) -> Vec<String> {
        let is_macro = |tokens: &[Token], i: usize| tokens.get(i + 1).is_some_and(|t| t.text == "!");
        self.words(|tokens, i| forbidden(&tokens[i].text) && is_macro(tokens, i), here)
    }

    fn words(
        &self,
        forbidden: impl Fn(&[Token], usize) -> bool,
        here: impl Fn(&[String]) -> bool,
    ) -> Vec<String> {
        let mut faults = Vec::new();
        for source in self.sources.iter().filter(|s| !s.is_test && here(&s.module)) {
            let tokens = without_tests(&source.tokens);
            for i in (0..tokens.len()).filter(|&i| forbidden(&tokens, i)) {
                faults.push(format!("{}: names `{}`", source.place(&tokens[i]), tokens[i].text));
            }
        }
        faults
    }
}

impl Source {
    fn new(path: PathBuf, module: Vec<String>, text: &str) -> Self {
        let is_test = module.last().is_some_and(|name| name == "tests" || name.ends_with("_tests"));
        Self { path, module, text: text.to_owned(), tokens: tokens(text), is_test }
    }

    fn place(&self, token: &Token) -> String {
        format!("{}:{}", self.path.display(), token.line)
    }

    /// Every path that begins at `crate`, `super` or `self`, resolved; also inside tests and inline modules.
    fn imports(&self) -> Vec<Import> {
        let tokens = &self.tokens;
        let text = |i: usize| tokens.get(i).map_or("", |t| t.text.as_str());
        let mut imports = Vec::new();
        let mut depth = 0;
        // Inline modules that are open, with the depth of braces inside them.
        let mut inline: Vec<(String, usize)> = Vec::new();
        for i in 0..tokens.len() {
            match text(i) {
                "{" => depth += 1,
                "}" => {
                    inline.pop_if(|(_, inside)| *inside == depth);
                    depth -= 1;
                }
                "mod" if text(i + 2) == "{" => inline.push((text(i + 1).to_owned(), depth + 1)),
                start @ ("crate" | "super" | "self")
                    if text(i + 1) == "::" && (i == 0 || text(i - 1) != "::") =>
                {
                    let mut here = self.module.clone();
                    here.extend(inline.iter().map(|(name, _)| name.clone()));
                    let base = match start {
                        "crate" => Vec::new(),
                        "super" => here[..here.len() - 1].to_vec(),
                        _ => here,
                    };
                    for path in use_tree(tokens, i + 2) {
                        let mut to = base.clone();
                        for name in path {
                            match name.as_str() {
                                "super" => drop(to.pop()),
                                "self" => {}
                                _ => to.push(name),
                            }
                        }
                        if !to.is_empty() {
                            imports.push(Import {
                                from: self.module.clone(),
                                to,
                                place: self.place(&tokens[i]),
                            });
                        }
                    }
                }
                _ => {}
            }
        }
        imports
    }
}

/// The paths of a use tree (`a::{b, c::d}` gives a::b and a::c::d) or of a plain path that begins at token `i`.
fn use_tree(tokens: &[Token], i: usize) -> Vec<Vec<String>> {
    fn parse(tokens: &[Token], i: &mut usize, prefix: &[String], paths: &mut Vec<Vec<String>>) {
        let text = |i: usize| tokens.get(i).map_or("", |t| t.text.as_str());
        let mut path = prefix.to_vec();
        loop {
            match text(*i) {
                "{" => {
                    *i += 1;
                    while !matches!(text(*i), "}" | "") {
                        parse(tokens, i, &path, paths);
                        if text(*i) == "as" {
                            *i += 2;
                        }
                        if text(*i) == "," {
                            *i += 1;
                        }
                    }
                    *i += 1;
                    return;
                }
                "*" => *i += 1,
                word if is_word(word) => {
                    path.push(word.to_owned());
                    *i += 1;
                    if text(*i) == "::"
                        && (text(*i + 1) == "{" || text(*i + 1) == "*" || is_word(text(*i + 1)))
                    {
                        *i += 1;
                        continue;
                    }
                }
                // Not a use tree after all: leave it to the caller.
                _ => *i += 1,
            }
            paths.push(path);
            return;
        }
    }
    let (mut at, mut paths) = (i, Vec::new());
    parse(tokens, &mut at, &[], &mut paths);
    paths
}

fn is_word(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Without items under `#[cfg(test)]`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    const MARK: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if !(tokens.len() - i >= MARK.len() && tokens[i..].iter().zip(MARK).all(|(t, mark)| t.text == mark)) {
            kept.push(tokens[i].clone());
            i += 1;
            continue;
        }
        i += MARK.len();
        let mut depth = 0;
        while i < tokens.len() {
            let text = tokens[i].text.as_str();
            i += 1;
            match text {
                "{" | "(" | "[" => depth += 1,
                "}" | ")" | "]" => depth -= 1,
                _ => {}
            }
            if depth == 0 && matches!(text, "}" | ";") {
                break;
            }
        }
    }
    kept
}

/// Words, `::` and single signs of Rust source; comments, strings, characters and lifetimes left out.
fn tokens(source: &str) -> Vec<Token> {
    let text: Vec<char> = source.chars().collect();
    let at = |i: usize| text.get(i).copied().unwrap_or('\0');
    let mut found = Vec::new();
    let mut line = 1;
    let mut i = 0;
    while i < text.len() {
        let start = i;
        if at(i) == '/' && at(i + 1) == '/' {
            while i < text.len() && at(i) != '\n' {
                i += 1;
            }
        } else if at(i) == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            while i < text.len() {
                match (at(i), at(i + 1)) {
                    ('/', '*') => (depth, i) = (depth + 1, i + 2),
                    ('*', '/') => (depth, i) = (depth - 1, i + 2),
                    _ => i += 1,
                }
                if depth == 0 {
                    break;
                }
            }
        } else if at(i) == '"' {
            i = end_of_string(&text, i + 1);
        } else if at(i) == '\'' {
            // A character ends with a quote after one (escaped) sign; anything else is a lifetime.
            i = match (at(i + 1), at(i + 2)) {
                ('\\', _) => (i + 3..text.len()).find(|&j| at(j) == '\'').unwrap_or(text.len()) + 1,
                (_, '\'') => i + 3,
                _ => i + 1,
            };
        } else if at(i).is_alphanumeric() || at(i) == '_' {
            while at(i).is_alphanumeric() || at(i) == '_' {
                i += 1;
            }
            let word: String = text[start..i].iter().collect();
            let hashes = (i..text.len()).take_while(|&j| at(j) == '#').count();
            let is_raw = matches!(word.as_str(), "r" | "br" | "cr") && at(i + hashes) == '"';
            if is_raw {
                let closes = |j: usize| at(j) == '"' && (1..=hashes).all(|k| at(j + k) == '#');
                i = (i + hashes + 1..text.len()).find(|&j| closes(j)).unwrap_or(text.len()) + 1 + hashes;
            } else if matches!(word.as_str(), "b" | "c") && at(i) == '"' {
                i = end_of_string(&text, i + 1);
            } else {
                found.push(Token { text: word, line });
            }
        } else if at(i) == ':' && at(i + 1) == ':' {
            found.push(Token { text: "::".into(), line });
            i += 2;
        } else {
            if !at(i).is_whitespace() {
                found.push(Token { text: at(i).to_string(), line });
            }
            i += 1;
        }
        line += text[start..i.min(text.len())].iter().filter(|c| **c == '\n').count();
    }
    found
}

fn end_of_string(text: &[char], mut i: usize) -> usize {
    while i < text.len() {
        match text[i] {
            '\\' => i += 2,
            '"' => return i + 1,
            _ => i += 1,
        }
    }
    i
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
}
