//! The program: hands its arguments to [`monadnock::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    monadnock::cli::run(std::env::args_os())
}
