//! What the operating system says about this process, its machine and its program, and the vector instructions in use.

mod vector;

pub(crate) use vector::{VECTOR_VARIABLE, VectorLevel, arch};

use crate::file;
use sha2::{Digest, Sha256};
use std::sync::OnceLock;

/// Largest amount of memory that the process has held so far, in bytes; `None` where the system does not tell (only
/// Linux does, in `/proc`).
#[must_use]
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

/// Processor cores that this process may use; `None` where the system does not tell.
#[must_use]
pub(crate) fn cores() -> Option<usize> {
    std::thread::available_parallelism().ok().map(usize::from)
}

/// Memory of the machine in bytes; `None` where the system does not tell (only Linux does, in `/proc`).
#[must_use]
pub(crate) fn total_memory() -> Option<u64> {
    memory("MemTotal:")
}

/// Memory that a process can still get without others being swapped out, in bytes; `None` where the system does not tell.
#[must_use]
pub(crate) fn available_memory() -> Option<u64> {
    memory("MemAvailable:")
}

fn memory(name: &str) -> Option<u64> {
    let info = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = info.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

/// SHA-256 of the running program's file, hexadecimal: tells builds apart; `None` where it cannot be read.
#[must_use]
pub(crate) fn program_sha256() -> Option<String> {
    static HASH: OnceLock<Option<String>> = OnceLock::new();
    let hash = || {
        let bytes = std::fs::read(std::env::current_exe().ok()?).ok()?;
        Some(file::hex(&Sha256::digest(bytes)))
    };
    HASH.get_or_init(hash).clone()
}

/// The revision of the source that the program was built from, as git named it then ("0a1b2c3d4e5f", with "-dirty" when files
/// of the program were changed); `None` when it was built without git, as from an archive.
#[must_use]
pub(crate) fn revision() -> Option<&'static str> {
    option_env!("MONADNOCK_REVISION").filter(|text| !text.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn the_machine_and_the_program_are_known() {
        assert!(cores().unwrap() >= 1);
        assert!(total_memory().unwrap() > peak_memory().unwrap());
        assert_eq!(program_sha256().unwrap().len(), 64);
        assert!(
            revision().is_none_or(|r| r.trim_end_matches("-dirty").chars().all(|c| c.is_ascii_hexdigit()))
        );
    }
}
