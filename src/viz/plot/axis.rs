//! From numbers to pixels, with round marks.

use crate::viz::ticks::{label, ticks};

/// An axis from `low` to `high` (in logarithms when `log`), laid over pixels `from` to `to`.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    log: bool,
    from: f64,
    to: f64,
}

impl Axis {
    /// An axis that holds all `values` (finite; positive when `log`) with a little air at both ends. One value alone,
    /// or none, gets an axis around it.
    pub(super) fn around(values: impl Iterator<Item = f64>, log: bool, from: f64, to: f64) -> Self {
        let values = values.map(|v| if log { v.log10() } else { v });
        let (mut low, mut high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if low == high {
            let air = if log || low == 0.0 { 0.5 } else { 0.05 * low.abs() };
            (low, high) = (low - air, high + air);
        }
        let air = 0.05 * (high - low);
        Self { low: low - air, high: high + air, log, from, to }
    }

    /// An axis that runs from the lowest to the highest value exactly, as time axes do.
    pub(super) fn exactly(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        if low < high {
            return Self { low, high, log: false, from, to };
        }
        Self::around(std::iter::once(low).filter(|v| v.is_finite()), false, from, to)
    }

    /// The pixel of a value.
    pub(super) fn at(&self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Marks: (pixel, label); about `most`.
    pub(super) fn marks(&self, most: usize) -> Vec<(f64, String)> {
        if !self.log {
            let (at, step) = ticks(self.low, self.high, most);
            return at.into_iter().map(|v| (self.at(v), label(v, step))).collect();
        }
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        // Few decades leave room for 2 and 5, many ask for every second or third power only.
        let decades = self.high - self.low;
        let factors: &[f64] = if decades < 1.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let stride = (decades / most as f64).ceil().max(1.0) as i32;
        let mut marks = Vec::new();
        for power in (first..=last).filter(|p| p.rem_euclid(stride) == 0) {
            for factor in factors {
                let value = factor * 10f64.powi(power);
                if (self.low..=self.high).contains(&value.log10()) {
                    marks.push((self.at(value), log_label(*factor, power)));
                }
            }
        }
        marks
    }
}

/// `factor` x 10^`power` as people write it.
fn log_label(factor: f64, power: i32) -> String {
    if (-4..=4).contains(&power) {
        return label(factor * 10f64.powi(power), 10f64.powi(power));
    }
    let digits: String = power
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '0' => '⁰',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '4' => '⁴',
            '5' => '⁵',
            '6' => '⁶',
            '7' => '⁷',
            '8' => '⁸',
            _ => '⁹',
        })
        .collect();
    if factor == 1.0 { format!("10{digits}") } else { format!("{factor}·10{digits}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_map_linearly_or_by_logarithm() {
        let axis = Axis::exactly([0.0, 100.0].into_iter(), 50.0, 250.0);
        assert_eq!((axis.at(0.0), axis.at(25.0), axis.at(100.0)), (50.0, 100.0, 250.0));
        let log = Axis::around([1e-4, 1.0].into_iter(), true, 0.0, 100.0);
        assert!((log.at(1e-2) - 50.0).abs() < 1e-9);
        assert!(log.at(1e-4) > 0.0 && log.at(1.0) < 100.0);
    }

    #[test]
    fn marks_lie_on_the_axis_and_are_written_as_people_do() {
        let names = |axis: &Axis| axis.marks(6).into_iter().map(|(_, name)| name).collect::<Vec<_>>();
        let log = Axis::around([2e-6, 30.0].into_iter(), true, 300.0, 0.0);
        assert_eq!(names(&log), ["10⁻⁶", "0.0001", "0.01", "1"]);
        for (at, _) in log.marks(6) {
            assert!((0.0..=300.0).contains(&at));
        }
        assert_eq!(names(&Axis::around([0.8, 4.0].into_iter(), true, 0.0, 1.0)), ["1", "2"]);
        assert_eq!(
            names(&Axis::exactly([0.0, 400.0].into_iter(), 0.0, 1.0)),
            ["0", "100", "200", "300", "400"]
        );
    }

    #[test]
    fn a_lone_value_still_has_an_axis() {
        for value in [0.0, -3.0, 1e9] {
            let axis = Axis::around(std::iter::once(value), false, 0.0, 10.0);
            assert!((axis.at(value) - 5.0).abs() < 1e-6);
        }
    }
}
