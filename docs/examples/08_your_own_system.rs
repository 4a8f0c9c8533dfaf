//! A system of one's own: two items of the promise, one line to register it, and every verb of the program knows it.
//!
//!     cargo run --release --example 08_your_own_system -- --help
//!     cargo run --release --example 08_your_own_system      # train, generate, eval in the current folder
#![allow(clippy::print_stdout, reason = "an example says what it did")]

#[path = "../../tests/toy/mod.rs"]
mod toy;

use monadnock::{Registry, cli};
use std::process::ExitCode;

fn main() -> ExitCode {
    // The whole system stands in `tests/toy/mod.rs`, in 79 lines: it learns the exemplar's mean height.
    let registry = || Registry::default().system::<toy::Plateau>();
    let run = |line: &str| cli::run_with(registry(), line.split_whitespace().map(Into::into));
    if std::env::args().len() > 1 {
        return cli::run_with(registry(), std::env::args_os());
    }
    for line in [
        "own train sierra --crop 0,0,96 --systems plateau --no-detail -o own.safetensors",
        "own generate own.safetensors --sketch lambda-ring --size 96x96 -o own.tif",
        "own eval own.safetensors sierra --systems plateau --patches 256,128",
    ] {
        println!("$ {line}");
        let ended = run(line);
        if ended != ExitCode::SUCCESS {
            return ended;
        }
    }
    ExitCode::SUCCESS
}
