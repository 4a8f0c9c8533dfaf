//! Linear units, by EPSG code and by the words that files use.

/// A linear unit: EPSG code, metres, name.
type Unit = (u16, f64, &'static str);

/// The linear units of the EPSG dataset, as PROJ 9.5 lists them.
const UNITS: [Unit; 47] = [
    (1025, 0.001, "millimetre"),
    (1033, 0.01, "centimetre"),
    (9001, 1.0, "metre"),
    (9002, 0.3048, "foot"),
    (9003, 1200.0 / 3937.0, "US survey foot"),
    (9005, 0.3047972654, "Clarke's foot"),
    (9014, 1.8288, "fathom"),
    (9030, 1852.0, "nautical mile"),
    (9031, 1.0000135965, "German legal metre"),
    (9033, 66.0 * 1200.0 / 3937.0, "US survey chain"),
    (9034, 0.66 * 1200.0 / 3937.0, "US survey link"),
    (9035, 5280.0 * 1200.0 / 3937.0, "US survey mile"),
    (9036, 1000.0, "kilometre"),
    (9037, 0.9143917962, "Clarke's yard"),
    (9038, 20.1166195164, "Clarke's chain"),
    (9039, 0.201166195164, "Clarke's link"),
    (9040, 0.914398414616029, "British yard (Sears 1922)"),
    (9041, 0.304799471538676, "British foot (Sears 1922)"),
    (9042, 20.1167651215526, "British chain (Sears 1922)"),
    (9043, 0.201167651215526, "British link (Sears 1922)"),
    (9050, 0.9143992, "British yard (Benoit 1895 A)"),
    (9051, 0.304799733333333, "British foot (Benoit 1895 A)"),
    (9052, 20.1167824, "British chain (Benoit 1895 A)"),
    (9053, 0.201167824, "British link (Benoit 1895 A)"),
    (9060, 0.914399204289812, "British yard (Benoit 1895 B)"),
    (9061, 0.304799734763271, "British foot (Benoit 1895 B)"),
    (9062, 20.1167824943759, "British chain (Benoit 1895 B)"),
    (9063, 0.201167824943759, "British link (Benoit 1895 B)"),
    (9070, 0.304800833333333, "British foot (1865)"),
    (9080, 0.304799510248147, "Indian foot"),
    (9081, 0.30479841, "Indian foot (1937)"),
    (9082, 0.3047996, "Indian foot (1962)"),
    (9083, 0.3047995, "Indian foot (1975)"),
    (9084, 0.914398530744441, "Indian yard"),
    (9085, 0.91439523, "Indian yard (1937)"),
    (9086, 0.9143988, "Indian yard (1962)"),
    (9087, 0.9143985, "Indian yard (1975)"),
    (9093, 1609.344, "Statute mile"),
    (9094, 0.304799710181509, "Gold Coast foot"),
    (9095, 0.3048007491, "British foot (1936)"),
    (9096, 0.9144, "yard"),
    (9097, 20.1168, "chain"),
    (9098, 0.201168, "link"),
    (9099, 0.914398, "British yard (Sears 1922 truncated)"),
    (9300, 0.304799333333333, "British foot (Sears 1922 truncated)"),
    (9301, 20.116756, "British chain (Sears 1922 truncated)"),
    (9302, 0.20116756, "British link (Sears 1922 truncated)"),
];

/// Two statements of one unit may differ by this much, as 0.3048006 and 1200/3937 do.
const SAME: f64 = 1e-8;

/// Metres in the linear unit of an EPSG code (9001 is the metre); `None` when there is no such unit.
#[must_use]
pub(crate) fn linear_unit(epsg: u32) -> Option<f64> {
    UNITS.iter().find(|(code, ..)| u32::from(*code) == epsg).map(|(_, metres, _)| *metres)
}

/// Metres in the height unit that GDAL, PROJ or a person names ("ft", "us-ft", "US survey foot"); `None` when unknown.
#[must_use]
pub(crate) fn vertical_unit(name: &str) -> Option<f64> {
    let name = name.trim().to_ascii_lowercase().replace(['_', '-'], " ");
    let short = match name.as_str() {
        "m" | "meter" | "metres" | "meters" => Some(9001),
        "ft" | "feet" | "international foot" | "foot (international)" | "foot international" => Some(9002),
        "us ft" | "ftus" | "us foot" | "us feet" | "us survey feet" | "foot us" | "foot (us survey)"
        | "survey foot" => Some(9003),
        "km" | "kilometer" | "kilometers" | "kilometres" => Some(9036),
        "cm" | "centimeter" | "centimeters" | "centimetres" => Some(1033),
        "mm" | "millimeter" | "millimeters" | "millimetres" => Some(1025),
        "yd" | "yards" => Some(9096),
        "fath" | "fathoms" => Some(9014),
        _ => None,
    };
    let named =
        || UNITS.iter().find(|(.., known)| known.eq_ignore_ascii_case(&name)).map(|(_, metres, _)| *metres);
    short.and_then(linear_unit).or_else(named)
}

/// The EPSG code of a unit of so many metres.
pub(in crate::dem) fn unit_code(metres: f64) -> Option<u16> {
    nearest(metres).map(|(code, ..)| code)
}

/// A unit of so many metres in words: "metre", "US survey foot (0.3048006096 m)".
#[must_use]
pub(crate) fn unit_in_words(metres: f64) -> String {
    match nearest(metres) {
        Some((9001, ..)) => "metre".to_owned(),
        Some((_, metres, name)) => format!("{name} ({} m)", short(metres)),
        None => format!("unit of {} m", short(metres)),
    }
}

fn nearest(metres: f64) -> Option<Unit> {
    let far = |unit: &Unit| (unit.1 / metres - 1.0).abs();
    UNITS.into_iter().filter(|unit| far(unit) < SAME).min_by(|a, b| far(a).total_cmp(&far(b)))
}

/// As many digits as tell units apart.
fn short(metres: f64) -> String {
    let text = format!("{metres:.10}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_by_code_by_name_and_back() {
        assert_eq!(linear_unit(9003), Some(1200.0 / 3937.0));
        assert_eq!(linear_unit(9005), Some(0.304_797_265_4));
        assert_eq!(linear_unit(9102), None, "a degree is no length");
        for (name, metres) in [
            ("m", 1.0),
            ("Metre", 1.0),
            ("ft", 0.3048),
            ("US_survey_foot", 1200.0 / 3937.0),
            ("us-ft", 1200.0 / 3937.0),
            ("Clarke's foot", 0.304_797_265_4),
            ("fathom", 1.8288),
        ] {
            assert_eq!(vertical_unit(name), Some(metres), "{name}");
        }
        assert_eq!(vertical_unit("furlong"), None);
        for (code, metres, name) in UNITS {
            assert_eq!(unit_code(metres), Some(code), "{name}");
        }
        // The US foot as WKT has it, the link as GDAL writes it; a unit that nobody named.
        assert_eq!(unit_code(0.304_800_609_601_219), Some(9003));
        assert_eq!(unit_code(0.3048), Some(9002));
        assert_eq!(unit_code(2.5), None);
        assert_eq!(unit_in_words(1.0), "metre");
        assert_eq!(unit_in_words(1200.0 / 3937.0), "US survey foot (0.3048006096 m)");
        assert_eq!(unit_in_words(2.5), "unit of 2.5 m");
    }
}
