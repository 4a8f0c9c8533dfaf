use super::*;
use crate::dem::{Georeference, RasterSpace};
use crate::grid::Cell;
use crate::sketch::{Sketch, Stroke, StrokeKind, Vertex};
use proptest::prelude::*;

const UTM: Georeference = Georeference {
    transform: [30.0, 0.0, 500_000.0, 0.0, -30.0, 4_100_000.0],
    epsg: Some(32611),
    definition: None,
    raster_space: RasterSpace::PixelIsArea,
};

/// One ridge on a map of 32 x 32 with the given geometry and further properties.
fn file(geometry: &str, properties: &str) -> String {
    format!(
        r#"{{"type":"FeatureCollection","monadnock":{{"rows":32,"cols":32,"unit":"metres"}},"features":[
        {{"type":"Feature","properties":{{"kind":"ridge"{properties}}},"geometry":{geometry}}}]}}"#
    )
}

fn line(coordinates: &str) -> String {
    file(&format!(r#"{{"type":"LineString","coordinates":{coordinates}}}"#), "")
}

fn read_text(text: &str) -> SketchReading {
    parse(text, &ReadOptions::default()).unwrap()
}

fn refusal(text: &str) -> String {
    parse(text, &ReadOptions::default()).unwrap_err().to_string()
}

fn heights(reading: &SketchReading) -> Vec<f64> {
    reading.sketch.strokes[0].vertices.iter().map(|v| v.z).collect()
}

#[track_caller]
fn mentions(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "`{word}` is missing in: {message}");
    }
}

#[test]
fn a_plain_file_is_read_without_warnings() {
    let reading = read_text(&line("[[1, 2, 100], [5.5, 2, 200]]"));
    assert_eq!((reading.sketch.rows, reading.sketch.cols, reading.unit), (32, 32, HeightUnit::Metres));
    assert_eq!(reading.sketch.strokes[0].vertices[1], Vertex { x: 5.5, y: 2.0, z: 200.0 });
    assert!(reading.warnings.is_empty(), "{:?}", reading.warnings);
}

#[test]
fn kinds_are_read_in_any_case_and_unknown_ones_named() {
    let with = |kind: &str| line("[[1,2,3],[4,5,6]]").replace("\"ridge\"", kind);
    assert_eq!(read_text(&with("\"Valley \"")).sketch.strokes[0].kind, StrokeKind::Valley);
    assert_eq!(read_text(&with("\"RIDGE\"")).sketch.strokes[0].kind, StrokeKind::Ridge);
    mentions(&refusal(&with("\"river\"")), &["kind", "feature 1", "river", "ridge, valley"]);
    mentions(&refusal(&with("7")), &["kind", "feature 1", "7"]);
    mentions(&refusal(&with("null")), &["kind", "feature 1", "missing", "`kind`", "--kind-property"]);
    mentions(&refusal(&with("null").replace("\"kind\"", "\"Art\"")), &["kind", "missing"]);
}

#[test]
fn points_and_multilines_are_strokes() {
    let point = read_text(&file(r#"{"type":"Point","coordinates":[3,4,5]}"#, ""));
    assert_eq!(point.sketch.strokes[0].vertices, [Vertex { x: 3.0, y: 4.0, z: 5.0 }]);
    assert_eq!(point.sketch.rasterize().line_count(), 1);
    let single = read_text(&line("[[3,4,5]]"));
    assert_eq!(single.sketch, point.sketch, "a line of one vertex is a point");
    let multi = file(r#"{"type":"MultiLineString","coordinates":[[[1,1,1],[2,1,1]],[[1,5,1],[2,5,1]]]}"#, "");
    assert_eq!(read_text(&multi).sketch.strokes.len(), 2);
    let feature = r#"{"type":"Feature","properties":{"kind":"valley"},
        "geometry":{"type":"LineString","coordinates":[[0,0,0.5],[9,0,0.25]]}}"#;
    assert_eq!(read_text(feature).sketch.strokes.len(), 1, "a bare feature is a collection of one");
}

#[test]
fn other_geometries_are_refused_by_name() {
    for other in ["Circle", "Feature", "linestring"] {
        let message = refusal(&file(&format!(r#"{{"type":"{other}","coordinates":[]}}"#), ""));
        mentions(&message, &["geometry type of feature 1", other, "LineString, MultiLineString, Point"]);
    }
    mentions(&refusal(r#"{"type":"Point","coordinates":[1,2,3]}"#), &["GeoJSON type", "Point", "Feature"]);
    mentions(&refusal(&file(r#"{"coordinates":[]}"#, "")), &["geometry type", "missing"]);
    mentions(
        &refusal(&file(r#"{"type":"LineString"}"#, "")),
        &["coordinates of feature 1", "null or missing"],
    );
    mentions(
        &refusal(&file(r#"{"type":"LineString","coordinates":[1,2,3]}"#, "")),
        &["vertex 1", "a number"],
    );
}

#[test]
fn what_is_not_geojson_is_refused() {
    mentions(&refusal(""), &["not JSON", "FeatureCollection"]);
    mentions(&refusal("{\"type\":\n oops"), &["not JSON", "line 2"]);
    mentions(&refusal("[1, 2]"), &["GeoJSON type", "missing"]);
    mentions(&refusal("{\"type\":\"FeatureCollection\"}"), &["features"]);
    mentions(&refusal("{\"type\":\"FeatureCollection\",\"features\":{}}"), &["features"]);
    mentions(&refusal("{\"type\":\"FeatureCollection\",\"features\":[3]}"), &["feature 1", "a number"]);
    mentions(&refusal("{\"type\":\"FeatureCollection\",\"features\":[]}"), &["number of strokes", "0"]);
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    mentions(&refusal(&deep), &["not JSON", "recursion limit"]);
    mentions(&refusal(&line(&deep)), &["not JSON", "recursion limit"]);
    let with_bom = format!("\u{feff}{}", line("[[1,2,3],[4,5,6]]"));
    assert_eq!(read_text(&with_bom).sketch.strokes.len(), 1);
}

#[test]
fn missing_heights_are_named_or_interpolated() {
    mentions(&refusal(&line("[[1,2],[3,4]]")), &["height of feature 1, vertex 1", "missing", "property `z`"]);
    let gaps = line("[[0,0],[0,2,20],[0,4],[0,10,100],[3,10,null]]");
    mentions(&refusal(&gaps), &["height of feature 1, vertex 1", "interpolated"]);
    let options = ReadOptions { missing_heights: MissingHeights::Interpolate, ..ReadOptions::default() };
    assert_eq!(heights(&parse(&gaps, &options).unwrap()), [20.0, 20.0, 40.0, 100.0, 100.0]);
    assert!(parse(&line("[[1,2],[3,4]]"), &options).is_err(), "nothing to interpolate from");
    let flat = r#"{"type":"LineString","coordinates":[[1,2],[3,4,7]]}"#;
    assert_eq!(heights(&read_text(&file(flat, r#","height":12.5"#))), [12.5, 7.0]);
    mentions(&refusal(&file(flat, r#","z":"high""#)), &["property `z` of feature 1", "high"]);
    let multi = file(r#"{"type":"MultiLineString","coordinates":[[[1,1,1],[2,1,1]],[[1,5,1],[2,5]]]}"#, "");
    mentions(&refusal(&multi), &["feature 1, line 2, vertex 2"]);
}

#[test]
fn heights_that_are_no_numbers_are_refused() {
    mentions(&refusal(&line("[[1,2,3],[4,5,Infinity]]")), &["not JSON"]);
    mentions(&refusal(&line("[[1,2,3],[4,5,NaN]]")), &["height of feature 1, vertex 2", "missing"]);
    mentions(&refusal(&line("[[1,2,3],[NaN,5,NaN]]")), &["x of feature 1, vertex 2", "null"]);
    mentions(&refusal(&line("[[1,2,3],[4,5,1e999]]")), &["not JSON", "out of range"]);
    for bad in ["\"high\"", "\"Infinity\"", "1e300", "1000000.5", "true", "[3]"] {
        let message = refusal(&line(&format!("[[1,2,3],[4,5,{bad}]]")));
        mentions(&message, &["height of feature 1, vertex 2", "finite"]);
    }
    mentions(&refusal(&line("[[1,2,3],[null,5,4]]")), &["x of feature 1, vertex 2", "null"]);
    mentions(&refusal(&line("[[1,2,3],[4]]")), &["feature 1, vertex 2", "[x, y, z]"]);
}

#[test]
fn strokes_off_the_map_are_cut_with_a_warning() {
    let mut text = line("[[1,1,1],[90,1,1]]");
    let extra = r#"{"type":"Feature","properties":{"kind":"valley"},
        "geometry":{"type":"LineString","coordinates":[[-9,-9,1],[1e300,-1e300,2]]}}]}"#;
    text.truncate(text.rfind(']').unwrap());
    let reading = read_text(&format!("{text},{extra}"));
    assert_eq!(reading.sketch.strokes.len(), 1);
    let all = reading.warnings.join("\n");
    mentions(
        &all,
        &["1 line off the map of 32x32: left out (feature 2)", "1 line partly off", "(feature 1)"],
    );
    assert_eq!(reading.sketch.rasterize().line_count(), 31);
    mentions(&refusal(&line("[[100,100,1],[200,300,1]]")), &["strokes on the map is 0", "0 to 31", "300.0"]);
}

#[test]
fn huge_coordinates_and_sizes_allocate_nothing() {
    let through = read_text(&line("[[-1e300,5,1],[1e300,5,1]]"));
    assert_eq!(through.sketch.rasterize().line_count(), 32);
    let no_size = line("[[0,0,1],[1e300,5,1]]").replace("\"rows\":32,\"cols\":32,", "");
    mentions(&refusal(&no_size), &["size of the sketch"]);
    let huge = line("[[0,0,1],[1,5,1]]").replace("\"rows\":32", "\"rows\":1000000000");
    mentions(&refusal(&huge), &["size of the sketch", "1000000000x32", "at most"]);
    let zero = line("[[0,0,1],[1,5,1]]").replace("\"rows\":32", "\"rows\":0");
    mentions(&refusal(&zero), &["0x32"]);
    let half = line("[[0,0,1],[1,5,1]]").replace("\"rows\":32,", "");
    mentions(&refusal(&half), &["monadnock", "one side"]);
    let typo = line("[[0,0,1],[1,5,1]]").replace("\"rows\"", "\"row\"");
    mentions(&refusal(&typo), &["monadnock", "row"]);
}

#[test]
fn size_comes_from_caller_file_or_strokes() {
    let text = line("[[0,0,1],[9.4,20.6,1]]");
    let options = ReadOptions { size: Some((64, 48)), ..ReadOptions::default() };
    let given = parse(&text, &options).unwrap();
    assert_eq!((given.sketch.rows, given.sketch.cols), (64, 48));
    mentions(&given.warnings[0], &["32x32", "64x48"]);
    let bare = read_text(&text.replace(r#""monadnock":{"rows":32,"cols":32,"unit":"metres"},"#, ""));
    assert_eq!((bare.sketch.rows, bare.sketch.cols), (22, 10));
    mentions(&bare.warnings.join("\n"), &["no map size", "22x10", "no height unit"]);
    assert_eq!(bare.sketch.rasterize().kinds()[Cell::new(21, 9)], Some(StrokeKind::Ridge));
}

#[test]
fn unit_comes_from_caller_file_or_heights() {
    let low = line("[[0,0,0.5],[1,5,1]]");
    assert_eq!(read_text(&low).unit, HeightUnit::Metres, "as the file says");
    let unsaid = low.replace(",\"unit\":\"metres\"", "");
    let guessed = read_text(&unsaid);
    assert_eq!((guessed.unit, guessed.warnings.len()), (HeightUnit::Normalised, 1));
    let options = ReadOptions { unit: Some(HeightUnit::Metres), ..ReadOptions::default() };
    let told = parse(&unsaid, &options).unwrap();
    assert_eq!((told.unit, told.warnings.len()), (HeightUnit::Metres, 0));
    assert_eq!(read_text(&unsaid.replace("0.5", "1800")).unit, HeightUnit::Metres);
    assert_eq!(read_text(&low.replace("metres", "normalized")).unit, HeightUnit::Normalised);
    mentions(
        &refusal(&low.replace("metres", "fathoms")),
        &["monadnock", "fathoms", "normalised", "--metres-per-unit"],
    );
    mentions(&read_text(&line("[[0,0,0],[1,5,0]]")).warnings[0], &["Every height of the sketch is 0"]);
}

#[test]
fn contradictions_are_noted() {
    let same = read_text(&line("[[1,1,5],[1,1,5],[4,1,8],[4,1,8]]"));
    assert!(same.warnings.is_empty());
    assert_eq!(same.sketch.rasterize().line_count(), 4);
    let step = read_text(&line("[[1,1,5],[1,1,6],[4,1,8]]"));
    mentions(&step.warnings[0], &["two heights at one point", "feature 1"]);
    assert_eq!(step.sketch.rasterize().heights()[Cell::new(1, 1)], 6.0);
}

#[test]
fn features_without_points_give_one_warning() {
    let mut text = line("[[1,1,1],[3,1,1]]");
    text.truncate(text.rfind(']').unwrap());
    let empties = [
        r#"{"type":"Feature","properties":null,"geometry":null}"#,
        r#"{"type":"Feature","properties":{},"geometry":{"type":"LineString","coordinates":[]}}"#,
        r#"{"type":"Feature","properties":{},"geometry":{"type":"MultiLineString","coordinates":[[]]}}"#,
        r#"{"type":"Feature","properties":{},"geometry":{"type":"Point","coordinates":[]}}"#,
    ];
    let reading = read_text(&format!("{text},{}]}}", empties.join(",")));
    assert_eq!(reading.sketch.strokes.len(), 1);
    assert_eq!(reading.warnings.len(), 1);
    mentions(&reading.warnings[0], &["4 lines without any point", "feature 2", "feature 5"]);
}

#[test]
fn of_crossing_strokes_the_later_wins_the_cell() {
    let mut text = line("[[0,5,1],[10,5,1]]");
    text.truncate(text.rfind(']').unwrap());
    let valley = r#"{"type":"Feature","properties":{"kind":"valley"},
        "geometry":{"type":"LineString","coordinates":[[5,0,0.5],[5,10,0.5]]}}]}"#;
    let reading = read_text(&format!("{text},{valley}"));
    let lines = reading.sketch.rasterize();
    assert_eq!(lines.kinds()[Cell::new(5, 5)], Some(StrokeKind::Valley));
    assert_eq!(lines.line_count(), 21);
}

#[test]
fn a_hundred_thousand_vertices_are_read() {
    let points: Vec<String> = (0..100_000)
        .map(|i| f64::from(i) * 0.001)
        .map(|a| format!("[{},{},{}]", 16.0 + 12.0 * (7.0 * a).cos(), 16.0 + 12.0 * (5.0 * a).sin(), a))
        .collect();
    let text = line(&format!("[{}]", points.join(",")));
    let reading = read_text(&text);
    let lines = reading.sketch.rasterize();
    let written = to_text(&reading.sketch, reading.unit, None).unwrap();
    assert!(lines.line_count() > 300);
    assert_eq!(read_text(&written).sketch, reading.sketch);
}

fn two_strokes() -> Sketch {
    let stroke = |kind, points: &[(f64, f64, f64)]| Stroke {
        kind,
        vertices: points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect(),
    };
    let ridge = stroke(StrokeKind::Ridge, &[(0.0, 0.0, 1500.25), (40.5, 20.25, 1600.0)]);
    Sketch::new(64, 80, vec![ridge, stroke(StrokeKind::Valley, &[(7.0, 9.0, 900.0)])]).unwrap()
}

#[test]
fn georeferenced_sketches_round_trip() {
    let sketch = two_strokes();
    let text = to_text(&sketch, HeightUnit::Metres, Some(&UTM)).unwrap();
    mentions(&text, &["urn:ogc:def:crs:EPSG::32611", "500015.0,4099985.0,1500.25"]);
    let back = read_text(&text);
    assert_eq!(back.georeference, Some(UTM));
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    for (a, b) in sketch.strokes.iter().zip(&back.sketch.strokes) {
        for (v, w) in a.vertices.iter().zip(&b.vertices) {
            assert!((v.x - w.x).abs() < 1e-9 && (v.y - w.y).abs() < 1e-9 && v.z == w.z);
        }
    }
    // The same drawing on a map that begins 10 rows and 20 columns further in.
    let options = ReadOptions {
        georeference: Some(UTM.shifted(10, 20)),
        size: Some((54, 60)),
        ..ReadOptions::default()
    };
    let moved = parse(&text, &options).unwrap();
    assert!((moved.sketch.strokes[0].vertices[1].x - 20.5).abs() < 1e-9);
    mentions(&moved.warnings.join("\n"), &["left out (feature 2)", "partly off"]);
}

#[test]
fn a_sketch_from_a_gis_is_placed_by_its_dem() {
    let text = r#"{"type":"FeatureCollection","name":"lines",
        "crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32611"}},
        "features":[{"type":"Feature","properties":{"kind":"Ridge"},"geometry":
        {"type":"LineString","coordinates":[[500015,4099985,1200],[500315,4099985,1300]]}}]}"#;
    let options = ReadOptions { georeference: Some(UTM), size: Some((32, 32)), ..ReadOptions::default() };
    let reading = parse(text, &options).unwrap();
    assert_eq!(reading.sketch.strokes[0].vertices[1], Vertex { x: 10.0, y: 0.0, z: 1300.0 });
    let message = parse(&text.replace("32611", "2056"), &options).unwrap_err().to_string();
    mentions(&message, &["EPSG:2056", "EPSG:32611", "save the sketch", "--crs 32611"]);
    let unnamed = text.replace("\"crs\"", "\"note\"");
    mentions(
        &parse(&unnamed, &options).unwrap().warnings.join("\n"),
        &["no coordinate system", "EPSG:32611"],
    );
    let flat = Georeference { transform: [0.0; 6], ..UTM };
    let options = ReadOptions { georeference: Some(flat), ..options };
    mentions(&parse(&unnamed, &options).unwrap_err().to_string(), &["transform", "inverted"]);
    // Pixels on a georeferenced map stay pixels when the file describes its own map.
    let options = ReadOptions { georeference: Some(UTM), ..ReadOptions::default() };
    let pixels = parse(&line("[[1,2,3],[4,5,6]]"), &options).unwrap();
    assert_eq!(pixels.sketch.strokes[0].vertices[0], Vertex { x: 1.0, y: 2.0, z: 3.0 });
}

#[test]
fn written_text_is_geojson_to_another_reader() {
    let text = to_text(&two_strokes(), HeightUnit::Normalised, None).unwrap();
    let collection: ::geojson::FeatureCollection = text.parse().unwrap();
    assert_eq!(collection.features.len(), 2);
    assert!(collection.foreign_members.unwrap().contains_key("monadnock"));
    assert!(!text.contains("crs"));
    let degrees = Georeference { epsg: Some(4326), ..UTM };
    assert!(!to_text(&two_strokes(), HeightUnit::Metres, Some(&degrees)).unwrap().contains("\"crs\""));
}

#[test]
fn nothing_and_nonsense_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.geojson");
    let empty = Sketch::new(4, 4, Vec::new()).unwrap();
    mentions(
        &write(&path, &empty, HeightUnit::Metres, None).unwrap_err().to_string(),
        &["out.geojson", "strokes"],
    );
    let mut bad = two_strokes();
    bad.strokes[1].vertices[0].z = f64::NAN;
    mentions(
        &write(&path, &bad, HeightUnit::Metres, None).unwrap_err().to_string(),
        &["stroke 2, vertex 1", "NaN"],
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "no file, not even a half one");
    write(&path, &two_strokes(), HeightUnit::Metres, None).unwrap();
    assert_eq!(read(&path, &ReadOptions::default()).unwrap().sketch, two_strokes());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    std::fs::write(&path, b"\xff\xfe{}").unwrap();
    mentions(&read(&path, &ReadOptions::default()).unwrap_err().to_string(), &["out.geojson", "UTF-8"]);
    std::fs::write(&path, "{}").unwrap();
    mentions(
        &read(&path, &ReadOptions::default()).unwrap_err().to_string(),
        &["out.geojson", "GeoJSON type"],
    );
    mentions(
        &read(&folder.path().join("none"), &ReadOptions::default()).unwrap_err().to_string(),
        &["none", "open"],
    );
}

fn any_sketch() -> impl Strategy<Value = Sketch> {
    // On the map, so that nothing is left out on reading.
    let vertex = (0.0_f64..39.0, 0.0_f64..29.0, -400.0_f64..9000.0).prop_map(|(x, y, z)| Vertex { x, y, z });
    let kind = prop_oneof![Just(StrokeKind::Ridge), Just(StrokeKind::Valley)];
    let stroke = (kind, prop::collection::vec(vertex, 1..20));
    let stroke = stroke.prop_map(|(kind, vertices)| Stroke { kind, vertices });
    prop::collection::vec(stroke, 1..10).prop_map(|strokes| Sketch { rows: 30, cols: 40, strokes })
}

proptest! {
    #[test]
    fn pixel_files_come_back_to_the_last_bit(sketch in any_sketch()) {
        let text = to_text(&sketch, HeightUnit::Metres, None).unwrap();
        prop_assert_eq!(read_text(&text).sketch, sketch);
    }

    #[test]
    fn georeferenced_files_come_back_within_a_billionth_of_a_cell(sketch in any_sketch()) {
        let turned = Georeference { transform: [21.0, 5.0, 6e5, 4.0, -30.0, 5e6], ..UTM };
        let text = to_text(&sketch, HeightUnit::Metres, Some(&turned)).unwrap();
        let back = read_text(&text).sketch;
        for (a, b) in sketch.strokes.iter().zip(&back.strokes) {
            for (v, w) in a.vertices.iter().zip(&b.vertices) {
                prop_assert!((v.x - w.x).hypot(v.y - w.y) < 1e-8 && v.z == w.z);
            }
        }
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "\\PC{0,200}") {
        let _ = parse(&text, &ReadOptions::default());
    }

    #[test]
    fn no_damage_to_a_good_file_makes_the_reader_panic(
        sketch in any_sketch(), at in prop::collection::vec((any::<prop::sample::Index>(), "[\\PC]{0,3}"), 1..4),
    ) {
        let mut text = to_text(&sketch, HeightUnit::Metres, Some(&UTM)).unwrap();
        for (index, junk) in at {
            let i = index.index(text.len());
            if text.is_char_boundary(i) && text.is_char_boundary(i + 1) {
                text.replace_range(i..=i, &junk);
            }
        }
        if let Ok(reading) = parse(&text, &ReadOptions::default()) {
            prop_assert!(reading.sketch.validate().is_ok());
        }
    }
}
