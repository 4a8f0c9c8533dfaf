//! l_further: the influence of a line fades with the square of the distance.

/// Mean over samples of (|y - far| - 1 / (10 d^2))^2, with its gradients by `y` and by `far`, both times `weight`.
///
/// `y`: heights of the sampled cells; `far`: what the network gives them without any line (MLP_3 of the first state);
/// `distances`: to the nearest part, in cells.
///
/// # Panics
/// When the lengths differ.
#[must_use]
pub(crate) fn further(y: &[f64], far: &[f64], distances: &[f64], weight: f64) -> (f64, Vec<f64>, Vec<f64>) {
    assert!(y.len() == far.len() && y.len() == distances.len(), "one far height and distance a sample");
    let n = y.len().max(1) as f64;
    let mut sum = 0.0;
    let by_y: Vec<f64> = y
        .iter()
        .zip(far)
        .zip(distances)
        .map(|((y, far), d)| {
            let offset = (y - far).abs() - 1.0 / (10.0 * d * d);
            sum += offset * offset;
            weight * 2.0 * offset * (y - far).signum() / n
        })
        .collect();
    let by_far = by_y.iter().map(|g| -g).collect();
    (sum / n, by_y, by_far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_equal_finite_differences() {
        let (y, far, d) = ([0.4, 0.6, 0.5], [0.5, 0.5, 0.45], [7.0, 8.0, 20.0]);
        let (_, by_y, by_far) = further(&y, &far, &d, 1.0);
        for i in 0..3 {
            let at = |dy: f64, df: f64| {
                let (mut y, mut far) = (y, far);
                y[i] += dy;
                far[i] += df;
                further(&y, &far, &d, 1.0).0
            };
            let h = 1e-6;
            assert!(((at(h, 0.0) - at(-h, 0.0)) / (2.0 * h) - by_y[i]).abs() < 1e-8);
            assert!(((at(0.0, h) - at(0.0, -h)) / (2.0 * h) - by_far[i]).abs() < 1e-8);
        }
        assert!((further(&[0.501], &[0.5], &[10.0], 1.0).0).abs() < 1e-12);
    }
}
