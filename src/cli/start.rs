//! Parses the arguments, sets up threads and seed, runs a verb, prints the error.

use super::console::{Console, Context};
use super::{completions, demo, eval, extract, generate, info, render, train};
use crate::error::{Error, Result};
use crate::seed::Seed;
use clap::{CommandFactory, Parser, Subcommand};
use std::ffi::OsString;
use std::process::ExitCode;

/// Learns the style of a landscape from one digital elevation model (DEM) and turns drawn ridges and valleys into new
/// terrain in that style.
#[derive(Debug, Parser)]
#[command(name = "monadnock", version, max_term_width = 110)]
#[command(after_help = "Start with:
  monadnock demo --quick

Exit codes: 0 done, 1 failed (the message names the file, the value and what is allowed), 2 wrong usage.")]
pub(super) struct Cli {
    /// Threads to use; 0 for all cores
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    threads: usize,
    /// Seed of every random stream: the same seed gives the same bytes on any number of threads
    #[arg(long, global = true, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Print nothing but errors and warnings
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run the whole path on the embedded terrain and write a report
    Demo(demo::DemoArgs),
    /// Extract ridges and valleys of a DEM as a sketch
    Extract(extract::ExtractArgs),
    /// Learn a style from one piece of a DEM
    Train(train::TrainArgs),
    /// Turn a sketch into terrain in a style
    Generate(generate::GenerateArgs),
    /// Rebuild patches of a DEM from their lines with every system, and score them
    Eval(eval::EvalArgs),
    /// Draw a DEM as shaded relief, with a sketch if wanted
    Render(render::RenderArgs),
    /// Say what is in a DEM, a sketch or a style
    Info(info::InfoArgs),
    /// Print completions for a shell
    Completions(completions::CompletionsArgs),
}

/// Most threads that can be asked for.
const MOST_THREADS: usize = 1024;

/// Runs the program with these arguments, the first being its name.
pub fn run(args: impl Iterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are printed to standard output and are no failure. A closed pipe is none either.
            let _ = error.print();
            return ExitCode::from(error.exit_code() as u8);
        }
    };
    let console = Console::new(cli.quiet);
    match cli.start(&console) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console.error(&error);
            ExitCode::FAILURE
        }
    }
}

impl Cli {
    fn start(self, console: &Console) -> Result<()> {
        if self.threads > MOST_THREADS {
            return Err(Error::value("--threads", self.threads, format!("allowed: 0 to {MOST_THREADS}")));
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build_global()
            .map_err(|e| Error::value("--threads", self.threads, e.to_string()))?;
        let context = Context { console: console.clone(), seed: Seed(self.seed) };
        match &self.verb {
            Verb::Demo(args) => demo::run(args, &context),
            Verb::Extract(args) => extract::run(args, &context),
            Verb::Train(args) => train::run(args, &context),
            Verb::Generate(args) => generate::run(args, &context),
            Verb::Eval(args) => eval::run(args, &context),
            Verb::Render(args) => render::run(args, &context),
            Verb::Info(args) => info::run(args, &context),
            Verb::Completions(args) => completions::run(args, Cli::command(), &context),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent_and_every_verb_has_examples() {
        let command = Cli::command();
        command.clone().debug_assert();
        for verb in command.get_subcommands() {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("monadnock {}", verb.get_name())), "{}", verb.get_name());
        }
    }
}
