//! The `monadnock` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    monadnock::cli::run(std::env::args_os())
}
