//! Files as people have them: what programs write, what hands write, and what is in neither manual.

use super::*;
use crate::dem::{Georeference, RasterSpace};
use crate::sketch::StrokeKind;

/// One feature on a map of 64 x 64, or on none when `member` is empty.
fn one(member: &str, properties: &str, geometry: &str) -> String {
    format!(
        r#"{{"type":"FeatureCollection",{member}"features":[{{"type":"Feature","properties":{properties},
        "geometry":{geometry}}}]}}"#
    )
}

const MAP: &str = r#""monadnock":{"rows":64,"cols":64,"unit":"metres"},"#;

fn line(coordinates: &str) -> String {
    format!(r#"{{"type":"LineString","coordinates":{coordinates}}}"#)
}

/// A ridge with these properties beside its kind, along these coordinates.
fn ridge(properties: &str, coordinates: &str) -> String {
    one(MAP, &format!(r#"{{"kind":"ridge"{properties}}}"#), &line(coordinates))
}

#[track_caller]
fn read(text: &str) -> SketchReading {
    parse(text, &ReadOptions::default()).unwrap()
}

#[track_caller]
fn says(reading: &SketchReading, words: &[&str]) {
    let said = reading.warnings.join("\n");
    for word in words {
        assert!(said.contains(word), "{word:?} is missing in: {said}");
    }
}

#[track_caller]
fn refused(text: &str, options: &ReadOptions, words: &[&str]) {
    let message = parse(text, options).unwrap_err().to_string();
    for word in words {
        assert!(message.contains(word), "{word:?} is missing in: {message}");
    }
}

fn heights(reading: &SketchReading) -> Vec<Vec<f64>> {
    reading.sketch.strokes.iter().map(|s| s.vertices.iter().map(|v| v.z).collect()).collect()
}

fn kinds(reading: &SketchReading) -> Vec<StrokeKind> {
    reading.sketch.strokes.iter().map(|s| s.kind).collect()
}

const ALONG: &str = "[[1,1,900],[9,9,950]]";

#[test]
fn kinds_stand_under_any_name_in_any_case() {
    for (properties, kind, noted) in [
        (r#"{"Kind":"Ridge"}"#, StrokeKind::Ridge, false),
        (r#"{"KIND ":"VALLEYS"}"#, StrokeKind::Valley, false),
        (r#"{"id":7,"kind":null,"type":"valley"}"#, StrokeKind::Valley, true),
        (r#"{"natural":"ridge","name":"Hornligrat"}"#, StrokeKind::Ridge, true),
        (r#"{"Klasse":"Valley line","class":"valley"}"#, StrokeKind::Valley, true),
    ] {
        let reading = read(&one(MAP, properties, &line(ALONG)));
        assert_eq!(kinds(&reading), [kind], "{properties}");
        assert_eq!(reading.warnings.len(), usize::from(noted), "{properties}: {:?}", reading.warnings);
        if noted {
            says(&reading, &["without a property `kind`: taken as `", "feature 1"]);
        }
    }
    let plain = ReadOptions::default();
    refused(
        &one(MAP, r#"{"type":"river","id":3}"#, &line(ALONG)),
        &plain,
        &["kind", "missing", "`type`, `id`"],
    );
    refused(&one(MAP, "{}", &line(ALONG)), &plain, &["kind", "missing", "no properties", "--kind-property"]);
    let both = one(MAP, r#"{"type":"ridge","class":"valley"}"#, &line(ALONG));
    refused(&both, &plain, &["kind of feature 1", "both ridge and valley", "`type`", "`class`"]);
    let either = one(MAP, r#"{"kind":"ridge","Kind":"valley"}"#, &line(ALONG));
    refused(&either, &plain, &["both ridge and valley"]);
    // What the caller names comes before `kind`.
    let options = ReadOptions { kind_property: Some("CLASS".to_owned()), ..plain };
    let named = one(MAP, r#"{"kind":"motorway","class":"valley"}"#, &line(ALONG));
    assert_eq!(kinds(&parse(&named, &options).unwrap()), [StrokeKind::Valley]);
    refused(&ridge("", ALONG), &options, &["property `CLASS` of feature 1", "missing"]);
}

#[test]
fn heights_may_stand_in_a_property() {
    let zeros = "[[1,1,0],[9,9,0]]";
    let flat = "[[1,1],[9,9]]";
    for property in [
        r#""z":2500"#,
        r#""Elev":"2500""#,
        r#""HEIGHT":"2500 m""#,
        r#""elevation_m":2500"#,
        r#""ele":2500.0"#,
    ] {
        for coordinates in [zeros, flat, "[[1,1,null],[9,9,null]]"] {
            let reading = read(&ridge(&format!(",{property}"), coordinates));
            assert_eq!(heights(&reading), [[2500.0, 2500.0]], "{property} with {coordinates}");
            let noted = coordinates == zeros;
            assert_eq!(reading.warnings.len(), usize::from(noted), "{property}: {:?}", reading.warnings);
        }
    }
    says(&read(&ridge(r#","z":7"#, zeros)), &["1 line with z = 0", "property `z` count", "feature 1"]);
    assert_eq!(heights(&read(&ridge(r#","alt":"1000 ft""#, flat))), [[304.8, 304.8]]);
    assert_eq!(heights(&read(&ridge(r#","elev_ft":1000"#, zeros))), [[304.8, 304.8]]);
    // One for every vertex, also as the text in which tables keep lists.
    for list in ["[900,950]", r#""[900, 950]""#, r#"["900 m",950]"#] {
        assert_eq!(heights(&read(&ridge(&format!(r#","z":{list}"#), zeros))), [[900.0, 950.0]], "{list}");
    }
    let plain = ReadOptions::default();
    refused(
        &ridge(r#","z":[1,2,3]"#, zeros),
        &plain,
        &["property `z` of feature 1", "3 heights", "2 vertices"],
    );
    refused(
        &ridge(r#","z":"2,500""#, flat),
        &plain,
        &["property `z` of feature 1", "\"2,500\"", "\"2500 m\""],
    );
    refused(&ridge(r#","z":-9999"#, flat), &plain, &["property `z`", "-9999", "no height", "null"]);
    refused(&ridge("", "[[1,1,-32768],[9,9,900]]"), &plain, &["height of feature 1, vertex 1", "-32768"]);
    // Per line: where the coordinates of one hold heights, they count.
    let two = r#"{"type":"MultiLineString","coordinates":[[[1,1,0],[9,9,0]],[[1,9,900],[9,1,950]]]}"#;
    let reading = read(&one(MAP, r#"{"kind":"ridge","z":800}"#, two));
    assert_eq!(heights(&reading), [[800.0, 800.0], [900.0, 950.0]]);
    says(&reading, &["feature 1, line 1", "feature 1, line 2", "--height-property z"]);
    let options = ReadOptions { height_property: Some("Z".to_owned()), ..plain };
    let reading = parse(&one(MAP, r#"{"kind":"ridge","z":800}"#, two), &options).unwrap();
    assert_eq!(heights(&reading), [[800.0, 800.0], [800.0, 800.0]]);
    let each = one(MAP, r#"{"kind":"ridge","z":[[1,2],[3,4]]}"#, two);
    assert_eq!(heights(&parse(&each, &options).unwrap()), [[1.0, 2.0], [3.0, 4.0]]);
    let several = read(&ridge(r#","height":12,"z":900"#, flat));
    assert_eq!(heights(&several), [[900.0, 900.0]]);
    says(&several, &["property `z` counts, `height` does not"]);
}

#[test]
fn zeros_that_nobody_meant_are_named() {
    let two = |first: &str, second: &str| {
        format!(
            r#"{{"type":"FeatureCollection",{MAP}"features":[
            {{"type":"Feature","properties":{{"kind":"ridge"}},"geometry":{}}},
            {{"type":"Feature","properties":{{"kind":"valley"}},"geometry":{}}}]}}"#,
            line(first),
            line(second)
        )
    };
    let some = read(&two("[[1,1,2500],[9,1,2600]]", "[[1,9,0],[9,9,0]]"));
    says(&some, &["1 line with the height 0 from end to end", "(feature 2)"]);
    let vertex = read(&two("[[1,1,2500],[5,1,0],[9,1,2600]]", "[[1,9,1900],[9,9,1800]]"));
    says(&vertex, &["single vertices at height 0", "(feature 1)"]);
    says(&read(&two("[[1,1,0],[9,1,0]]", "[[1,9,0],[9,9,0]]")), &["Every height of the sketch is 0"]);
    // A coast is no mistake, and neither is the bottom of a style's range.
    for sound in [
        two("[[1,1,3],[9,1,40]]", "[[1,9,5],[5,9,0],[9,9,-2]]"),
        two("[[1,1,0.9],[9,1,0.8]]", "[[1,9,0],[9,9,0]]").replace("metres", "normalised"),
    ] {
        assert!(read(&sound).warnings.is_empty(), "{:?}", read(&sound).warnings);
    }
}

#[test]
fn missing_heights_are_null_nan_or_left_out() {
    let options = ReadOptions { missing_heights: MissingHeights::Leave, ..ReadOptions::default() };
    for gap in ["[5,5]", "[5,5,null]", "[5,5,NaN]", r#"[5,5,"NaN"]"#, r#"[5,5,""]"#] {
        let text = ridge(r#","note":"NaN \" NaN""#, &format!("[[1,1,900],{gap},[9,9,950]]"));
        let reading = parse(&text, &options).unwrap();
        assert_eq!(reading.given, [[true, false, true]], "{gap}");
        assert_eq!(heights(&reading), [[900.0, 0.0, 950.0]]);
        assert_eq!(
            reading.warnings.len(),
            usize::from(gap.contains(",NaN")),
            "{gap}: {:?}",
            reading.warnings
        );
        refused(&text, &ReadOptions::default(), &["height of feature 1, vertex 2", "missing"]);
    }
    let none = parse(&ridge("", "[[1,1],[9,9]]"), &options).unwrap();
    assert_eq!(
        (none.given.as_slice(), none.names.as_slice()),
        (&[vec![false, false]][..], &["feature 1".to_owned()][..])
    );
}

#[test]
fn units_come_from_the_caller_the_number_or_the_file() {
    let feet = ridge("", "[[1,1,1000],[9,9,2000]]").replace("metres", "Feet");
    assert_eq!(heights(&read(&feet)), [[304.8, 609.6]]);
    let options = ReadOptions { metres_per_unit: Some(0.5), ..ReadOptions::default() };
    assert_eq!(heights(&parse(&feet, &options).unwrap()), [[500.0, 1000.0]]);
    assert_eq!(
        heights(&parse(&ridge(r#","z":"1000 ft""#, "[[1,1],[9,9]]"), &options).unwrap()),
        [[500.0, 500.0]]
    );
    // A length cannot stand among shares of a range.
    let mixed = ridge(r#","z":"900 m""#, "[[1,1],[9,9,0.5]]").replace("metres", "normalised");
    refused(&mixed, &ReadOptions::default(), &["height of feature 1", "unit", "normalised"]);
    // A unit makes heights between 0 and 1 metres, too.
    let unstated = ridge(r#","z":"0.5 m""#, "[[1,1],[9,9]]").replace(r#","unit":"metres""#, "");
    let reading = read(&unstated);
    assert_eq!((reading.unit, reading.warnings.len()), (HeightUnit::Metres, 0), "{:?}", reading.warnings);
}

#[test]
fn every_geometry_with_lines_or_points_in_it_is_read() {
    let ring = "[[10,10,5],[20,10,5],[20,20,5],[10,20,5],[10,10,5]]";
    let open = "[[10,10,5],[20,10,5],[20,20,5],[10,20,5]]";
    for coordinates in [ring, open] {
        let polygon = format!(r#"{{"type":"Polygon","coordinates":[{coordinates}]}}"#);
        let reading = read(&one(MAP, r#"{"kind":"valley"}"#, &polygon));
        assert_eq!(reading.sketch.strokes[0].vertices.len(), 5);
        assert_eq!(reading.sketch.rasterize().line_count(), 40);
        says(&reading, &["1 line drawn as a polygon: taken as its outline (feature 1)"]);
    }
    for (geometry, strokes) in [
        (
            format!(
                r#"{{"type":"MultiPolygon","coordinates":[[{ring}],[[[1,1,1],[3,1,1],[3,3,1],[1,1,1]]]]}}"#
            ),
            2,
        ),
        (r#"{"type":"MultiPoint","coordinates":[[1,1,1],[5,5,1],[9,9,1]]}"#.to_owned(), 3),
        (
            format!(
                r#"{{"type":"GeometryCollection","geometries":[{},{{"type":"Point","coordinates":[40,40,3]}},
                {{"type":"LineString","coordinates":[]}}]}}"#,
                line("[[1,30,1],[9,30,1]]")
            ),
            2,
        ),
    ] {
        assert_eq!(
            read(&one(MAP, r#"{"kind":"ridge"}"#, &geometry)).sketch.strokes.len(),
            strokes,
            "{geometry}"
        );
    }
    let bad = r#"{"type":"MultiPolygon","coordinates":[[[1,2,3]]]}"#;
    refused(&one(MAP, r#"{"kind":"ridge"}"#, bad), &ReadOptions::default(), &["feature 1", "a number"]);
    let measured = read(&ridge("", "[[1,1,900,0.5],[9,9,950,0.7]]"));
    says(&measured, &["more than three numbers", "feature 1"]);
    assert_eq!(heights(&measured), [[900.0, 950.0]]);
    let text = read(&ridge("", r#"[["1","1","900 m"],["9","9",950]]"#));
    assert_eq!(heights(&text), [[900.0, 950.0]]);
    refused(&ridge("", r#"[["1 m","1",900]]"#), &ReadOptions::default(), &["x of feature 1", "\"1 m\""]);
}

#[test]
fn a_ridge_and_a_valley_over_the_same_cells_are_named() {
    let with_valley = |coordinates: &str| {
        let mut text = ridge("", "[[5,20,900],[50,20,950]]");
        text.truncate(text.rfind(']').unwrap());
        format!(
            r#"{text},{{"type":"Feature","properties":{{"kind":"valley"}},"geometry":{}}}]}}"#,
            line(coordinates)
        )
    };
    let along = read(&with_valley("[[10,20,700],[20,20,690],[30,40,680]]"));
    says(&along, &["a ridge and a valley that run over the same cells", "feature 1 and feature 2: 11 cells"]);
    let inside = read(&with_valley("[[10,20,700],[12,20,690]]"));
    says(&inside, &["feature 1 and feature 2: 3 cells"]);
    for sound in ["[[10,5,700],[14,40,690]]", "[[10,19,700],[50,21,690]]", "[[10,21,700],[40,21,690]]"] {
        let reading = read(&with_valley(sound));
        let crossing = reading.warnings.is_empty() || sound.starts_with("[[10,19");
        assert!(crossing, "{sound}: {:?}", reading.warnings);
    }
}

const UTM: Georeference = Georeference {
    transform: [30.0, 0.0, 500_000.0, 0.0, -30.0, 4_100_000.0],
    epsg: Some(32611),
    definition: None,
    raster_space: RasterSpace::PixelIsArea,
};

const SWISS: &str = "[[7.51,46.186,2500],[7.56,46.172,2900],[7.61,46.179,2600]]";

#[test]
fn coordinates_on_the_earth_are_no_columns_and_rows() {
    let plain = ReadOptions::default();
    let kind = r#"{"kind":"ridge"}"#;
    for crs in [
        r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:OGC:1.3:CRS84"}},"#,
        r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::4326"}},"#,
        r#""crs":{"type":"EPSG","properties":{"code":4326}},"#,
        r#""crs":"EPSG:4326","#,
    ] {
        refused(
            &one(crs, kind, &line(SWISS)),
            &plain,
            &["EPSG:4326", "without a map", "--like", "--bounds", "--pixels"],
        );
    }
    let other = one(r#""crs":"ESRI:102003","#, kind, &line(SWISS));
    refused(&other, &plain, &["`ESRI:102003`", "without a map", "--like"]);
    // RFC 7946 names no system: what looks like one is refused, too.
    for coordinates in [
        SWISS,
        "[[-71.86,44.92,500],[-71.80,44.90,600]]",
        "[[6.1,47.3,90],[14.9,54.9,80]]",
        "[[151.2,-33.8,5],[151.3,-33.7,9]]",
    ] {
        let text = one("", kind, &line(coordinates));
        refused(&text, &plain, &["look like longitude and latitude", "--like DEM", "--pixels"]);
        let pixels = ReadOptions { coordinates: Coordinates::Pixels, ..plain.clone() };
        if coordinates == SWISS {
            assert_eq!(parse(&text, &pixels).unwrap().sketch.strokes[0].vertices[0].x, 7.51);
        }
    }
    refused(&one("", kind, &line("[[500015,4099985,1200],[500315,4099985,1300]]")), &plain, &["--like DEM"]);
    // Drawings in columns and rows stay what they are.
    for coordinates in ["[[0,0,1],[9.4,20.6,1]]", "[[10,10,2],[40,30,8]]", "[[3.2,2.7,50],[60.1,55.4,80]]"] {
        let reading = read(&one("", kind, &line(coordinates)));
        says(&reading, &["no map size"]);
    }
}

#[test]
fn a_system_is_checked_against_the_map() {
    let on_utm = ReadOptions { georeference: Some(UTM), size: Some((64, 64)), ..ReadOptions::default() };
    let text = |crs: &str, coordinates: &str| one(crs, r#"{"kind":"ridge"}"#, &line(coordinates));
    let utm = "[[500015,4099985,1200],[500315,4099985,1300]]";
    let named = |name: &str| format!(r#""crs":{{"type":"name","properties":{{"name":"{name}"}}}},"#);
    for name in ["urn:ogc:def:crs:EPSG::32611", "EPSG:32611", "http://www.opengis.net/def/crs/EPSG/0/32611"] {
        let reading = parse(&text(&named(name), utm), &on_utm).unwrap();
        assert_eq!(reading.sketch.strokes[0].vertices[1].x, 10.0, "{name}");
        assert_eq!(reading.warnings.len(), 1, "only the unit: {name}: {:?}", reading.warnings);
    }
    for name in ["EPSG:26911", "ESRI:102003"] {
        refused(&text(&named(name), utm), &on_utm, &[name, "EPSG:32611", "--crs 32611"]);
        let told = ReadOptions { epsg: Some(32611), ..on_utm.clone() };
        assert_eq!(parse(&text(&named(name), utm), &told).unwrap().sketch.strokes[0].vertices[1].x, 10.0);
    }
    says(&parse(&text("", utm), &on_utm).unwrap(), &["names no coordinate system", "EPSG:32611"]);
    refused(
        &text("", SWISS),
        &on_utm,
        &["0", "look like longitude and latitude", "save the sketch in EPSG:32611"],
    );
    let swapped = "[[4099985,500015,1200],[4099985,500315,1300]]";
    refused(&text(&named("EPSG:32611"), swapped), &on_utm, &["x and y exchanged", "longitude"]);
    // A map without a system takes them as they are, and says so.
    let local = ReadOptions { georeference: Some(Georeference { epsg: None, ..UTM }), ..on_utm };
    says(&parse(&text(&named("EPSG:32611"), utm), &local).unwrap(), &["EPSG:32611", "the map none"]);
}

#[test]
fn an_outline_tells_where_a_file_lies() {
    let folder = tempfile::tempdir().unwrap();
    let of = |text: String| {
        let path = folder.path().join("s.geojson");
        std::fs::write(&path, text).unwrap();
        outline(&path, &ReadOptions::default()).unwrap()
    };
    let swiss = of(one(r#""crs":"OGC:CRS84","#, r#"{"kind":"ridge"}"#, &line(SWISS)));
    let bounds = Bounds { west: 7.51, south: 46.172, east: 7.61, north: 46.186 };
    assert_eq!(swiss, Outline { is_placed: true, has_place: false, epsg: Some(4326), bounds: Some(bounds) });
    let pixels = of(ridge("", ALONG));
    assert_eq!((pixels.is_placed, pixels.has_place, pixels.epsg), (false, false, None));
    let sketch = read(&ridge("", ALONG)).sketch;
    let placed = of(to_text(&sketch, HeightUnit::Metres, Some(&UTM)).unwrap());
    assert_eq!((placed.is_placed, placed.has_place, placed.epsg), (true, true, Some(32611)));
}
