//! Where trainings are kept while they run: how far one has come, and its numbers by name, in one safetensors file.

use crate::arrays::Arrays;
use crate::error::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

const ALLOWED: &str = "allowed: a checkpoint written by `train`";

/// How far a training has come, its numbers apart.
pub(crate) trait Resumable: Serialize + DeserializeOwned {
    /// Key of the description in the file's metadata.
    const KEY: &'static str;
    /// What is trained, for messages.
    const TRAINING: &'static str;

    /// Says which training it is: a hash of all that decides it.
    fn identity(&self) -> &str;

    /// Writes the state of a training, all or nothing. `numbers`: values by name, each name once.
    ///
    /// # Errors
    /// When the file cannot be written.
    fn save<'a>(&self, path: &Path, numbers: impl IntoIterator<Item = (String, &'a [f32])>) -> Result<()> {
        let mut arrays = Arrays::default();
        numbers.into_iter().for_each(|(name, values)| arrays.put_f32(&name, &[values.len()], values));
        arrays.write(path, Self::KEY, serde_json::to_string(self).expect("progress is plain data"))
    }

    /// Reads the state of the training `identity`.
    ///
    /// # Errors
    /// When the file is damaged or belongs to another training.
    fn load(path: &Path, identity: &str) -> Result<(Self, Numbers)> {
        let (text, arrays) = Arrays::read(path, Self::KEY, "a checkpoint")?;
        let progress: Self = serde_json::from_str(&text)
            .map_err(|e| Error::file(path, format!("metadata {}", Self::KEY), e, ALLOWED))?;
        if progress.identity() != identity {
            let allowed = "to resume, exemplar, seed and configuration must be those of the interrupted training (how long and how \
                           fast it learns may differ); remove the file to begin anew";
            return Err(Error::file(path, Self::TRAINING, "another one", allowed));
        }
        Ok((progress, Numbers { path: path.to_owned(), arrays }))
    }
}

/// The numbers of a checkpoint that was read.
#[derive(Debug)]
pub(crate) struct Numbers {
    path: PathBuf,
    arrays: Arrays,
}

impl Numbers {
    /// Those of a name, which must be `count` finite ones.
    ///
    /// # Errors
    /// When they are missing or damaged.
    pub(crate) fn take(&mut self, name: &str, count: usize) -> Result<Vec<f32>> {
        let values = self.take_all(name);
        if values.len() != count || values.iter().any(|v| !v.is_finite()) {
            let found = format!("{} values", values.len());
            return Err(Error::file(&self.path, name, found, format!("allowed: {count} finite ones")));
        }
        Ok(values)
    }

    /// Those of a name, however many; none when they are missing.
    pub(crate) fn take_all(&mut self, name: &str) -> Vec<f32> {
        self.arrays.take_f32(name).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Steps {
        identity: String,
        done: usize,
    }

    impl Resumable for Steps {
        const KEY: &'static str = "steps";
        const TRAINING: &'static str = "training of steps";

        fn identity(&self) -> &str {
            &self.identity
        }
    }

    #[test]
    fn a_state_comes_back_and_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        let steps = Steps { identity: "this".to_owned(), done: 7 };
        let (few, bad) = ([1.5f32, -0.0, 1e-42], [f32::NAN]);
        steps.save(&path, [("few".to_owned(), &few[..]), ("bad".to_owned(), &bad[..])]).unwrap();
        let (read, mut numbers) = Steps::load(&path, "this").unwrap();
        assert_eq!(read, steps);
        let message = |found: Result<Vec<f32>>| found.unwrap_err().to_string();
        assert!(message(numbers.take("bad", 1)).contains("allowed: 1 finite"));
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&numbers.take("few", 3).unwrap()), bits(&few));
        assert!(message(numbers.take("few", 3)).contains("few is 0 values"));
        let other = Steps::load(&path, "that").unwrap_err().to_string();
        assert!(other.contains("training of steps is another one"), "{other}");
        std::fs::write(&path, b"no checkpoint").unwrap();
        assert!(Steps::load(&path, "this").unwrap_err().to_string().contains("kept"));
    }
}
