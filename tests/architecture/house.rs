//! The sources as the laws look at them: rooms, files, their imports, words and tests.

use super::{KNOWS_ALL_SYSTEMS, SHARED_BY_SYSTEMS, collect, root};
use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use proc_macro2::{TokenStream, TokenTree};
use std::fs;
use std::path::PathBuf;
use syn::visit::{self, Visit};

/// What the rules look at.
pub(super) struct House {
    /// In the order of `src/lib.rs`.
    pub(super) rooms: Vec<String>,
    /// Names that `src/lib.rs` gives on, with their room.
    pub(super) exports: Vec<(String, String)>,
    pub(super) sources: Vec<Source>,
}

/// One file of the library.
pub(super) struct Source {
    pub(super) path: PathBuf,
    /// Its module: ["flow", "routing"] for `src/flow/routing.rs`.
    pub(super) module: Vec<String>,
    pub(super) text: String,
    pub(super) scan: Scan,
    pub(super) is_test: bool,
}

/// What a file says.
#[derive(Default)]
pub(super) struct Scan {
    /// Names of tests.
    pub(super) tests: Vec<String>,
    pub(super) imports: Vec<Import>,
    pub(super) words: Vec<Word>,
    /// The module at hand, and whether it or the item at hand is compiled for tests alone.
    pub(super) here: Vec<String>,
    pub(super) in_tests: bool,
}

#[derive(Clone)]
pub(super) struct Import {
    pub(super) from: Vec<String>,
    /// From the crate's root.
    pub(super) to: Vec<String>,
    pub(super) line: usize,
    pub(super) in_tests: bool,
    /// `pub use`, which gives a name on.
    pub(super) is_export: bool,
}

/// A name outside tests.
pub(super) struct Word {
    pub(super) text: String,
    /// The name after it in its path.
    pub(super) next: String,
    pub(super) is_macro: bool,
    pub(super) line: usize,
}

impl Source {
    pub(super) fn new(path: PathBuf, module: Vec<String>, text: &str) -> Self {
        let is_test = module.iter().any(|name| name == "tests" || name.ends_with("_tests"));
        Self { scan: Scan::of(module.clone(), text), path, module, text: text.to_owned(), is_test }
    }
}

impl House {
    pub(super) fn read() -> Self {
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

    pub(super) fn imports(&self) -> impl Iterator<Item = &Import> {
        self.sources.iter().flat_map(|source| &source.scan.imports)
    }

    pub(super) fn upward_imports(&self) -> Vec<String> {
        let place = |room: &str| self.rooms.iter().position(|r| r == room);
        let mut faults = Vec::new();
        for source in &self.sources {
            for Import { to, line, .. } in &source.scan.imports {
                let (at, here, named) = (source.path.display(), &source.module[0], &to[0]);
                // A function may be called like a room: paths into the crate mean the room.
                let given_on = self.exports.iter().find(|(name, _)| name == named && place(name).is_none());
                let room = given_on.map_or(named, |(_, room)| room);
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

    pub(super) fn sibling_imports(&self) -> Vec<String> {
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
    pub(super) fn trespasses(&self) -> Vec<String> {
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
    pub(super) fn words(
        &self,
        is_bad: impl Fn(&Word) -> bool,
        here: impl Fn(&[String]) -> bool,
    ) -> Vec<String> {
        let mut faults = Vec::new();
        for source in self.sources.iter().filter(|s| !s.is_test && here(&s.module)) {
            let words = source.scan.words.iter().filter(|word| is_bad(word));
            faults.extend(words.map(|w| format!("{}:{}: names `{}`", source.path.display(), w.line, w.text)));
        }
        faults
    }

    /// The file that a path from the crate's root leads to, through the names that doors give on.
    pub(super) fn file_of(&self, path: &[String], steps: usize) -> Option<usize> {
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
    pub(super) fn circles(&self) -> Vec<Vec<String>> {
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
    pub(super) fn of(module: Vec<String>, text: &str) -> Self {
        let mut scan = Self { here: module, ..Self::default() };
        scan.visit_file(&syn::parse_file(text).unwrap());
        scan
    }

    pub(super) fn import(&mut self, path: &[String], line: usize, is_export: bool) {
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

    pub(super) fn word(&mut self, path: &[String], i: usize, line: usize, is_macro: bool) {
        if !self.in_tests {
            let next = path.get(i + 1).cloned().unwrap_or_default();
            self.words.push(Word { text: path[i].clone(), next, is_macro, line });
        }
    }

    pub(super) fn path(&mut self, path: &[String], line: usize, is_export: bool) {
        self.import(path, line, is_export);
        (0..path.len()).for_each(|i| self.word(path, i, line, false));
    }

    /// Paths among tokens that only the macro understands.
    pub(super) fn tokens(&mut self, tokens: TokenStream) {
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

pub(super) fn is_marked(attributes: &[syn::Attribute], name: &str, inside: &str) -> bool {
    attributes.iter().any(|attribute| {
        let list = attribute.meta.require_list().map(|list| list.tokens.to_string()).unwrap_or_default();
        attribute.path().is_ident(name) && list == inside
    })
}

/// Every path of a use tree: `a::{b, c::d}` gives a::b and a::c::d.
pub(super) fn paths_of(tree: &syn::UseTree, before: &[String], found: &mut dyn FnMut(&[String], usize)) {
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
