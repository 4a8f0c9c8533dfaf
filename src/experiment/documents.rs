//! The findings of a record as Markdown, and their place in a document.
//!
//! A document marks the place with the lines `<!-- experiment NAME -->` and `<!-- /experiment NAME -->`; what stands between them
//! is written by [`splice`], never by hand. `NAME#1` stands for the first finding alone.

use super::protocol::Finding;
use super::protocols;
use super::record::Record;
use super::results::Results;
use crate::error::{Error, Result};
use crate::file;
use crate::viz::report::{marked, spliced};
use std::path::Path;

/// Documents are short.
const LARGEST: u64 = 1 << 24;

/// How findings are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// For documents.
    Markdown,
    /// For the terminal.
    Text,
}

/// What a record says, ending with the revision of the program.
///
/// # Errors
/// When the record is not finished or cannot be read.
pub(crate) fn of_record(record: &Record, form: Form) -> Result<String> {
    let revision = record.machine()?.revision;
    let revision = if revision.is_empty() { "an unknown revision" } else { &revision };
    let blocks = findings(record, form)?.into_iter().chain([format!("Revision {revision}.")]);
    Ok(blocks.map(|block| format!("{}\n", block.trim_end())).collect::<Vec<_>>().join("\n"))
}

fn findings(record: &Record, form: Form) -> Result<Vec<String>> {
    let (spec, scores) = (record.spec()?, record.scores()?);
    let findings = protocols::of(spec.kind).findings(&Results::new(&spec, &scores)?, record)?;
    let written = findings.into_iter().map(|finding| match (finding, form) {
        (Finding::Words(words), _) => words,
        (Finding::Table(table), Form::Markdown) => table.markdown(),
        (Finding::Table(table), Form::Text) => table.text(),
    });
    Ok(written.collect())
}

/// What belongs between the markers of `name`: everything, or the finding of the number after `#`.
///
/// # Errors
/// When the record cannot be read or has no such finding.
pub(crate) fn of_marker(record: &Record, name: &str) -> Result<String> {
    let Some((_, number)) = name.split_once('#') else { return of_record(record, Form::Markdown) };
    let findings = findings(record, Form::Markdown)?;
    let index = number.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    index.and_then(|index| findings.get(index).cloned()).ok_or_else(|| {
        Error::value(
            format!("finding of marker {name:?}"),
            number,
            format!("allowed: 1 to {}", findings.len()),
        )
    })
}

/// The experiment of a marker.
#[must_use]
pub(crate) fn experiment_of(name: &str) -> &str {
    name.split('#').next().unwrap_or(name)
}

/// The names of the experiments whose findings a document holds.
///
/// # Errors
/// When the file cannot be read, or a marker has no end.
pub(crate) fn markers(document: &Path) -> Result<Vec<String>> {
    let text = file::read_text(document, LARGEST)?;
    marked(&text).map_err(|e| e.in_file(document))
}

/// The experiments whose findings in a document are not what their records in the folder `records` say.
///
/// # Errors
/// When the document cannot be read or a marker has no end. A record that is not there makes its findings stale.
#[cfg(test)]
pub(crate) fn stale(document: &Path, records: &Path) -> Result<Vec<String>> {
    let text = file::read_text(document, LARGEST)?;
    let is_stale = |name: &String| {
        let content = of_marker(&Record::new(&records.join(experiment_of(name))), name).ok();
        content.is_none_or(|content| spliced(&text, name, &content).map_or(true, |new| new != text))
    };
    Ok(markers(document)?.into_iter().filter(is_stale).collect())
}

/// Puts `content` between the markers of `name`; tells whether that changed the document.
///
/// # Errors
/// When the document has no such markers, or cannot be read or written.
pub(crate) fn splice(document: &Path, name: &str, content: &str) -> Result<bool> {
    let text = file::read_text(document, LARGEST)?;
    let spliced = spliced(&text, name, content).map_err(|e| e.in_file(document))?;
    if spliced != text {
        file::write_bytes(document, spliced.as_bytes())?;
    }
    Ok(spliced != text)
}
