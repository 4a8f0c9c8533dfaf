//! As `neighbours`, with variations of one style against a baseline.

use super::general;
use crate::error::Result;
use crate::experiment::protocol::check;
use crate::experiment::protocol::{Finding, Protocol};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::ExperimentSpec;

pub(super) struct Ablation;

impl Protocol for Ablation {
    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        let found = spec.style.len();
        check(found > 1, "number of styles", found, "an ablation compares at least 2")
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok(general::beside_baseline(results))
    }
}
