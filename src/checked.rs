//! Settings that have been checked, as a type: what takes a [`Checked`] need not check, and nobody can forget to.

use crate::error::Result;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt::Debug;
use std::ops::Deref;

/// Settings of something: plain data whose `Default` is the best that we know.
pub trait Settings:
    Clone + Debug + Default + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Checks every field against its range.
    ///
    /// # Errors
    /// Names the first field that is out of range.
    fn validate(&self) -> Result<()>;
}

/// Settings in their ranges.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Checked<C>(C);

impl<C: Settings> Checked<C> {
    /// Checks the settings.
    ///
    /// # Errors
    /// As [`Settings::validate`].
    pub(crate) fn new(settings: C) -> Result<Self> {
        settings.validate()?;
        Ok(Self(settings))
    }

    /// The settings, to be changed and checked again.
    #[must_use]
    pub(crate) fn into_inner(self) -> C {
        self.0
    }
}

impl<C> Deref for Checked<C> {
    type Target = C;

    fn deref(&self) -> &C {
        &self.0
    }
}

impl<'de, C: Settings> Deserialize<'de> for Checked<C> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(C::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    struct Width {
        width: usize,
    }

    impl Settings for Width {
        fn validate(&self) -> Result<()> {
            if self.width < 9 { Ok(()) } else { Err(Error::value("width", self.width, "allowed: 0 to 8")) }
        }
    }

    #[test]
    fn settings_out_of_range_are_not_read_and_not_made() {
        assert_eq!(serde_json::from_str::<Checked<Width>>(r#"{"width": 3}"#).unwrap().width, 3);
        let refused = serde_json::from_str::<Checked<Width>>(r#"{"width": 9}"#).unwrap_err().to_string();
        assert!(refused.contains("width is 9"), "{refused}");
        assert!(Checked::new(Width { width: 9 }).is_err());
    }
}
