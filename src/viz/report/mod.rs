//! A report in one HTML file that needs nothing else: styles inlined, pictures as data, no script, no network.

mod builder;
mod figure;
mod markers;
mod table;

pub(crate) use builder::Report;
pub(crate) use figure::Figure;
pub(crate) use markers::{marked, spliced};
pub(crate) use table::{Best, Column, Entry, Table, Text};
