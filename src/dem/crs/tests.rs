//! Coordinate systems by code and by words.

use super::{Crs, CrsKind, Ellipsoid};
use proj_core::ProjectionMethod;

const SURVEY_FOOT: f64 = 1200.0 / 3937.0;

#[test]
fn kinds_and_units_by_code() {
    let of = |code| Crs::from_epsg(code).unwrap();
    assert_eq!((of(4326).kind(), of(4326).metres_per_unit()), (CrsKind::Geographic, None));
    assert_eq!((of(32611).kind(), of(32611).metres_per_unit()), (CrsKind::Projected, Some(1.0)));
    // California zone 3 in US feet, Arizona in international ones, Trinidad in Clarke's, Fiji in links of Sears 1922.
    for (code, metres) in [(2227, SURVEY_FOOT), (2223, 0.3048), (2314, 0.304_797_265_4)] {
        let found = of(code).metres_per_unit().unwrap();
        assert!((found / metres - 1.0).abs() < 1e-9, "{code}: {found}");
    }
    assert_eq!((of(54_004).epsg(), of(900_913).epsg()), (Some(54_004), Some(900_913)));
    assert_eq!(Crs::from_epsg(32_767), None);
    assert_eq!(Crs::from_epsg(4978), None, "geocentric coordinates are no map");
}

#[test]
fn compound_systems_say_the_unit_of_heights() {
    let crs = Crs::parse("EPSG:26911+6360").unwrap();
    assert!((crs.vertical_metres_per_unit().unwrap() / SURVEY_FOOT - 1.0).abs() < 1e-9);
    assert_eq!(crs.metres_per_unit(), Some(1.0));
    assert_eq!(Crs::from_epsg(26911).unwrap().vertical_metres_per_unit(), None);
}

const ESRI: &str = r#"PROJCS["NAD_1983_StatePlane_California_III_FIPS_0403_Feet",GEOGCS["GCS_North_American_1983",
    DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],
    UNIT["Degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic"],PARAMETER["False_Easting",6561666.666666666],
    PARAMETER["False_Northing",1640416.666666667],PARAMETER["Central_Meridian",-120.5],
    PARAMETER["Standard_Parallel_1",37.06666666666667],PARAMETER["Standard_Parallel_2",38.43333333333333],
    PARAMETER["Latitude_Of_Origin",36.5],UNIT["Foot_US",0.3048006096012192]]"#;

#[test]
fn wkt_and_proj_strings_are_read_and_come_back() {
    for text in [
        ESRI,
        "+proj=merc +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m",
        "+proj=lcc +lat_1=33 +lat_2=45 +lat_0=39 +lon_0=-96 +datum=NAD83 +units=us-ft",
        "+proj=stere +lat_0=90 +lat_ts=70 +lon_0=-45 +datum=WGS84",
        "+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=0 +datum=WGS84",
        "+proj=stere +lat_0=90 +lat_ts=90 +k_0=0.994 +lon_0=0 +datum=WGS84",
        "+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +datum=NAD83",
        "+proj=moll +lon_0=10 +datum=WGS84 +units=us-ft",
        "+proj=longlat +R=1737400",
        r#"LOCAL_CS["unnamed",UNIT["foot",0.3048,AUTHORITY["EPSG","9002"]]]"#,
    ] {
        let crs = Crs::parse(text).unwrap();
        let wkt = crs.wkt().unwrap();
        assert_eq!(Crs::parse(&wkt).unwrap(), crs, "{wkt}");
    }
    assert!((Crs::parse(ESRI).unwrap().metres_per_unit().unwrap() / SURVEY_FOOT - 1.0).abs() < 1e-9);
    let moon = Crs::parse("+proj=longlat +R=1737400").unwrap();
    assert_eq!(moon.ellipsoid(), Ellipsoid { semi_major: 1_737_400.0, flattening: 0.0 });
    // In the words of GDAL and PROJ (the library's own are Albers_Equal_Area, and the pole as latitude of origin).
    let words = |text: &str| Crs::parse(text).unwrap().wkt().unwrap();
    let polar = words("+proj=stere +lat_0=90 +lat_ts=70 +lon_0=-45 +datum=WGS84");
    assert!(
        polar.contains(r#"PARAMETER["latitude_of_origin",70]"#) && !polar.contains("parallel"),
        "{polar}"
    );
    let albers = words("+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +datum=NAD83");
    for word in ["Albers_Conic_Equal_Area", r#"PARAMETER["latitude_of_center",23]"#, "longitude_of_center"] {
        assert!(albers.contains(word), "{albers}");
    }
}

/// The same system in the words of different programs.
#[test]
fn dialects_say_the_same() {
    let albers = Crs::parse("+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +datum=NAD83").unwrap();
    for name in ["Albers", "Albers_Conic_Equal_Area"] {
        let text = ESRI.replace("Lambert_Conformal_Conic", name);
        let crs = Crs::parse(&text).unwrap();
        let known =
            matches!(crs.method(), Some(ProjectionMethod::AlbersEqualArea { lat1, .. }) if lat1 > 37.0);
        assert!(known && albers.method().is_some(), "{name}: {crs:?}");
    }
    let gauss = ESRI.replace("Lambert_Conformal_Conic", "Gauss_Kruger");
    assert!(matches!(
        Crs::parse(&gauss).unwrap().method(),
        Some(ProjectionMethod::TransverseMercator { .. })
    ));
    // Of a code that stands last in the text, where its words are not understood.
    let coded = |code: u32| {
        format!(
            r#"{},AUTHORITY["EPSG","{code}"]]"#,
            ESRI.replace("Lambert_Conformal_Conic", "Cubewano").trim_end_matches(']').to_owned() + "]"
        )
    };
    assert_eq!(Crs::parse(&coded(2227)).unwrap().epsg(), Some(2227));
    assert_eq!(Crs::parse(&coded(99_999)).unwrap().epsg(), None);
}

/// Of the 40 that the library's table lacks, and as many are not: neighbours have no code.
#[test]
fn codes_beside_the_table() {
    for code in [
        2046, 2055, 22_275, 22_293, 29_371, 29_385, 2065, 3139, 3410, 5224, 5513, 5515, 6933, 8352, 9895,
        27_200, 31_300, 10_622,
    ] {
        let crs = Crs::from_epsg(code).unwrap_or_else(|| panic!("{code}"));
        assert_eq!((crs.kind(), crs.epsg()), (CrsKind::Projected, Some(code)));
    }
    assert!((Crs::from_epsg(10_622).unwrap().metres_per_unit().unwrap() / SURVEY_FOOT - 1.0).abs() < 1e-9);
    assert!((Crs::from_epsg(3139).unwrap().metres_per_unit().unwrap() - 0.201_168).abs() < 1e-9);
    for code in [22_276, 22_295, 29_372, 29_387] {
        assert_eq!(Crs::from_epsg(code), None, "{code}");
    }
}

/// A projection that the library cannot undo: its unit counts all the same.
#[test]
fn the_unit_of_an_unknown_projection_is_read() {
    let unknown = ESRI.replace("Lambert_Conformal_Conic", "Bonne");
    let crs = Crs::parse(&unknown).unwrap();
    assert_eq!((crs.kind(), crs.method()), (CrsKind::Projected, None));
    assert!((crs.metres_per_unit().unwrap() / SURVEY_FOOT - 1.0).abs() < 1e-9);
    let heights = format!(
        r#"COMPD_CS["both",{unknown},VERT_CS["NAVD88 height (ft)",VERT_DATUM["NAVD88",2005],UNIT["foot",0.3048]]]"#
    );
    let both = Crs::parse(&heights).unwrap();
    assert_eq!(both.vertical_metres_per_unit(), Some(0.3048));
    assert!((both.metres_per_unit().unwrap() / SURVEY_FOOT - 1.0).abs() < 1e-9);
}

#[test]
fn what_is_not_understood_is_said() {
    for text in ["", "meters", "EPSG:1", "PROJCS[", "+proj=nothing", "GEOGCS[\"x\"]"] {
        let message = Crs::parse(text).unwrap_err().to_string();
        assert!(message.contains("coordinate system") && message.contains("allowed"), "{message}");
    }
    assert!(Crs::local(0.0).is_err() && Crs::projected_in(f64::NAN).is_err());
    assert_eq!(
        Crs::from_epsg(2227).unwrap().in_words(),
        "EPSG:2227 (NAD83 / California zone 3 (ftUS)), US survey foot (0.3048006096 m)"
    );
}
