//! The command line: one file per verb, one [`run`] for all.
//!
//! A verb is a [`clap::Args`] struct and `fn run(args, context) -> Result<()>`. What several verbs read from the command
//! line is in `args`; everything that is shown goes through the `console`. Results are in the files that a verb
//! writes, and they do not depend on `--threads` or `--quiet`.

mod amplify;
mod args;
mod completions;
mod console;
mod data;
mod demo;
mod eval;
mod experiment;
mod extract;
mod generate;
mod sketch_check;
mod info;
mod outputs;
mod render;
mod sample;
mod sketch_fill;
mod sketch_input;
mod sketch_map;
mod sources;
mod train;
mod tree;
mod watch;

use crate::control::Stop;
use crate::error::{Error, Result};
use crate::machine::{VECTOR_VARIABLE, VectorLevel};
use crate::seed::Seed;
use crate::style::Registry;
use clap::{CommandFactory, Parser, Subcommand};
use console::Console;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::OnceLock;

/// Exit code of terrain that breaks a bound of its sketch.
const BROKEN_BOUND: u8 = 3;
/// What shells give for a program that Ctrl-C ended.
const INTERRUPTED: u8 = 130;

const PROGRAM: &str = env!("CARGO_PKG_NAME");

const AFTER_HELP: &str = "\
Examples:
  monadnock demo --quick
  monadnock train sierra -o sierra.safetensors
  monadnock generate sierra.safetensors --sketch lambda-ring -o terrain.tif
  monadnock extract sierra --crop 128,128,256 -o sketch.geojson
  monadnock render sierra --crop 128,128,256 --sketch sketch.geojson -o sierra.png
  monadnock info sketch.geojson
  monadnock help extract

Terrain is read from GeoTIFF, SRTM .hgt, ESRI ASCII grid, greyscale PNG and NumPy .npy files, or comes with the program
(sierra, grand-canyon).

Exit codes:
  0  done
  1  failed: the message says which file, which field, the value found and what is allowed
  2  the command line was not understood
  3  done, but a bound given with generate --bound is broken
  130  stopped by Ctrl-C: nothing half written is left";

/// What the long help says beside.
fn after_long_help() -> String {
    format!(
        "{AFTER_HELP}

Environment:
  {VECTOR_VARIABLE}  vector instructions of the kernels: scalar, avx2 or avx512; the widest of the processor when it is not set.
  The same seed gives the same bytes at the same level; between levels the last bits of sums differ, and with them what
  was trained."
    )
}

/// Learns the style of a landscape from one elevation model and turns drawn ridges and valleys into terrain.
#[derive(Parser)]
#[command(name = PROGRAM, version, max_term_width = 110, after_help = AFTER_HELP, after_long_help = after_long_help())]
struct CommandLine {
    #[command(flatten)]
    global: GlobalOptions,
    #[command(subcommand)]
    command: Command,
}

// No doc comment: clap would take it for the program's description.
#[derive(clap::Args)]
#[command(next_help_heading = "Global options")]
struct GlobalOptions {
    /// Threads to compute on; 0 takes all cores. Results do not depend on it
    #[arg(long, global = true, value_name = "N", default_value_t = 0,
          value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// The number from which everything random is drawn
    #[arg(long, global = true, value_name = "N", default_value_t = Seed::default().0)]
    seed: u64,
    /// Show no report, warning or progress; `info` and `completions` still print what they are asked for
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    // Verbs in the order of the help. A new verb `x` needs `mod x;` above, its variant here and its arm in `dispatch`.
    /// Run the whole path on the embedded terrain and write a report
    Demo(demo::DemoArgs),
    /// Find the ridges and valleys of terrain and write them as a sketch (GeoJSON)
    Extract(extract::ExtractArgs),
    /// Learn a style from one piece of terrain
    Train(train::TrainArgs),
    /// Complete sketches before they become terrain
    Sketch(sketch_fill::SketchArgs),
    /// Turn a sketch into terrain in a style
    Generate(generate::GenerateArgs),
    /// Make terrain finer, with a style's detail below its cells
    Amplify(amplify::AmplifyArgs),
    /// Draw terrain of a style from noise alone
    Sample(sample::SampleArgs),
    /// Terrain as a construction tree: fit it to terrain, edit it, draw it
    Tree(tree::TreeArgs),
    /// Rebuild patches of terrain from their lines with every system, and score them
    Eval(eval::EvalArgs),
    /// Run comparisons that are data files, and report their records
    Experiment(experiment::ExperimentArgs),
    /// Keep a manifest of terrain files
    Data(data::DataArgs),
    /// Draw terrain as a shaded relief picture (PNG), with a sketch over it if wanted
    Render(render::RenderArgs),
    /// Say what is in a terrain file, a sketch or a style
    Info(info::InfoArgs),
    /// Print the completions of a shell
    Completions(completions::CompletionsArgs),
}

/// What every verb gets beside its own arguments.
struct Context {
    /// Where everything is shown.
    console: Console,
    /// The seed of the whole run.
    seed: Seed,
    /// The systems that styles can be made of.
    registry: Registry,
    /// Raised by Ctrl-C, once a verb has asked for it.
    stop: OnceLock<Stop>,
}

impl Context {
    /// The flag that Ctrl-C raises: for verbs whose work polls it, and so ends in order. A second Ctrl-C ends the program at once,
    /// as the first one does for all other verbs.
    fn stop(&self) -> Stop {
        let install = || {
            let stop = Stop::new();
            let raised = stop.clone();
            // Without a handler Ctrl-C ends the program as it always did.
            let _ = ctrlc::set_handler(move || {
                if raised.is_raised() {
                    std::process::exit(i32::from(INTERRUPTED));
                }
                raised.raise();
            });
            stop
        };
        self.stop.get_or_init(install).clone()
    }
}

/// Does what the command line `args` (the program's name first) asks for; reports failures on standard error.
///
/// Sets the size of the global thread pool when `--threads` is given, which a process can do only once.
pub fn run(args: impl Iterator<Item = OsString>) -> ExitCode {
    run_with(Registry::default(), args)
}

/// As [`run`], with the systems of `registry`: a program of its own is the built-in systems and one more.
pub fn run_with(registry: Registry, args: impl Iterator<Item = OsString>) -> ExitCode {
    let line = match CommandLine::try_parse_from(args) {
        Ok(line) => line,
        Err(answer) => {
            // Help and version too; nobody is left to be told when this cannot be printed.
            let _ = answer.print();
            return ExitCode::from(if answer.use_stderr() { 2 } else { 0 });
        }
    };
    let console = Console::new(line.global.quiet);
    match prepare(&line.global, console, registry).and_then(|context| dispatch(&line.command, &context)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::print_error(&error);
            match error {
                Error::Stopped => ExitCode::from(INTERRUPTED),
                Error::Bound { .. } => ExitCode::from(BROKEN_BOUND),
                _ => ExitCode::FAILURE,
            }
        }
    }
}

fn prepare(options: &GlobalOptions, console: Console, registry: Registry) -> Result<Context> {
    VectorLevel::chosen()?;
    let asked = usize::from(options.threads);
    if asked > 0 {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(asked);
        pool.build_global().map_err(|e| Error::value("--threads", asked, format!("cannot be set: {e}")))?;
    }
    Ok(Context { console, seed: Seed(options.seed), registry, stop: OnceLock::new() })
}

fn dispatch(command: &Command, context: &Context) -> Result<()> {
    match command {
        Command::Demo(args) => demo::run(args, context),
        Command::Extract(args) => extract::run(args, context),
        Command::Train(args) => train::run(args, context),
        Command::Sketch(args) => sketch_fill::run(args, context),
        Command::Generate(args) => generate::run(args, context),
        Command::Amplify(args) => amplify::run(args, context),
        Command::Sample(args) => sample::run(args, context),
        Command::Tree(args) => tree::run(args, context),
        Command::Eval(args) => eval::run(args, context),
        Command::Experiment(args) => experiment::run(args, context),
        Command::Data(args) => data::run(args, context),
        Command::Render(args) => render::run(args, context),
        Command::Info(args) => info::run(args, context),
        Command::Completions(args) => completions::run(args, &mut CommandLine::command(), context),
    }?;
    context.console.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_has_examples() {
        let command = CommandLine::command();
        command.clone().debug_assert();
        for verb in command.get_subcommands() {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("monadnock {}", verb.get_name())), "{}", verb.get_name());
        }
    }
}
