//! Places in a document that are written by the program: between the lines `<!-- experiment NAME -->` and `<!-- /experiment NAME -->`.

use crate::error::{Error, Result};

/// The names of the marked places, in their order.
///
/// # Errors
/// When a marker has no end.
pub(crate) fn marked(text: &str) -> Result<Vec<String>> {
    let names =
        text.lines().filter_map(|line| line.trim().strip_prefix("<!-- experiment ")?.strip_suffix(" -->"));
    let is_closed = |name: &str| {
        let found = format!("{name:?} without an end");
        let error = || Error::value("marker", found, format!("allowed: {} after it", end(name)));
        between(text, name).map(|_| name.to_owned()).ok_or_else(error)
    };
    names.map(is_closed).collect()
}

/// The text with `content` at the marked place.
///
/// # Errors
/// When there is no such place.
pub(crate) fn spliced(text: &str, name: &str, content: &str) -> Result<String> {
    let allowed = || format!("allowed: a document with the lines {} and {}", begin(name), end(name));
    let (start, stop) = between(text, name).ok_or_else(|| Error::value("marker", "missing", allowed()))?;
    Ok(format!("{}\n{}\n\n{}", &text[..start], content.trim_end(), &text[stop..]))
}

fn begin(name: &str) -> String {
    format!("<!-- experiment {name} -->")
}

fn end(name: &str) -> String {
    format!("<!-- /experiment {name} -->")
}

/// Bytes between the end of the first marker's line and the second marker.
fn between(text: &str, name: &str) -> Option<(usize, usize)> {
    let start = text.find(&begin(name))? + begin(name).len();
    let start = start + text[start..].find('\n')? + 1;
    let stop = start + text[start..].find(&end(name))?;
    Some((start, stop))
}
