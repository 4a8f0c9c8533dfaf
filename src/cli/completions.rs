//! `monadnock completions`: what a shell needs to complete our arguments.

use super::console::Context;
use crate::error::Result;

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock completions bash > ~/.local/share/bash-completion/completions/monadnock
  monadnock completions fish > ~/.config/fish/completions/monadnock.fish")]
pub(super) struct CompletionsArgs {
    /// The shell
    shell: clap_complete::Shell,
}

/// Runs the verb.
pub(super) fn run(args: &CompletionsArgs, mut command: clap::Command, context: &Context) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "monadnock", &mut text);
    context.console.output(String::from_utf8_lossy(&text).trim_end());
    Ok(())
}
