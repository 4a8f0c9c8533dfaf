//! `monadnock demo`: the whole path on the embedded terrain, ending in a report.

mod report;
mod results;
mod run;

pub(super) use run::{DemoArgs, run};
