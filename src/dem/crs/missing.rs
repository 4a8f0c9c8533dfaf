//! Projected systems of EPSG's that the table of `proj-core` does not have: 40 of the 5291 that are current.
//!
//! In: a code. Out: the system, as far as sizes on the ground and units need it: the axes of south-orientated ones are not
//! turned, and the rotation of a local orthographic one does not count. Of six only the unit is known. Source: the EPSG
//! dataset as PROJ 9.5 has it (`tests/oracle/coordinate_systems.py` compares all codes).

/// A projection that neither library has as it is used (axes to the south and the west; a polynomial), in metres, true
/// within 0.6 %.
const METRES: &str = r#"PROJCS["metres",PROJECTION["unknown"],UNIT["metre",1]]"#;

const OTHERS: [(u32, &str); 12] = [
    (2065, METRES),
    (5224, METRES),
    (5513, METRES),
    (5515, METRES),
    (8352, METRES),
    (27_200, METRES),
    (
        3139,
        "+proj=cass +lat_0=-16.25 +lon_0=179.333333333333 +x_0=251727.9155424 +y_0=334519.953768 +a=6378306.3696 +b=6356571.996 +to_meter=0.201168",
    ),
    (3410, "+proj=cea +lat_ts=30 +R=6371228"),
    (6933, "+proj=cea +lat_ts=30 +datum=WGS84"),
    (9895, "+proj=tmerc +lat_0=49.8333333333333 +lon_0=6.16666666666667 +x_0=80000 +y_0=100000 +ellps=intl"),
    (
        31_300,
        "+proj=lcc +lat_0=90 +lon_0=4.35693972222222 +lat_1=49.8333333333333 +lat_2=51.1666666666667 +x_0=150000.01256 +y_0=5400088.4378 +ellps=intl",
    ),
    (10_622, "+proj=ortho +lat_0=37.6289686531 +lon_0=-122.3939412704 +ellps=GRS80 +units=us-ft"),
];

/// The definition of such a code.
pub(super) fn definition(code: u32) -> Option<String> {
    let south = |first: u32, step: u32, first_meridian: u32, rest: &str| {
        let meridian = first_meridian + 2 * ((code - first) / step);
        Some(format!("+proj=tmerc +lon_0={meridian} {rest}"))
    };
    match code {
        2046..=2055 => south(2046, 1, 15, "+ellps=WGS84"),
        22_275..=22_293 if code % 2 == 1 => south(22_275, 2, 15, "+a=6378249.145 +rf=293.4663077"),
        29_371..=29_385 if code % 2 == 1 => {
            south(29_371, 2, 11, "+lat_0=-22 +ellps=bess_nam +to_meter=1.0000135965")
        }
        _ => OTHERS.iter().find(|(known, _)| *known == code).map(|(_, text)| (*text).to_owned()),
    }
}
