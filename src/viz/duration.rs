//! Durations for people.

use std::time::Duration;

/// A duration as it is read, rounded to what matters: "4ms", "8s 300ms", "2m 5s", "1h 2m".
pub(crate) fn duration(time: Duration) -> humantime::FormattedDuration {
    let seconds = time.as_secs_f64();
    // Three figures of what is short, whole seconds of minutes, whole minutes of hours.
    let unit = match seconds {
        s if s < 0.01 => 1e-4,
        s if s < 0.9995 => 1e-3,
        s if s < 59.95 => 0.1,
        s if s < 3599.5 => 1.0,
        _ => 60.0,
    };
    humantime::format_duration(Duration::from_secs_f64((seconds / unit).round() * unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_rounded_to_what_matters() {
        let cases = [
            (0.00421, "4ms 200us"),
            (0.3504, "350ms"),
            (1.0, "1s"),
            (8.31, "8s 300ms"),
            (59.96, "1m"),
            (125.2, "2m 5s"),
            (3725.0, "1h 2m"),
        ];
        for (seconds, words) in cases {
            assert_eq!(duration(Duration::from_secs_f64(seconds)).to_string(), words);
        }
    }
}
