//! Sketches and pictures of them.

use super::{done, fails, pixels, png_size, run, temporary, write_hill};
use serde_json::Value;

#[test]
fn a_sketch_of_bundled_terrain_goes_round() {
    let folder = temporary();
    let crop = ["--crop", "100,140,192x160"];
    let extract = |more: &[&str], out: &str| {
        let args = [&["extract", "sierra", "-o", out], &crop[..], more].concat();
        done(folder.path(), &args).out
    };
    let report = extract(&[], "a.geojson");
    let info = done(folder.path(), &["info", "a.geojson"]).out;
    // What `extract` reports about the lines is what `info` finds in the file.
    for label in ["ridges", "valleys", "line cells"] {
        let line = report.lines().find(|l| l.starts_with(label)).unwrap();
        assert!(info.lines().any(|l| l == line), "{line:?} is not in: {info}");
    }
    assert!(report.contains("parts") && report.contains("Strahler") && report.contains("wrote a.geojson"));

    let json: Value =
        serde_json::from_str(&done(folder.path(), &["info", "a.geojson", "--json"]).out).unwrap();
    assert_eq!((&json["kind"], &json["rows"], &json["cols"]), (&"sketch".into(), &192.into(), &160.into()));
    assert_eq!((&json["unit"], &json["warnings"]), (&"metres".into(), &Value::Array(vec![])));
    let cells = json["line_cells"].as_u64().unwrap();
    assert!((1500..9000).contains(&cells), "{cells} line cells of {}", 192 * 160);
    let of_kind = |kind: &str| json[kind]["line_cells"].as_u64().unwrap();
    assert_eq!(of_kind("ridges") + of_kind("valleys"), cells);
    assert!(json["valleys"]["streams_by_order"].as_array().unwrap().len() >= 2);
    let terrain: Value =
        serde_json::from_str(&done(folder.path(), &["info", "sierra", "--json"]).out).unwrap();
    assert_eq!((&terrain["kind"], &terrain["rows"]), (&"terrain".into(), &512.into()));
    assert_eq!(json["georeference"]["epsg"], terrain["georeference"]["epsg"]);

    // Stricter limits leave fewer lines; lines found with the terrain around them are others.
    extract(&["--min-order", "3", "--accumulation", "40"], "b.geojson");
    let fewer: Value =
        serde_json::from_str(&done(folder.path(), &["info", "b.geojson", "--json"]).out).unwrap();
    assert!(fewer["line_cells"].as_u64().unwrap() * 2 < cells);
    extract(&["--with-context"], "c.geojson");
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_ne!(read("a.geojson"), read("c.geojson"));
    extract(&["--paper"], "d.geojson");
    assert_ne!(read("a.geojson"), read("d.geojson"));

    done(folder.path(), &[&["render", "sierra", "-o", "a.png", "--scale", "2"], &crop[..]].concat());
    let drawn = [&["render", "sierra", "-o", "b.png", "--scale", "2", "--sketch", "a.geojson"], &crop[..]];
    done(folder.path(), &drawn.concat());
    let [plain, overlay] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    assert_eq!((png_size(&plain), png_size(&overlay)), ((320, 384), (320, 384)));
    let (plain, overlay) = (pixels(&plain), pixels(&overlay));
    let changed = plain.chunks(3).zip(overlay.chunks(3)).filter(|(a, b)| a != b).count() as u64;
    assert!((cells..12 * cells).contains(&changed), "{changed} pixels for {cells} line cells");
}

#[test]
fn sketches_lie_where_they_were_drawn() {
    let folder = temporary();
    write_hill(&folder.path().join("hill.asc"), 96);
    // One valley from cell to cell on the map of the whole terrain, in columns and rows.
    let sketch = |rows: usize, points: &str| {
        let text = format!(
            r#"{{"type":"FeatureCollection","monadnock":{{"rows":{rows},"cols":{rows},"unit":"normalised"}},"features":[
            {{"type":"Feature","properties":{{"kind":"valley"}},"geometry":{{"type":"LineString","coordinates":{points}}}}}]}}"#
        );
        std::fs::write(folder.path().join("s.geojson"), text).unwrap();
    };
    // Rows and columns between which the overlay changes the picture.
    let reach = |crop: &[&str]| {
        done(folder.path(), &[&["render", "hill.asc", "-o", "a.png"], crop].concat());
        done(
            folder.path(),
            &[&["render", "hill.asc", "-o", "b.png", "--sketch", "s.geojson"], crop].concat(),
        );
        let [a, b] = ["a.png", "b.png"].map(|name| pixels(&folder.path().join(name)));
        let width = png_size(&folder.path().join("a.png")).0 as usize;
        let changed: Vec<usize> =
            (0..a.len() / 3).filter(|i| a[3 * i..3 * i + 3] != b[3 * i..3 * i + 3]).collect();
        let rows: Vec<usize> = changed.iter().map(|i| i / width).collect();
        let cols: Vec<usize> = changed.iter().map(|i| i % width).collect();
        (
            *rows.iter().min().unwrap(),
            *rows.iter().max().unwrap(),
            *cols.iter().min().unwrap(),
            *cols.iter().max().unwrap(),
        )
    };
    let near = |found: (usize, usize, usize, usize), wanted: (usize, usize, usize, usize)| {
        let apart = [(found.0, wanted.0), (found.1, wanted.1), (found.2, wanted.2), (found.3, wanted.3)];
        assert!(apart.iter().all(|(a, b)| a.abs_diff(*b) <= 1), "{found:?}, not {wanted:?}");
    };
    sketch(96, "[[50,40,0.5],[70,40,0.6]]");
    near(reach(&[]), (40, 40, 50, 70));
    // Of the whole terrain, seen in a window; then drawn on the window itself; then on a map half as large.
    near(reach(&["--crop", "30,44,32"]), (10, 10, 6, 26));
    sketch(32, "[[5,10,0.5],[25,10,0.6]]");
    near(reach(&["--crop", "30,44,32"]), (10, 10, 5, 25));
    sketch(48, "[[20,10,0.5],[30,10,0.6]]");
    near(reach(&[]), (20, 21, 40, 61));
}

#[test]
fn palettes_and_grey_differ() {
    let folder = temporary();
    let draw = |more: &[&str]| {
        done(folder.path(), &[&["render", "grand-canyon", "--crop", "0,0,64", "-o", "p.png"], more].concat());
        pixels(&folder.path().join("p.png"))
    };
    assert_ne!(draw(&["--palette", "arid"]), draw(&[]));
    assert_eq!(draw(&["--palette", "alpine"]), draw(&[]));
    let grey = draw(&["--grey"]);
    assert_eq!(grey, draw(&["--no-colour"]));
    let spread = grey.chunks(3).map(|p| p.iter().max().unwrap() - p.iter().min().unwrap()).max().unwrap();
    assert!(spread < 40, "a grey picture has next to no hue: {spread}");
    fails(
        folder.path(),
        &["render", "sierra", "-o", "p.png", "--palette", "pink"],
        2,
        &["pink", "alpine", "lunar"],
    );
}

#[test]
fn a_sketch_of_the_whole_map_is_cropped_quietly() {
    let folder = temporary();
    let at = folder.path();
    // Bundled terrain has a place on the Earth, and so has what is extracted from it.
    done(at, &["extract", "sierra", "-o", "whole.geojson"]);
    let draw = |sketch: &str, crop: &str, out: &str| {
        done(at, &["render", "sierra", "--crop", crop, "--sketch", sketch, "-o", out])
    };
    let answer = draw("whole.geojson", "128,200,96", "a.png");
    assert_eq!(answer.err, "");
    assert!(!answer.out.contains("stretched"), "{}", answer.out);
    // The same pixels as when the whole is drawn and the window cut out of it.
    done(at, &["render", "sierra", "--sketch", "whole.geojson", "-o", "whole.png"]);
    done(at, &["render", "sierra", "-o", "bare.png"]);
    done(at, &["render", "sierra", "--crop", "128,200,96", "-o", "bare-window.png"]);
    let [whole, bare, window, bare_window] =
        ["whole.png", "bare.png", "a.png", "bare-window.png"].map(|name| pixels(&at.join(name)));
    let inner = |row: usize, col: usize| (4..92).contains(&row) && (4..92).contains(&col);
    let (mut lines, mut agreeing) = (0, 0);
    for (row, col) in (0..96).flat_map(|r| (0..96).map(move |c| (r, c))).filter(|&(r, c)| inner(r, c)) {
        let (i, j) = (3 * (row * 96 + col), 3 * ((row + 128) * 512 + col + 200));
        let drawn_here = window[i..i + 3] != bare_window[i..i + 3];
        let drawn_there = whole[j..j + 3] != bare[j..j + 3];
        lines += usize::from(drawn_there);
        agreeing += usize::from(drawn_here && drawn_there);
    }
    assert!(lines > 500 && agreeing * 100 > lines * 98, "{agreeing} of {lines}");
    // A sketch of the window alone lies where it was, and one without a line in the window is told.
    done(at, &["extract", "sierra", "--crop", "128,200,96", "-o", "window.geojson"]);
    assert_eq!(draw("window.geojson", "128,200,96", "b.png").err, "");
    let elsewhere = draw("window.geojson", "400,0,64", "c.png");
    assert!(elsewhere.err.contains("no line of the sketch lies in"), "{}", elsewhere.err);
    // As a geographic information system writes it: coordinates of the terrain, nothing said about the map.
    let mut bare: Value = serde_json::from_slice(&std::fs::read(at.join("whole.geojson")).unwrap()).unwrap();
    bare.as_object_mut().unwrap().remove("monadnock");
    std::fs::write(at.join("gis.geojson"), bare.to_string()).unwrap();
    assert!(!draw("gis.geojson", "128,200,96", "e.png").err.contains("off the map"));
    assert!(pixels(&at.join("e.png")) == pixels(&at.join("a.png")), "with and without the member");
    // What is off the whole map is still worth a word.
    let text = std::fs::read_to_string(at.join("whole.geojson")).unwrap();
    std::fs::write(
        at.join("far.geojson"),
        text.replacen("\"coordinates\":[[", "\"coordinates\":[[-9e9,-9e9,0],[", 1),
    )
    .unwrap();
    assert!(draw("far.geojson", "128,200,96", "d.png").err.contains("partly off the map of 512x512"));
}

#[test]
fn a_map_size_scales_the_drawing() {
    let folder = temporary();
    let at = folder.path();
    done(at, &["train", "sierra", "-o", "s.safetensors", "--crop", "0,0,64", "--epochs", "1", "-q"]);
    let generate = |sketch: &str, size: &[&str], out: &str| {
        done(at, &[&["generate", "s.safetensors", "--sketch", sketch, "-o", out], size].concat())
    };
    let described =
        |file: &str| -> Value { serde_json::from_str(&done(at, &["info", file, "--json"]).out).unwrap() };
    let shape = |file: &str| {
        let info = described(file);
        (info["rows"].as_u64().unwrap(), info["cols"].as_u64().unwrap())
    };
    generate("lambda-ring", &[], "own.tif");
    assert_eq!(shape("own.tif"), (128, 128));
    let answer = generate("lambda-ring", &["--size", "96x160"], "bundled.tif");
    assert_eq!(shape("bundled.tif"), (96, 160));
    assert!(answer.all().contains("scaled") && answer.all().contains("128x128"), "{}", answer.out);

    // A file that states its size is scaled, one that does not is drawn on a map of the size.
    let points = "[[10,10,0.2],[40,30,0.8]]";
    let sketch = |member: &str| {
        format!(
            r#"{{"type":"FeatureCollection",{member}"features":[{{"type":"Feature","properties":{{"kind":"ridge"}},
            "geometry":{{"type":"LineString","coordinates":{points}}}}}]}}"#
        )
    };
    let stated = r#""monadnock":{"rows":64,"cols":64,"unit":"normalised"},"#;
    std::fs::write(at.join("stated.geojson"), sketch(stated)).unwrap();
    std::fs::write(at.join("open.geojson"), sketch("")).unwrap();
    generate("stated.geojson", &["--size", "128"], "stated.tif");
    generate("open.geojson", &["--size", "128"], "open.tif");
    assert_eq!((shape("stated.tif"), shape("open.tif")), ((128, 128), (128, 128)));
    // Sketch heights are exact: the end of the ridge tells where the drawing went.
    let height = |file: &str, row: usize, col: usize| -> f32 {
        let dem =
            monadnock::dem::io::read(&at.join(file), &monadnock::dem::io::ReadOptions::default()).unwrap();
        dem.heights()[monadnock::grid::Cell::new(row, col)]
    };
    let style: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    let metre = |name: &str| style["normalization"][name].as_f64().unwrap() as f32;
    let end = metre("low") + 0.8 * (metre("high") - metre("low"));
    let near = |z: f32| (z - end).abs() < 0.02 * (metre("high") - metre("low"));
    let [scaled, placed] =
        ["stated.tif", "open.tif"].map(|file| (height(file, 60, 80), height(file, 30, 40)));
    assert!(near(scaled.0) && !near(scaled.1), "{scaled:?}, not {end} at (60, 80)");
    assert!(near(placed.1) && !near(placed.0), "{placed:?}, not {end} at (30, 40)");

    // A georeferenced sketch keeps its ground: twice the cells, half the cell size.
    done(at, &["extract", "sierra", "--crop", "64,64,64", "-o", "placed.geojson"]);
    generate("placed.geojson", &["--size", "128"], "placed.tif");
    let placed = described("placed.tif");
    assert_eq!((shape("placed.tif"), &placed["cell_size"]["x"]), ((128, 128), &15.0.into()));
    let help = done(at, &["help", "generate"]).out;
    assert!(help.contains("scaled"), "{help}");
}

/// A river with a tributary and a ridge beside them, without any height, on a map of 96 x 96.
fn open_drawing(at: &std::path::Path, name: &str, heights: &str) {
    let line = |kind: &str, points: &str| {
        format!(
            r#"{{"type":"Feature","properties":{{"kind":"{kind}"}},"geometry":{{"type":"LineString","coordinates":[{points}]}}}}"#
        )
    };
    let features = [
        line("valley", &format!("[48,10],[50,50{heights}],[44,95]")),
        line("valley", "[10,20],[47,48]"),
        line("ridge", "[80,10],[85,90]"),
    ];
    let text = format!(
        r#"{{"type":"FeatureCollection","monadnock":{{"rows":96,"cols":96,"unit":"metres"}},"features":[{}]}}"#,
        features.join(",")
    );
    std::fs::write(at.join(name), text).unwrap();
}

#[test]
fn strokes_without_heights_are_filled_and_generated() {
    let folder = temporary();
    let at = folder.path();
    done(at, &["train", "sierra", "-o", "s.safetensors", "--crop", "64,64,96", "--epochs", "1", "-q"]);
    open_drawing(at, "open.geojson", "");
    let fill = ["sketch", "fill", "open.geojson", "--style", "s.safetensors", "-o", "filled.geojson"];
    let answer = done(at, &fill);
    for word in [
        "strokes without heights: 3",
        "with some of them: 0",
        "sketch fill",
        "feature 1",
        "filled.geojson: 3 strokes",
    ] {
        assert!(answer.all().contains(word), "{word:?} is missing in: {}", answer.all());
    }
    let info: Value = serde_json::from_str(&done(at, &["info", "open.geojson", "--json"]).out).unwrap();
    assert_eq!(info["vertices_without_height"], 7);
    let filled: Value = serde_json::from_str(&done(at, &["info", "filled.geojson", "--json"]).out).unwrap();
    assert_eq!((&filled["vertices_without_height"], &filled["unit"]), (&0.into(), &"metres".into()));
    // The style's heights are those of all the terrain that it keeps.
    let terrain: Value = serde_json::from_str(&done(at, &["info", "sierra", "--json"]).out).unwrap();
    let end = |key: &str| terrain["elevation"][key].as_f64().unwrap();
    let relief = end("highest") - end("lowest");
    let height = |key: &str| filled["elevation"][key].as_f64().unwrap();
    assert!((0.02 * relief..relief).contains(&(height("highest") - height("lowest"))), "{filled}");
    // What `generate` does by itself is what `sketch fill` shows.
    let terrain = |sketch: &str, out: &str| {
        let answer = done(at, &["generate", "s.safetensors", "--sketch", sketch, "-o", out]);
        (answer.all(), std::fs::read(at.join(out)).unwrap())
    };
    let (said, own) = terrain("open.geojson", "own.tif");
    assert!(said.contains("strokes without heights: 3"), "{said}");
    assert!(own == terrain("filled.geojson", "filled.tif").1);
    // A given height stays, to the bit.
    open_drawing(at, "some.geojson", ",2345.678");
    let fill =
        ["sketch", "fill", "some.geojson", "--style", "s.safetensors", "-o", "some-filled.geojson", "-q"];
    done(at, &fill);
    assert!(
        std::fs::read_to_string(at.join("some-filled.geojson")).unwrap().contains("[50.0,50.0,2345.678]")
    );
    // A style without terrain cannot say.
    done(
        at,
        &[
            "train",
            "sierra",
            "-o",
            "n.safetensors",
            "--crop",
            "64,64,96",
            "--epochs",
            "1",
            "--no-detail",
            "--no-terrain",
            "-q",
        ],
    );
    let answer = run(at, &["generate", "n.safetensors", "--sketch", "open.geojson", "-o", "x.tif"]);
    assert_eq!((answer.code, at.join("x.tif").exists()), (1, false), "{}", answer.err);
    for word in ["n.safetensors", "terrain of the style", "not kept", "patches"] {
        assert!(answer.err.contains(word), "{word:?} is missing in: {}", answer.err);
    }
}
