//! Tells the program which revision of its source it is built from (`machine::revision`).
//!
//! Runs when the sources change, which is when the program is compiled anyway: a commit alone rebuilds nothing, and a program
//! that was built from changed files goes on saying so. Without git, as in an unpacked archive, there is no revision.

use std::path::PathBuf;
use std::process::Command;

/// What the program is made of.
const SOURCES: [&str; 5] = ["src", "data", "build.rs", "Cargo.toml", "Cargo.lock"];

fn main() {
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
    }
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    // The revision of a repository around an archive is not that of the archive.
    if !root.join(".git").exists() {
        return;
    }
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(&root).args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?;
        Some(text.trim_end().to_owned())
    };
    let Some(revision) = git(&["rev-parse", "--short=12", "HEAD"]) else { return };
    let changed = git(&[&["status", "--porcelain", "--untracked-files=no", "--"][..], &SOURCES].concat());
    let dirty = if changed.is_none_or(|files| files.is_empty()) { "" } else { "-dirty" };
    println!("cargo::rustc-env=MONADNOCK_REVISION={revision}{dirty}");
}
