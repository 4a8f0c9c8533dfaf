//! The one error type: every variant names what was wrong, the value that was found and what is allowed.

use std::path::{Path, PathBuf};

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that bad input can cause. A broken invariant of our own is a panic instead, documented where it can happen.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused to read or write a file.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, as a verb phrase ("read the header").
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A file's content is not what its format allows.
    #[error("{}: {field} is {value}; {allowed}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The part of the file ("image width", "feature 3, vertex 2").
        field: String,
        /// The value that was found.
        value: String,
        /// What is allowed there, as a phrase ("allowed: 1 to 65536").
        allowed: String,
    },
    /// A value handed to the library or given on the command line is out of range.
    #[error("{name} is {value}; {allowed}")]
    Value {
        /// The parameter, option or field.
        name: String,
        /// The value that was found.
        value: String,
        /// What is allowed, as a phrase.
        allowed: String,
    },
    /// Training left the finite numbers, or every height that terrain could have.
    #[error("training diverged at epoch {epoch}: {what} is {value}; try a lower learning rate")]
    Diverged {
        /// The epoch, counted from 0.
        epoch: usize,
        /// The quantity that is no longer in order.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// What was made breaks a bound that the user gave; it is written all the same.
    #[error("{}: {broken}", path.display())]
    Bound {
        /// The file.
        path: PathBuf,
        /// The broken bounds, in whole sentences.
        broken: String,
    },
    /// The work was asked to end ([`Stop`](crate::control::Stop)); nothing was written.
    #[error("stopped")]
    Stopped,
    /// The tensor library failed (out of memory, or a bug of ours: shapes are checked before).
    #[error("tensor computation failed: {0}")]
    Tensor(#[source] TensorError),
}

/// What the tensor library says.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct TensorError(candle_core::Error);

#[doc(hidden)]
impl From<candle_core::Error> for Error {
    fn from(error: candle_core::Error) -> Self {
        Self::Tensor(TensorError(error))
    }
}

impl Error {
    /// A [`Error::File`] from displayable parts.
    pub(crate) fn file(
        path: &Path,
        field: impl Into<String>,
        value: impl std::fmt::Display,
        allowed: impl Into<String>,
    ) -> Self {
        Self::File {
            path: path.to_owned(),
            field: field.into(),
            value: value.to_string(),
            allowed: allowed.into(),
        }
    }

    /// A [`Error::Value`] from displayable parts.
    pub fn value(name: impl Into<String>, value: impl std::fmt::Display, allowed: impl Into<String>) -> Self {
        Self::Value { name: name.into(), value: value.to_string(), allowed: allowed.into() }
    }

    /// Returns a closure for `map_err` that names the file and the action.
    pub(crate) fn io<'a>(path: &'a Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self + 'a {
        move |source| Self::Io { path: path.to_owned(), action, source }
    }

    /// The same [`Error::Value`] under another name, so that it says which entry of a list it is about.
    #[must_use]
    pub(crate) fn renamed(self, rename: impl FnOnce(&str) -> String) -> Self {
        match self {
            Self::Value { name, value, allowed } => Self::Value { name: rename(&name), value, allowed },
            other => other,
        }
    }

    /// Attaches a file to an [`Error::Value`], so that an error found after reading still names its file.
    #[must_use]
    pub fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Value { name, value, allowed } => {
                Self::File { path: path.to_owned(), field: name, value, allowed }
            }
            other => other,
        }
    }
}
