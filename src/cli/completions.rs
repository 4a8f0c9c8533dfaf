//! `completions`: prints what a shell needs to complete our command lines.

use super::Context;
use crate::error::Result;
use clap_complete::Shell;

const EXAMPLES: &str = "\
Examples:
  monadnock completions bash > ~/.local/share/bash-completion/completions/monadnock
  monadnock completions zsh > ~/.zfunc/_monadnock
  monadnock completions fish > ~/.config/fish/completions/monadnock.fish";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

pub(super) fn run(args: &CompletionsArgs, command: &mut clap::Command, context: &Context) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, command, super::PROGRAM, &mut script);
    context.console.result(String::from_utf8_lossy(&script));
    Ok(())
}
