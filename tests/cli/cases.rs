//! Sketches from the wild: the files of `../shared/cases`, where these are there, and more of their kinds.

use super::{Answer, done, fails, run, temporary};
use monadnock::dem::io::{ReadOptions, WriteOptions, read, write};
use monadnock::dem::{Dem, bundled};
use monadnock::grid::Cell;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A folder with a style of sierra, whose cells are 30 m, in `s.safetensors`.
fn with_style() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = temporary();
            let train =
                ["train", "sierra", "-o", "s.safetensors", "--crop", "64,64,96", "--epochs", "1", "-q"];
            done(folder.path(), &train);
            folder
        })
        .path()
}

/// A file of the shared cases; `None`, with a word, where they are not there.
fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases").join(name);
    if path.is_file() {
        return Some(path);
    }
    eprintln!("{} is not there: skipped", path.display());
    None
}

/// The text under a name of its own in a new folder.
fn written(text: &str) -> (TempDir, PathBuf) {
    let folder = temporary();
    let path = folder.path().join("s.geojson");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// Generates from a sketch with further arguments: what was said, and what `info` says of the terrain.
fn generate(sketch: &Path, more: &[&str]) -> (Answer, Value) {
    let (at, folder) = (with_style(), temporary());
    let out = folder.path().join("o.tif");
    let (sketch, out) = (sketch.to_str().unwrap(), out.to_str().unwrap());
    // A range in which the heights of these sketches lie, whatever the style's window happens to be.
    let args = [
        "generate",
        "s.safetensors",
        "--sketch",
        sketch,
        "-o",
        out,
        "--elevation",
        "1700,2600",
        "--no-detail",
    ];
    let answer = done(at, &[&args, more].concat());
    let info = done(at, &["info", out, "--json"]).out;
    (answer, serde_json::from_str(&info).unwrap())
}

#[test]
fn water_finds_its_way_out_where_the_style_drains() {
    let folder = temporary();
    let json = folder.path().join("c.json");
    let checked = |sketch: &str, more: &[&str]| -> Value {
        let check = ["--check", "--check-json", json.to_str().unwrap()];
        generate(Path::new(sketch), &[&check, more].concat());
        serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap()
    };
    let pits = |found: &Value| found["pits"].as_f64().unwrap();
    for (sketch, method) in [("meander", "synthesis"), ("range-and-river", "network")] {
        let as_made = checked(sketch, &["--method", method, "--drain=never"]);
        let drained = checked(sketch, &["--method", method]);
        assert_eq!(drained, checked(sketch, &["--method", method, "--drain"]));
        assert_ne!(drained, as_made, "{sketch}");
        let of_style = drained["style_pits"].as_f64().unwrap();
        assert!(pits(&drained) <= of_style.max(0.003) + 1e-9, "{sketch}: {drained}");
        assert!(pits(&drained) <= pits(&as_made) + 1e-9, "{sketch}: {as_made} {drained}");
        // Strokes are not cut for it.
        assert_eq!(drained["height_error"], as_made["height_error"], "{sketch}");
        // Hollows beside the river are gone.
        assert!(sketch != "meander" || pits(&drained) < 0.5 * pits(&as_made), "{as_made} {drained}");
    }
}

fn refused(sketch: &Path, more: &[&str], words: &[&str]) {
    let folder = temporary();
    let out = folder.path().join("o.tif");
    let (name, out) = (sketch.to_str().unwrap(), out.to_str().unwrap());
    let file = sketch.file_name().unwrap().to_str().unwrap();
    let words = &[&[file], words].concat();
    fails(
        with_style(),
        &[&["generate", "s.safetensors", "--sketch", name, "-o", out], more].concat(),
        1,
        words,
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

fn looked_at(sketch: &Path, more: &[&str]) -> Value {
    let answer = done(with_style(), &[&["info", sketch.to_str().unwrap(), "--json"], more].concat());
    serde_json::from_str(&answer.out).unwrap()
}

#[track_caller]
fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is missing in: {text}");
    }
}

#[track_caller]
fn cell_is(info: &Value, wanted: f64) {
    let [x, y] = ["x", "y"].map(|side| info["cell_size"][side].as_f64().unwrap());
    let near = |side: f64| (side / wanted - 1.0).abs() < 0.01;
    assert!(near(x) && near(y), "{x} x {y} m, not {wanted}");
}

/// A ridge and a valley across a map of `rows` x `cols` with this place.
fn placed(rows: usize, cols: usize, transform: [f64; 6], epsg: u32) -> String {
    let [a, b, c, d, e, f] = transform;
    let at = |col: f64, row: f64, z: f64| {
        format!("[{},{},{z}]", a * (col + 0.5) + b * (row + 0.5) + c, d * (col + 0.5) + e * (row + 0.5) + f)
    };
    let (right, down) = (cols as f64 - 4.0, rows as f64 - 4.0);
    format!(
        r#"{{"type":"FeatureCollection","monadnock":{{"rows":{rows},"cols":{cols},"unit":"metres","georeference":
        {{"transform":[{a},{b},{c},{d},{e},{f}],"epsg":{epsg},"raster_space":"pixel-is-area"}}}},"features":[
        {{"type":"Feature","properties":{{"kind":"ridge"}},"geometry":{{"type":"LineString","coordinates":[{},{}]}}}},
        {{"type":"Feature","properties":{{"kind":"valley"}},"geometry":{{"type":"LineString","coordinates":[{},{}]}}}}]}}"#,
        at(3.0, 3.0, 2400.0),
        at(right, 5.0, 2500.0),
        at(3.0, down, 2000.0),
        at(right, down, 1900.0)
    )
}

#[test]
fn a_georeferenced_sketch_has_the_cells_of_its_ground() {
    // In degrees 78.33 m is the side from north to south; the mean of both sides is told.
    for (name, cell, mean) in
        [("sketch-degrees.geojson", 78.33, "78.07"), ("sketch-webmercator.geojson", 30.01, "30.01")]
    {
        let Some(path) = shared(name) else { continue };
        let (answer, info) = generate(&path, &[]);
        cell_is(&info, cell);
        says(&answer.all(), &[&format!("cells of {mean} m")]);
    }
    for (transform, epsg, cell) in [
        // US survey feet; metres; web mercator at 60 N under an older code; degrees, whose cells are made square.
        ([100.0, 0.0, 6_500_000.0, 0.0, -100.0, 1_850_000.0], 2229, 30.48),
        ([25.0, 0.0, 500_000.0, 0.0, -25.0, 4_100_000.0], 32612, 25.0),
        ([80.0, 0.0, 1_000_000.0, 0.0, -80.0, 8_399_738.0], 3785, 40.01),
        ([0.0005, 0.0, 10.0, 0.0, -0.0005, 60.0], 4326, 39.51),
    ] {
        let (_folder, path) = written(&placed(48, 64, transform, epsg));
        let (answer, info) = generate(&path, &[]);
        says(&answer.all(), &[&format!("cells of {cell:.2} m")]);
        // A code that EPSG has replaced is written as the new one.
        let written = if epsg == 3785 { 3857 } else { epsg };
        assert_eq!(info["georeference"]["epsg"], written, "{}", answer.out);
        if epsg == 4326 {
            says(&answer.all(), &["west-east", "scaled from 48x64 to", "square"]);
        }
        // What the caller says comes first.
        let (_, told) = generate(&path, &["--cell-size", "12", "--size", "48x64"]);
        assert_eq!((&told["rows"], &told["cols"]), (&48.into(), &64.into()));
        says(&generate(&path, &["--cell-size", "12"]).0.all(), &["cells of 12.00 m"]);
    }
    // Forms are learned in cells: a map of far smaller ones is told, with both numbers.
    let (_folder, path) = written(&placed(48, 64, [5.0, 0.0, 5e5, 0.0, -5.0, 4.1e6], 32612));
    says(&generate(&path, &[]).0.err, &["s.geojson", "5.00 m", "30.00 m", "--size"]);
    let (_folder, near) = written(&placed(48, 64, [20.0, 0.0, 5e5, 0.0, -20.0, 4.1e6], 32612));
    assert!(!generate(&near, &[]).0.err.contains("warning"));
}

const SWISS: &str = r#""features":[{"type":"Feature","properties":{"kind":"ridge"},"geometry":{"type":"LineString",
    "coordinates":[[7.51,46.186,2300],[7.56,46.172,2400],[7.61,46.179,2350]]}},{"type":"Feature","properties":{"kind":
    "valley"},"geometry":{"type":"LineString","coordinates":[[7.512,46.137,1900],[7.618,46.13,1850]]}}]}"#;

#[test]
fn a_sketch_on_the_earth_needs_a_map() {
    let mut files = Vec::new();
    for head in ["", r#""crs":{"type":"name","properties":{"name":"EPSG:4326"}},"#] {
        files.push(written(&format!(r#"{{"type":"FeatureCollection",{head}{SWISS}"#)));
    }
    let shared = shared("sketch-eu84.geojson");
    for path in files.iter().map(|(_, path)| path).chain(&shared) {
        for more in [&[][..], &["--size", "128"]] {
            refused(path, more, &["--like DEM", "--bounds strokes", "--pixels"]);
        }
        // A map around the strokes: 0.13 degrees of longitude at 46 N are 10 km.
        let (answer, info) = generate(path, &["--bounds", "strokes"]);
        cell_is(&info, 30.0);
        let cols = info["cols"].as_u64().unwrap();
        assert!((330..350).contains(&cols), "{cols}");
        says(&answer.all(), &["on a map from (7.", "46."]);
        let (_, info) = generate(path, &["--bounds", "7.5,46.12,7.63,46.2", "--size", "100x130"]);
        assert_eq!((&info["rows"], &info["cols"]), (&100.into(), &130.into()));
    }
    let named = &files[1].1;
    let looked = looked_at(named, &[]);
    assert_eq!(looked["georeference"]["epsg"], 4326);
    says(&looked["warnings"].to_string(), &["describes no map", "--like DEM"]);
    refused(named, &["--bounds", "8,47,9,48"], &["strokes on the map is 0"]);
    let swapped = SWISS.replace("7.51,46.186", "46.186,7.51").replace("7.56,46.172", "46.172,7.56");
    let swapped = swapped.replace("7.61,46.179", "46.179,7.61").replace("7.512,46.137", "46.137,7.512");
    let swapped = swapped.replace("7.618,46.13,", "46.13,7.618,");
    let (_folder, path) = written(&format!(r#"{{"type":"FeatureCollection","crs":"EPSG:4326",{swapped}"#));
    refused(&path, &["--bounds", "7.5,46.12,7.63,46.2"], &["x and y exchanged", "longitude"]);
}

/// What a geographic information system makes of a file of ours: it keeps coordinates and properties, writes the `crs`
/// member, and drops the map.
fn through_a_gis(text: &str) -> String {
    let mut value: Value = serde_json::from_str(text).unwrap();
    let root = value.as_object_mut().unwrap();
    root.remove("monadnock");
    root.insert("name".to_owned(), "lines".into());
    for feature in root["features"].as_array_mut().unwrap() {
        feature["properties"]["fid"] = 1.into();
    }
    value.to_string()
}

#[test]
fn a_sketch_comes_back_from_a_gis() {
    let folder = temporary();
    let at = folder.path();
    let window: Dem = bundled::load("sierra").unwrap().crop(Cell::new(64, 100), 72, 96).unwrap();
    write(&window, &at.join("window.tif"), &WriteOptions::default()).unwrap();
    let like = at.join("window.tif");
    let like = like.to_str().unwrap();
    done(at, &["extract", like, "-o", "ours.geojson"]);
    let ours = std::fs::read_to_string(at.join("ours.geojson")).unwrap();
    let path = at.join("s.geojson");
    std::fs::write(&path, through_a_gis(&ours)).unwrap();
    let bytes = |sketch: &Path, more: &[&str]| {
        let (sketch, out) = (sketch.to_str().unwrap(), at.join("o.tif"));
        let args =
            ["generate", "s.safetensors", "--sketch", sketch, "-o", out.to_str().unwrap(), "--no-detail"];
        done(with_style(), &[&args, more].concat());
        std::fs::read(out).unwrap()
    };
    refused(&path, &[], &["size of the sketch", "--like DEM"]);
    assert!(bytes(&path, &["--like", like]) == bytes(&at.join("ours.geojson"), &[]), "the same terrain");

    // In columns and rows, which a GIS takes for degrees and names so.
    write(&window, &at.join("plain.npy"), &WriteOptions::default()).unwrap();
    let plain = at.join("plain.npy");
    done(at, &["extract", plain.to_str().unwrap(), "-o", "pixels.geojson"]);
    let text = through_a_gis(&std::fs::read_to_string(at.join("pixels.geojson")).unwrap());
    let text = text.replacen(
        '{',
        r#"{"crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:OGC:1.3:CRS84"}},"#,
        1,
    );
    let pixels = at.join("p.geojson");
    std::fs::write(&pixels, text).unwrap();
    refused(&pixels, &[], &["EPSG:4326", "--like DEM", "--pixels"]);
    let on_map = bytes(&pixels, &["--like", plain.to_str().unwrap()]);
    assert!(on_map == bytes(&at.join("pixels.geojson"), &["--like", plain.to_str().unwrap()]));
    assert!(on_map == bytes(&pixels, &["--pixels", "--size", "72x96", "--cell-size", "1"]));

    // Any sketch can be laid on any terrain, and takes its place and cells.
    let (answer, info) = generate(Path::new("lambda-ring"), &["--like", like]);
    says(&answer.all(), &["drawn on 128x128 cells, stretched over the 72x96", "window.tif"]);
    let expected = serde_json::to_value(window.georeference().unwrap()).unwrap();
    assert_eq!((&info["rows"], &info["cols"]), (&72.into(), &96.into()));
    for key in ["transform", "epsg", "raster_space"] {
        assert_eq!(info["georeference"][key], expected[key], "{key}");
    }
    let (_, fine) = generate(Path::new("lambda-ring"), &["--like", like, "--size", "144x192"]);
    cell_is(&fine, window.cell_size().mean() / 2.0);
    let Some(lost) = shared("sketch-qgis-member-lost.geojson") else { return };
    refused(&lost, &[], &["EPSG:32612", "map", "--like DEM"]);
    let (_, info) = generate(&lost, &["--bounds", "strokes"]);
    assert_eq!(info["georeference"]["epsg"], 32612);
    cell_is(&info, 30.0);
}

/// The properties and coordinates of a ridge beside a plain valley, on a map of 128 x 128.
fn beside_a_valley(ridge: &str, coordinates: &str) -> String {
    format!(
        r#"{{"type":"FeatureCollection","monadnock":{{"rows":128,"cols":128,"unit":"metres"}},"features":[
        {{"type":"Feature","properties":{ridge},"geometry":{{"type":"LineString","coordinates":{coordinates}}}}},
        {{"type":"Feature","properties":{{"kind":"valley"}},"geometry":{{"type":"LineString","coordinates":
        [[12,90,1900],[60,80,1850],[118,100,1800]]}}}}]}}"#
    )
}

#[test]
fn heights_are_found_where_they_were_written() {
    let range = |path: &Path| {
        let info = looked_at(path, &[]);
        (info["elevation"]["lowest"].as_f64().unwrap(), info["elevation"]["highest"].as_f64().unwrap())
    };
    if let Some(path) = shared("sketch-zprop_vs_z0.geojson") {
        assert_eq!(range(&path), (1800.0, 2500.0));
        says(&generate(&path, &[]).0.err, &["2 lines with z = 0", "property `z` count"]);
    }
    for (properties, coordinates, high) in [
        (r#"{"kind":"ridge","Elev":2500}"#, "[[10,20,0],[110,30,0]]", 2500.0),
        (r#"{"kind":"ridge","heights":"[2500, 2600]"}"#, "[[10,20,0],[110,30,0]]", 2600.0),
        (r#"{"kind":"ridge","z":"2500 m"}"#, "[[10,20],[110,30]]", 2500.0),
        (r#"{"kind":"ridge","elev_ft":"8202.1"}"#, "[[10,20],[110,30]]", 2500.0),
    ] {
        let (_folder, path) = written(&beside_a_valley(properties, coordinates));
        let found = range(&path);
        assert!(found.0 == 1800.0 && (found.1 - high).abs() < 0.01, "{properties}: {found:?}");
    }
    if let Some(path) = shared("sketch-strz.geojson") {
        assert_eq!(range(&path), (1800.0, 2500.0));
    }
    let (_folder, path) = written(&beside_a_valley(r#"{"kind":"ridge","z":"2,500"}"#, "[[10,20],[110,30]]"));
    refused(&path, &[], &["property `z` of feature 1", "\"2,500\"", "\"2500 m\""]);
}

#[test]
fn zeros_feet_and_kinds_are_told() {
    let ridge = r#"{"kind":"ridge"}"#;
    let whole = beside_a_valley(ridge, "[[10,20,0],[60,40,0],[110,30,0]]");
    let single = beside_a_valley(ridge, "[[10,20,2300],[60,40,0],[110,30,2400]]");
    for (text, words) in
        [(whole, ["0 from end to end", "feature 1"]), (single, ["single vertices at height 0", "feature 1"])]
    {
        let (_folder, path) = written(&text);
        says(&generate(&path, &[]).0.err, &words);
    }
    if let Some(path) = shared("sketch-z0_some.geojson") {
        says(&generate(&path, &[]).0.err, &["0 from end to end", "feature 2"]);
    }
    // Heights that the style has never seen: in feet they would fit.
    let feet = beside_a_valley(ridge, "[[10,20,8200],[110,30,8528]]")
        .replace("1900]", "6232]")
        .replace("1850]", "6068]");
    let (_folder, path) = written(&feet.replace("1800]", "5904]"));
    for path in [Some(path), shared("sketch-feet.geojson")].into_iter().flatten() {
        let (answer, _) = generate(&path, &[]);
        says(&answer.err, &["far outside the range of --elevation", "5904.0 to", "--metres-per-unit 0.3048"]);
        assert!(!generate(&path, &["--metres-per-unit", "0.3048"]).0.err.contains("far outside"));
    }
    let stated = beside_a_valley(ridge, "[[10,20,8200],[110,30,8528]]").replace("\"metres\"", "\"feet\"");
    let stated = stated.replace("1900]", "6232]").replace("1850]", "6068]").replace("1800]", "5904]");
    let (_folder, path) = written(&stated);
    assert!(!generate(&path, &[]).0.err.contains("far outside"));
    // Kinds under any name.
    let own = [r#"{"Kind":"RIDGE"}"#, r#"{"id":4,"type":"Ridges"}"#]
        .map(|p| written(&beside_a_valley(p, "[[10,20,2300],[110,30,2400]]")));
    for path in own.iter().map(|(_, path)| path.clone()).chain(shared("sketch-KIND.geojson")) {
        assert_eq!(looked_at(&path, &[])["ridges"]["strokes"], 1, "{}", path.display());
        assert_eq!(generate(&path, &[]).1["rows"], 128);
    }
    let (_folder, river) = written(&beside_a_valley(r#"{"Art":"river"}"#, "[[10,20,2300],[110,30,2400]]"));
    refused(&river, &[], &["property `kind` of feature 1", "missing", "`Art`", "ridge, valley"]);
    refused(&river, &["--kind-property", "art"], &["property `Art` of feature 1", "\"river\""]);
}

#[test]
fn what_eval_saves_lies_where_it_was() {
    let (at, folder) = (with_style(), temporary());
    let out = folder.path().join("saved");
    let args = ["eval", "s.safetensors", "sierra", "--patches", "256,128", "--systems", "laplace", "--save"];
    let answer = run(at, &[&args[..], &[out.to_str().unwrap(), "-q"]].concat());
    assert_eq!(answer.code, 0, "{}", answer.err);
    let place = bundled::load("sierra").unwrap().crop(Cell::new(256, 128), 128, 128).unwrap();
    for file in ["truth.tif", "laplace.tif"] {
        let dem = read(&out.join("256_128").join(file), &ReadOptions::default()).unwrap();
        assert_eq!(
            dem.georeference().map(|g| (g.transform, g.epsg)),
            place.georeference().map(|g| (g.transform, g.epsg))
        );
        assert_eq!(dem.cell_size(), place.cell_size());
    }
    let sketch = looked_at(&out.join("256_128/sketch.geojson"), &[]);
    assert_eq!(
        sketch["georeference"]["transform"],
        serde_json::json!(place.georeference().unwrap().transform)
    );
}
