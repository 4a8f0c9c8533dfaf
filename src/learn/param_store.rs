//! Trainable parameters in a fixed order, each drawn from a stream with its own name.

use crate::error::{Error, Result};
use crate::seed::Seed;
use candle_core::{Device, Shape, Tensor, Var};
use rand::RngExt;
use rand_distr::StandardNormal;

/// Named parameters in the order of their creation.
///
/// candle's own variable map is a hash map (no stable order) and its initialisation cannot be seeded; here every
/// parameter draws from `(seed, name)`, so adding one does not reshuffle the others.
#[derive(Debug)]
pub struct ParamStore {
    seed: Seed,
    entries: Vec<(String, Var)>,
}

impl ParamStore {
    /// An empty store whose parameters will draw from `seed`.
    #[must_use]
    pub(crate) fn new(seed: Seed) -> Self {
        Self { seed, entries: Vec::new() }
    }

    /// A parameter uniform in ±`bound`.
    ///
    /// # Errors
    /// When the tensor cannot be made.
    ///
    /// # Panics
    /// When the name is taken.
    pub(crate) fn uniform(&mut self, name: &str, shape: impl Into<Shape>, bound: f64) -> Result<Tensor> {
        let mut stream = self.seed.stream(name);
        self.insert(name, shape, || stream.random_range(-bound..=bound) as f32)
    }

    /// A parameter normal with mean 0 and the given standard deviation.
    ///
    /// # Errors
    /// When the tensor cannot be made.
    ///
    /// # Panics
    /// When the name is taken.
    pub(crate) fn normal(&mut self, name: &str, shape: impl Into<Shape>, deviation: f64) -> Result<Tensor> {
        let mut stream = self.seed.stream(name);
        self.insert(name, shape, || (stream.sample::<f64, _>(StandardNormal) * deviation) as f32)
    }

    /// A parameter with one value everywhere.
    ///
    /// # Errors
    /// When the tensor cannot be made.
    ///
    /// # Panics
    /// When the name is taken.
    pub(crate) fn constant(&mut self, name: &str, shape: impl Into<Shape>, value: f32) -> Result<Tensor> {
        self.insert(name, shape, || value)
    }

    fn insert(
        &mut self,
        name: &str,
        shape: impl Into<Shape>,
        mut draw: impl FnMut() -> f32,
    ) -> Result<Tensor> {
        assert!(self.entries.iter().all(|(n, _)| n != name), "parameter {name} exists");
        let shape = shape.into();
        let values: Vec<f32> = (0..shape.elem_count()).map(|_| draw()).collect();
        let var = Var::from_tensor(&Tensor::from_vec(values, shape, &Device::Cpu)?)?;
        let tensor = var.as_tensor().clone();
        self.entries.push((name.to_owned(), var));
        Ok(tensor)
    }

    /// Every parameter in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.entries.iter().map(|(name, var)| (name.as_str(), var))
    }

    /// A parameter by name.
    #[must_use]
    pub(crate) fn get(&self, name: &str) -> Option<&Tensor> {
        self.entries.iter().find(|(n, _)| n == name).map(|(_, var)| var.as_tensor())
    }

    /// Number of trainable values.
    #[must_use]
    pub(crate) fn value_count(&self) -> usize {
        self.entries.iter().map(|(_, var)| var.elem_count()).sum()
    }

    /// Overwrites a parameter.
    ///
    /// # Errors
    /// When there is no such parameter or the length differs.
    pub(crate) fn assign(&self, name: &str, values: &[f32]) -> Result<()> {
        let Some((_, var)) = self.entries.iter().find(|(n, _)| n == name) else {
            return Err(Error::value("parameter", name, "the model has no such parameter"));
        };
        if values.len() != var.elem_count() {
            let allowed = format!("the model needs {} ({:?})", var.elem_count(), var.dims());
            return Err(Error::value(format!("number of values of parameter {name}"), values.len(), allowed));
        }
        if let Some(bad) = values.iter().find(|v| !v.is_finite()) {
            return Err(Error::value(format!("parameter {name}"), bad, "allowed: finite values"));
        }
        var.set(&Tensor::from_slice(values, var.shape(), &Device::Cpu)?)?;
        Ok(())
    }

    /// The values of every parameter, in order.
    ///
    /// # Errors
    /// When a tensor cannot be read.
    pub fn snapshot(&self) -> Result<Vec<Vec<f32>>> {
        self.entries.iter().map(|(_, var)| Ok(var.flatten_all()?.to_vec1::<f32>()?)).collect()
    }

    /// Puts back what [`snapshot`](Self::snapshot) gave.
    ///
    /// # Errors
    /// When a length differs.
    pub(crate) fn restore(&self, snapshot: &[Vec<f32>]) -> Result<()> {
        for ((name, _), values) in self.entries.iter().zip(snapshot) {
            self.assign(name, values)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_does_not_depend_on_its_neighbours() {
        let mut alone = ParamStore::new(Seed(3));
        alone.uniform("b", (2, 3), 1.0).unwrap();
        let mut beside = ParamStore::new(Seed(3));
        beside.normal("a", 5, 1.0).unwrap();
        beside.uniform("b", (2, 3), 1.0).unwrap();
        assert_eq!(alone.snapshot().unwrap()[0], beside.snapshot().unwrap()[1]);
        assert_eq!(beside.value_count(), 11);
        assert!(alone.assign("b", &[0.0; 5]).unwrap_err().to_string().contains("5"));
        assert!(alone.assign("c", &[0.0; 6]).is_err());
        assert!(alone.assign("b", &[f32::NAN; 6]).is_err());
    }
}
