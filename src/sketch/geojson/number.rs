//! Numbers as they stand in sketches: JSON numbers, and text with or without a unit of length.

use serde_json::Value;

/// A number, with the metres in its unit where it names one ("2500 ft").
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number {
    pub(super) value: f64,
    pub(super) metres_per_unit: Option<f64>,
}

/// Text that drawing programs and tables write where there is no number.
const BLANK: [&str; 4] = ["", "nan", "null", "none"];

/// The number in `value`; `Ok(None)` for one that is left blank, and `Err` for what is no finite number.
pub(super) fn number(value: &Value) -> Result<Option<Number>, ()> {
    match value {
        Value::Null => Ok(None),
        Value::Number(number) => {
            let value = number.as_f64().filter(|v| v.is_finite()).ok_or(())?;
            Ok(Some(Number { value, metres_per_unit: None }))
        }
        Value::String(text) => number_in(text),
        _ => Err(()),
    }
}

fn number_in(text: &str) -> Result<Option<Number>, ()> {
    let text = text.trim().replace('\u{2212}', "-"); // the minus sign of typesetters
    if BLANK.contains(&text.to_ascii_lowercase().as_str()) {
        return Ok(None);
    }
    // The longest beginning that is a number: "2500e" is none, "2500ft" is one and a unit.
    let is_part = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let longest = text.find(|c| !is_part(c)).unwrap_or(text.len());
    let digits = text[..longest].trim_end_matches(['e', 'E']);
    let value: f64 = digits.parse().map_err(|_| ())?;
    let unit = text[digits.len()..].trim();
    let metres_per_unit = if unit.is_empty() { None } else { Some(metres_per(unit).ok_or(())?) };
    if value.is_finite() { Ok(Some(Number { value, metres_per_unit })) } else { Err(()) }
}

/// Metres in a unit of length, by its name in English or its symbol; case does not count.
pub(super) fn metres_per(unit: &str) -> Option<f64> {
    let plain: String =
        unit.to_ascii_lowercase().chars().filter(|c| !matches!(c, ' ' | '_' | '-' | '.')).collect();
    Some(match plain.as_str() {
        "m" | "metre" | "metres" | "meter" | "meters" | "masl" => 1.0,
        "ft" | "foot" | "feet" | "'" | "intft" | "internationalfoot" | "internationalfeet" => 0.3048,
        "usft" | "ftus" | "ussurveyfoot" | "ussurveyfeet" | "surveyfoot" | "surveyfeet" => 1200.0 / 3937.0,
        "km" | "kilometre" | "kilometres" | "kilometer" | "kilometers" => 1000.0,
        _ => return None,
    })
}

/// A value fit to be shown in a message; text keeps its quotes, so that "2500" is told from 2500.
pub(super) fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = value.to_string();
    if text.chars().count() <= LONGEST {
        text
    } else {
        text.chars().take(LONGEST).chain("...".chars()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_are_read_as_people_write_them() {
        let plain = |v: f64| Ok(Some(Number { value: v, metres_per_unit: None }));
        let with = |v: f64, unit: f64| Ok(Some(Number { value: v, metres_per_unit: Some(unit) }));
        for (value, expected) in [
            (json!(2500), plain(2500.0)),
            (json!("2500"), plain(2500.0)),
            (json!(" -12.5 "), plain(-12.5)),
            (json!("\u{2212}3"), plain(-3.0)),
            (json!("1e3"), plain(1000.0)),
            (json!("2500 m"), with(2500.0, 1.0)),
            (json!("2500m"), with(2500.0, 1.0)),
            (json!("2500 m a.s.l."), with(2500.0, 1.0)),
            (json!("8202.1 ft"), with(8202.1, 0.3048)),
            (json!("8202 Feet"), with(8202.0, 0.3048)),
            (json!("100 US survey feet"), with(100.0, 1200.0 / 3937.0)),
            (json!("1.5 km"), with(1.5, 1000.0)),
            (json!(null), Ok(None)),
            (json!(""), Ok(None)),
            (json!(" NaN "), Ok(None)),
        ] {
            assert_eq!(number(&value), expected, "{value}");
        }
        for bad in [
            json!("high"),
            json!("2,500"),
            json!("2 500"),
            json!("2500 fathoms"),
            json!("1e999"),
            json!("inf"),
            json!("m"),
            json!(true),
            json!([1]),
            json!({}),
        ] {
            assert_eq!(number(&bad), Err(()), "{bad}");
        }
    }
}
