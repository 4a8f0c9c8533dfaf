//! Scores over many patches.

use super::Scores;

/// Mean and sample standard deviation (n - 1; 0 for a single value).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stat {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub(crate) sd: f64,
    /// How many values.
    pub(crate) n: usize,
}

impl Stat {
    /// Of at least one value.
    #[must_use]
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().collect();
        let n = values.len();
        if n == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        Some(Self { mean, sd: if n > 1 { (squares / (n - 1) as f64).sqrt() } else { 0.0 }, n })
    }
}

/// Mean and standard deviation of one score.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Name of the score, as in [`Scores::values`].
    pub name: String,
    /// Mean over the patches that count.
    pub mean: f64,
    /// Sample standard deviation (n - 1) over them; 0 for a single one.
    pub sd: f64,
    /// How many patches count: those that have this score, and a finite one (a perfect copy has no finite PSNR).
    pub count: usize,
}

/// Mean and standard deviation of every score over patches.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// Number of patches.
    pub patches: usize,
    /// One entry per score, in the order of [`Scores::values`]; scores that no patch has are left out.
    pub spreads: Vec<Spread>,
}

impl Summary {
    /// Summarises any number of patches.
    #[must_use]
    pub fn of(scores: &[Scores]) -> Self {
        let rows: Vec<_> = scores.iter().map(Scores::values).collect();
        let names = rows.first().into_iter().flatten().map(|value| value.0);
        let spreads = names.enumerate().filter_map(|(i, name)| {
            let values = rows.iter().filter_map(|row| row[i].1);
            let Stat { mean, sd, n: count } = Stat::of(values.filter(|value| value.is_finite()))?;
            Some(Spread { name: name.to_owned(), mean, sd, count })
        });
        Self { patches: scores.len(), spreads: spreads.collect() }
    }

    /// The entry of one score, by its name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Spread> {
        self.spreads.iter().find(|spread| spread.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use crate::sketch::LineMap;

    #[test]
    fn means_and_deviations_are_those_of_the_patches() {
        let truth = Grid::from_fn(16, 16, |c| (c.row * c.col) as f32 / 225.0);
        let valid = truth.map(|_| true);
        let score = |gain: f32| {
            Scores::of(&truth.map(|z| gain * z), &truth, &valid, &LineMap::empty(16, 16)).unwrap()
        };
        let summary = Summary::of(&[score(1.0), score(0.9), score(0.8)]);
        assert_eq!(summary.patches, 3);
        let slope = summary.get("mean_slope_ratio").unwrap();
        assert!((slope.mean - 0.9).abs() < 1e-6 && (slope.sd - 0.1).abs() < 1e-6 && slope.count == 3);
        assert_eq!(summary.get("psnr").unwrap().count, 2, "the copy's is infinite");
        assert!(summary.get("ridge_f1").is_none());
        assert_eq!(Summary::of(&[]), Summary::default());
        let json = serde_json::to_string(&summary).unwrap();
        assert_eq!(serde_json::from_str::<Summary>(&json).unwrap(), summary);
    }
}
