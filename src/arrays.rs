//! Named arrays of numbers with a description: what trained things are stored as, in one safetensors file.
//!
//! [`Arrays`] holds them in memory; [`Arrays::write`] and [`Arrays::read`] are the file. Whoever reads takes the arrays that it
//! knows by name, type and length; what is left at the end is an error ([`Arrays::finish`]).

use crate::error::{Error, Result};
use crate::file;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// No style or checkpoint comes near this size; a larger file is something else.
const LARGEST_FILE: u64 = 1 << 30;

/// Arrays by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrays(BTreeMap<String, Array>);

/// Numbers as they are stored, little-endian.
#[derive(Clone, Debug, PartialEq)]
struct Array {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Arrays {
    /// Adds numbers of a shape under a name.
    ///
    /// # Panics
    /// When the name is taken, or the shape has another number of values.
    pub fn put_f32(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        self.put(name, Dtype::F32, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    /// Adds whole numbers, as [`put_f32`](Self::put_f32).
    ///
    /// # Panics
    /// As there.
    pub(crate) fn put_u32(&mut self, name: &str, shape: &[usize], values: &[u32]) {
        self.put(name, Dtype::U32, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    /// Adds bytes, as [`put_f32`](Self::put_f32).
    ///
    /// # Panics
    /// As there.
    pub(crate) fn put_u8(&mut self, name: &str, shape: &[usize], values: &[u8]) {
        self.put(name, Dtype::U8, shape, values.to_vec());
    }

    fn put(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: Vec<u8>) {
        let count: usize = shape.iter().product();
        assert_eq!(count * dtype.bitsize() / 8, bytes.len(), "{name}: the values fill the shape");
        let array = Array { dtype, shape: shape.to_vec(), bytes };
        assert!(self.0.insert(name.to_owned(), array).is_none(), "array {name} exists");
    }

    /// Takes the numbers of a name, however many.
    ///
    /// # Errors
    /// When they are missing or of another type.
    pub fn take_f32(&mut self, name: &str) -> Result<Vec<f32>> {
        let bytes = self.take(name, Dtype::F32)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
    }

    /// Takes whole numbers, as [`take_f32`](Self::take_f32).
    ///
    /// # Errors
    /// As there.
    pub(crate) fn take_u32(&mut self, name: &str) -> Result<Vec<u32>> {
        let bytes = self.take(name, Dtype::U32)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
    }

    /// Takes bytes, as [`take_f32`](Self::take_f32).
    ///
    /// # Errors
    /// As there.
    pub(crate) fn take_u8(&mut self, name: &str) -> Result<Vec<u8>> {
        self.take(name, Dtype::U8)
    }

    fn take(&mut self, name: &str, dtype: Dtype) -> Result<Vec<u8>> {
        let field = format!("tensor {name}");
        let Some(array) = self.0.remove(name) else {
            return Err(Error::value(field, "missing", "the description asks for it"));
        };
        if array.dtype != dtype {
            let allowed = format!("allowed: {dtype:?}");
            return Err(Error::value(format!("type of {field}"), format!("{:?}", array.dtype), allowed));
        }
        Ok(array.bytes)
    }

    /// Adds all of `part`, `prefix` before its names.
    ///
    /// # Panics
    /// When a name is taken.
    pub(crate) fn put_all(&mut self, prefix: &str, part: Self) {
        for (name, array) in part.0 {
            let name = format!("{prefix}{name}");
            assert!(!self.0.contains_key(&name), "array {name} exists");
            self.0.insert(name, array);
        }
    }

    /// Takes all whose names begin with `prefix`, without it.
    #[must_use]
    pub(crate) fn take_all(&mut self, prefix: &str) -> Self {
        let all = std::mem::take(&mut self.0);
        let mut part = Self::default();
        for (name, array) in all {
            match name.strip_prefix(prefix) {
                Some(rest) => part.0.insert(rest.to_owned(), array),
                None => self.0.insert(name, array),
            };
        }
        part
    }

    /// Refuses arrays that nobody took.
    ///
    /// # Errors
    /// Names the first of them.
    pub(crate) fn finish(self) -> Result<()> {
        match self.0.keys().next() {
            None => Ok(()),
            Some(name) => Err(Error::value("tensor", name, "the description knows no such tensor")),
        }
    }

    /// Writes the arrays and a description under `key`, all or nothing.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// Never: lengths fit by construction.
    pub(crate) fn write(&self, path: &Path, key: &str, description: String) -> Result<()> {
        let views = self.0.iter().map(|(name, array)| {
            let view = TensorView::new(array.dtype, array.shape.clone(), &array.bytes);
            (name.as_str(), view.expect("the length fits the shape"))
        });
        // One key only: the order of several would not be the same in every run.
        let metadata = HashMap::from([(key.to_owned(), description)]);
        let bytes = safetensors::serialize(views, Some(metadata)).expect("names are unique");
        file::write_bytes(path, &bytes)
    }

    /// Reads the arrays of a file and its description under `key`. `what` names files of this kind, for messages.
    ///
    /// # Errors
    /// When the file is damaged, too large, or without such a description.
    pub(crate) fn read(path: &Path, key: &str, what: &str) -> Result<(String, Self)> {
        let allowed = || format!("allowed: {what} written by `train`");
        let damaged = |e: safetensors::SafeTensorError| Error::file(path, "safetensors header", e, allowed());
        let bytes = file::read_whole(path, LARGEST_FILE)?;
        let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(damaged)?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(damaged)?;
        let Some(text) = metadata.metadata().as_ref().and_then(|m| m.get(key)) else {
            let found = format!("without the key \"{key}\"");
            return Err(Error::file(path, "metadata", found, allowed()));
        };
        let array = |view: TensorView<'_>| Array {
            dtype: view.dtype(),
            shape: view.shape().to_vec(),
            bytes: view.data().to_vec(),
        };
        let all = tensors.iter().map(|(name, view)| (name.to_owned(), array(view))).collect();
        Ok((text.clone(), Self(all)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_from_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        let (mut part, mut all) = (Arrays::default(), Arrays::default());
        part.put_f32("few", &[3], &[1.5, -0.0, 1e-42]);
        part.put_u32("whole", &[2, 1], &[7, u32::MAX]);
        all.put_u8("bytes", &[1], &[9]);
        all.put_all("part.", part.clone());
        all.write(&path, "key", "text".to_owned()).unwrap();
        let (text, mut read) = Arrays::read(&path, "key", "a test").unwrap();
        assert_eq!((text.as_str(), &read), ("text", &all));
        let mut again = read.take_all("part.");
        assert_eq!(again, part);
        let bits = |values: Vec<f32>| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(again.take_f32("few").unwrap()), bits(vec![1.5, -0.0, 1e-42]));
        assert!(again.take_f32("few").unwrap_err().to_string().contains("tensor few is missing"));
        assert!(again.take_f32("whole").unwrap_err().to_string().contains("U32"));
        again.finish().unwrap();
        assert!(read.finish().unwrap_err().to_string().contains("bytes"));
        assert!(Arrays::read(&path, "other", "a test").unwrap_err().to_string().contains("a test"));
        std::fs::write(&path, b"torn").unwrap();
        assert!(Arrays::read(&path, "key", "a test").unwrap_err().to_string().contains("kept"));
    }
}
