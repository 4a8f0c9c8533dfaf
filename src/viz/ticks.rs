//! Round numbers for axes, colour bars and scale bars.

/// The smallest of 1, 2, 5 times a power of ten that is at least `x`.
///
/// # Panics
/// When `x` is not positive and finite.
pub(super) fn round_up(x: f64) -> f64 {
    assert!(x.is_finite() && x > 0.0, "{x} cannot be rounded to 1, 2 or 5");
    let power = 10f64.powi(x.log10().floor() as i32);
    // The slack lets 0.2 (which is 0.2000...01 / 0.1 = 2.0000...01) stay itself.
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= x * (1.0 - 1e-9)).unwrap_or(10.0);
    factor * power
}

/// Multiples of a round step in `low` to `high` (`low < high`), at most `most` + 1 of them, and the step.
pub(super) fn ticks(low: f64, high: f64, most: usize) -> (Vec<f64>, f64) {
    let step = round_up((high - low) / most.max(1) as f64);
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    ((first..=last).map(|i| i as f64 * step).collect(), step)
}

/// A number with the decimals that steps of `step` need, and a true minus sign.
pub(super) fn label(value: f64, step: f64) -> String {
    let decimals = (-(step * 1.000_001).log10().floor()).max(0.0) as usize;
    number(value, decimals)
}

/// A number with `decimals` decimals and a true minus sign; no minus on a rounded zero.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let zero = text.bytes().all(|b| b == b'0' || b == b'.');
    if value < 0.0 && !zero { format!("\u{2212}{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_goes_up_to_the_next_of_the_series() {
        for (x, expected) in [(1.0, 1.0), (1.1, 2.0), (0.021, 0.05), (0.2, 0.2), (51.0, 100.0), (7e8, 1e9)] {
            assert!((round_up(x) / expected - 1.0).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn ticks_lie_inside_and_have_short_labels() {
        let (at, step) = ticks(455.0, 4810.0, 5);
        assert_eq!(at, [1000.0, 2000.0, 3000.0, 4000.0]);
        assert_eq!(label(at[0], step), "1000");
        let (at, step) = ticks(-0.31, 0.3, 6);
        let labels: Vec<String> = at.iter().map(|&v| label(v, step)).collect();
        assert_eq!(labels, ["−0.2", "0.0", "0.2"]);
        assert_eq!(number(-0.001, 2), "0.00");
    }
}
