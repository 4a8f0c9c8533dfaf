//! A report in one HTML file that needs nothing else: styles inlined, pictures as data, no script, no network.

mod builder;
mod figure;
mod markers;
mod table;

pub use builder::Report;
pub use figure::{Drawing, Figure};
pub(crate) use markers::{marked, spliced};
pub use table::{Best, Column, Entry, Table, Text};
