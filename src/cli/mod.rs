//! The command line: one file a verb. Only this room prints.

mod args;
mod completions;
mod console;
mod demo;
mod eval;
mod extract;
mod generate;
mod info;
mod render;
mod start;
mod train;

pub use start::run;
