//! The command line: parse, call, print the error.

fn main() {}
