//! Sketches from the wild: the files of `../shared/cases`, where these are there, and more of their kinds.

use super::{Answer, done, fails, temporary};
use monadnock::dem::crs::Crs;
use monadnock::dem::io::{ReadOptions, WriteOptions, read, write};
use monadnock::dem::{Dem, Georeference, RasterSpace, bundled};
use monadnock::grid::{Cell, Window};
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

/// Lines that wander are other lines, and what is made and checked is theirs; the same seed makes them wander alike.
#[test]
fn lines_that_wander_are_met() {
    let folder = temporary();
    let json = folder.path().join("c.json");
    let checked = |more: &[&str]| -> Value {
        let check = ["--method", "synthesis", "--check", "--check-json", json.to_str().unwrap()];
        generate(Path::new("lambda-ring"), &[&check, more].concat());
        serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap()
    };
    let (still, wandered) = (checked(&[]), checked(&["--wander", "2"]));
    assert_ne!(still, wandered);
    assert_eq!(wandered, checked(&["--wander", "2"]));
    for found in [&still, &wandered] {
        assert_eq!(found["height_error"].as_f64(), Some(0.0), "{found}");
    }
    refused(Path::new("lambda-ring"), &["--wander", "17"], &["wander", "17", "16"]);
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
    // In degrees the sides differ by less than counts as square: both are told, as of a DEM.
    for (name, cell, words) in [
        ("sketch-degrees.geojson", 78.33, "77.83 m west-east, 78.33 m north-south"),
        ("sketch-webmercator.geojson", 30.01, "30.01 m"),
    ] {
        let Some(path) = shared(name) else { continue };
        let (answer, info) = generate(&path, &[]);
        cell_is(&info, cell);
        says(&answer.all(), &[&format!("cells of {words}")]);
        let (at, folder) = (with_style(), temporary());
        let out = folder.path().join("o.tif");
        let out = out.to_str().unwrap();
        let args =
            ["generate", "s.safetensors", "--sketch", path.to_str().unwrap(), "-o", out, "--no-detail"];
        done(at, &args);
        for file in [path.to_str().unwrap(), out] {
            says(&done(at, &["info", file]).out, &[&format!("cell size     {words}\n")]);
        }
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
        cell_is(&info, cell);
        // A code that EPSG has replaced is written as the new one.
        let written = if epsg == 3785 { 3857 } else { epsg };
        assert_eq!(info["georeference"]["epsg"], written, "{}", answer.out);
        if epsg == 4326 {
            says(&answer.all(), &["west-east", "scaled from 48x64 to", "square"]);
        }
        // What the caller says comes first.
        let (_, told) = generate(&path, &["--cell-size", "12", "--size", "48x64"]);
        assert_eq!((&told["rows"], &told["cols"]), (&48.into(), &64.into()));
        says(&generate(&path, &["--cell-size", "12"]).0.all(), &["cells of 12 m"]);
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
    let window: Dem = bundled::load("sierra").unwrap().crop(Window::new(Cell::new(64, 100), 72, 96)).unwrap();
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

/// In feet by a code, and in a system that no code names.
#[test]
fn what_eval_saves_lies_where_it_was() {
    let at = with_style();
    let whole = bundled::load("sierra").unwrap().crop(Window::new(Cell::new(256, 128), 130, 131)).unwrap();
    let lambert = "+proj=lcc +lat_1=33 +lat_2=45 +lat_0=39 +lon_0=-96 +datum=NAD83 +units=us-ft";
    for (epsg, definition) in [(Some(2227), None), (None, Some(Crs::parse(lambert).unwrap()))] {
        let transform = [100.0, 0.0, 6_500_000.0, 0.0, -100.0, 1_900_000.0];
        let place = Georeference { transform, epsg, definition, raster_space: RasterSpace::PixelIsPoint };
        let ground = place.ground(whole.shape()).unwrap().cell_size;
        let dem = Dem::new(whole.heights().clone(), ground).unwrap().at(Some(place));
        let folder = temporary();
        let (input, out) = (folder.path().join("feet.tif"), folder.path().join("saved"));
        write(&dem, &input, &WriteOptions::default()).unwrap();
        let files = [input.to_str().unwrap(), "--save", out.to_str().unwrap()];
        let how = ["--patches", "2,3", "--systems", "laplace", "-q"];
        done(at, &[&["eval", "s.safetensors"], &files[..], &how[..]].concat());
        let patch = dem.crop(Window::square(Cell::new(2, 3), 128)).unwrap();
        for file in ["truth.tif", "laplace.tif"] {
            let saved = read(&out.join("2_3").join(file), &ReadOptions::default()).unwrap();
            let [found, wanted] = [&saved, &patch].map(|dem| *dem.georeference().unwrap());
            assert_eq!(
                (found.transform, found.epsg, found.raster_space),
                (wanted.transform, wanted.epsg, wanted.raster_space)
            );
            let [found, wanted] = [found, wanted].map(|place| place.crs().unwrap());
            assert_eq!(found.metres_per_unit(), wanted.metres_per_unit(), "{file}");
            assert!(epsg.is_some() || found.wkt().unwrap().contains("Lambert"), "{file}: {found:?}");
            let same = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
            assert!(same(saved.cell_size().x(), ground.x()) && same(saved.cell_size().y(), ground.y()));
        }
        let sketch = looked_at(&out.join("2_3/sketch.geojson"), &[]);
        let expected = patch.georeference().unwrap();
        assert_eq!(sketch["georeference"]["transform"], serde_json::json!(expected.transform));
        assert_eq!(sketch["georeference"]["epsg"], serde_json::json!(epsg));
    }
}

/// The map of terrain whose heights would have to be explained first, and masks of any numbers.
#[test]
fn maps_and_masks_need_no_heights() {
    let folder = temporary();
    let at = folder.path();
    let grid = |name: &str, number: &dyn Fn(usize) -> f64| {
        let numbers: Vec<String> = (0..64 * 64).map(|i| number(i).to_string()).collect();
        let head = "ncols 64\nnrows 64\nxllcorner 500000\nyllcorner 4100000\ncellsize 30\n";
        std::fs::write(at.join(name), format!("{head}{}\n", numbers.join(" "))).unwrap();
        at.join(name).to_str().unwrap().to_owned()
    };
    let marked = grid("marked.asc", &|i| if i < 9 { -9999.0 } else { 1500.0 + i as f64 / 9.0 });
    // Terrain of it is refused, a map of it is not; what is assumed of its place is said.
    fails(at, &["render", &marked, "-o", "x.png"], 1, &["marked.asc", "9 cells", "-9999"]);
    let (answer, info) = generate(Path::new("lambda-ring"), &["--like", &marked]);
    cell_is(&info, 30.0);
    says(&answer.err, &["marked.asc: no coordinate system is stated: its unit is taken for metres"]);
    assert!(!answer.err.contains("-9999"), "{}", answer.err);
    std::fs::write(at.join("marked.prj"), "EPSG:2229").unwrap();
    let (answer, info) = generate(Path::new("lambda-ring"), &["--like", &marked]);
    cell_is(&info, 30.0 * 1200.0 / 3937.0);
    says(&answer.err, &["coordinate system from marked.prj: EPSG:2229"]);
    // White is 65535 or 1, black 0; a number that is declared to be none is no place for detail.
    let bytes = |mask: &str| {
        let out = at.join("o.tif");
        let sketch = ["--sketch", "lambda-ring", "--size", "64", "--method", "network"];
        let how = ["-o", out.to_str().unwrap(), "--detail-strength", "2", "--detail-mask", mask];
        done(with_style(), &[&["generate", "s.safetensors"], &sketch[..], &how].concat());
        std::fs::read(out).unwrap()
    };
    let [white, one] = [("white.asc", 65_535.0), ("one.asc", 1.0)]
        .map(|(name, white)| bytes(&grid(name, &|i| if i % 64 < 20 { white } else { 0.0 })));
    assert!(white == one && one != bytes(&grid("none.asc", &|_| 0.0)));
    let own = grid("mask.asc", &|_| 1.0);
    let args = ["generate", "s.safetensors", "--sketch", "lambda-ring", "--detail-mask", &own, "-o", &own];
    fails(with_style(), &args, 1, &["mask.asc", "another file than those that are read"]);
}

/// Looking at a sketch tells how large its cells are, and what that rests on.
#[test]
fn info_of_a_sketch_tells_its_ground() {
    let web = [80.0, 0.0, 1_000_000.0, 0.0, -80.0, 8_399_738.0];
    let (_folder, path) = written(&placed(48, 64, web, 3857));
    let info = looked_at(&path, &[]);
    cell_is(&info, 40.01);
    says(&info["notes"].to_string(), &["web mercator stretches the map here"]);
    let (_folder, path) = written(&placed(48, 64, [30.0, 0.0, 5e5, 0.0, -30.0, 4.1e6], 29_999));
    says(&looked_at(&path, &[])["notes"].to_string(), &["EPSG:29999", "taken for metres"]);
}
