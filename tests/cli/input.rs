//! What commands read, and what they refuse.

use super::{done, fails, pixels, temporary, write_hill};
use serde_json::Value;
use std::path::{Path, PathBuf};

#[test]
fn info_describes_terrain_and_says_what_it_assumes() {
    let folder = temporary();
    let text = done(folder.path(), &["info", "grand-canyon"]).out;
    for word in ["GeoTIFF", "512 rows x 512 columns", "cell size", "elevation", "voids", "none", "credit"] {
        assert!(text.contains(word), "{word:?} is missing in: {text}");
    }
    write_hill(&folder.path().join("hill.asc"), 20);
    let json = |args: &[&str]| -> Value {
        serde_json::from_str(&done(folder.path(), &[&["info", "hill.asc", "--json"], args].concat()).out)
            .unwrap()
    };
    let hill = json(&[]);
    assert_eq!((&hill["format"], &hill["voids"]), (&"ascii-grid".into(), &0.into()));
    assert_eq!(
        (&hill["cell_size"]["x"], &hill["cell_size"]["source"]),
        (&25.0.into(), &"assumed-unit".into())
    );
    let told = json(&["--cell-size", "10,12.5"]);
    assert_eq!((&told["cell_size"]["y"], &told["cell_size"]["source"]), (&12.5.into(), &"caller".into()));
    let mean = hill["elevation"]["mean"].as_f64().unwrap();
    assert!(
        hill["elevation"]["lowest"].as_f64().unwrap() < mean
            && mean < hill["elevation"]["highest"].as_f64().unwrap()
    );
}

#[test]
fn bad_input_is_named() {
    let folder = temporary();
    let at = folder.path();
    std::fs::write(at.join("torn.tif"), b"II*\0\x08\0\0\0").unwrap();
    std::fs::write(at.join("bad.geojson"), r#"{"type":"FeatureCollection","features":[{"type":"Feature",
        "properties":{"kind":"motorway"},"geometry":{"type":"LineString","coordinates":[[1,2,3],[4,5,6]]}}]}"#).unwrap();
    std::fs::write(at.join("no.safetensors"), b"nothing").unwrap();
    std::fs::write(
        at.join("level.asc"),
        format!("ncols 30\nnrows 30\nxllcorner 0\nyllcorner 0\ncellsize 1\n{}", "7 ".repeat(900)),
    )
    .unwrap();
    write_hill(&at.join("hill.asc"), 40);

    // Failures: exit code 1.
    fails(at, &["info", "gone.tif"], 1, &["gone.tif", "not there"]);
    fails(at, &["info", "atlantis"], 1, &["atlantis", "sierra, grand-canyon"]);
    fails(at, &["info", "torn.tif"], 1, &["torn.tif"]);
    fails(at, &["info", "bad.geojson"], 1, &["bad.geojson", "motorway", "ridge"]);
    fails(at, &["info", "no.safetensors"], 1, &["no.safetensors"]);
    fails(at, &["info", "hill.asc", "--band", "2"], 1, &["hill.asc", "2"]);
    fails(
        at,
        &["render", "sierra", "--crop", "500,0,64", "-o", "x.png"],
        1,
        &["--crop", "64x64 at row 500", "512x512"],
    );
    fails(at, &["render", "sierra", "--scale", "65", "-o", "x.png"], 1, &["65", "1 to 64"]);
    fails(at, &["render", "hill.asc", "-o", "no/x.png"], 1, &["no/x.png", "folder"]);
    fails(at, &["render", "hill.asc", "-o", "x.png", "--sketch", "gone.geojson"], 1, &["gone.geojson"]);
    fails(
        at,
        &["extract", "hill.asc", "-o", "x.geojson", "--min-order", "0"],
        1,
        &["min_order", "0", "1 to 30"],
    );
    fails(at, &["extract", "level.asc", "-o", "x.geojson"], 1, &["level.asc", "ridges and valleys is 0"]);

    // Command lines that cannot be understood: exit code 2.
    fails(at, &["extract", "sierra", "-o", "x", "--crop", "1,2"], 2, &["--crop", "1,2", "ROWSxCOLS"]);
    fails(at, &["info", "sierra", "--elevation", "900,-3"], 2, &["--elevation", "900,-3", "MIN,MAX"]);
    fails(at, &["info", "sierra", "--cell-size", "-30"], 2, &["--cell-size", "-30"]);
    fails(at, &["info", "sierra", "--threads", "many"], 2, &["--threads", "many"]);
    fails(at, &["info", "sierra", "--threads", "100000"], 2, &["--threads", "100000", "1024"]);
    fails(at, &["info", "sierra", "--seed", "-1"], 2, &["-1"]);
    fails(at, &["extract", "sierra"], 2, &["--output"]);
    fails(at, &["extract", "sierra", "-o", "x", "--with-context"], 2, &["--crop"]);
    fails(at, &["dig", "sierra"], 2, &["dig"]);
    fails(at, &["completions", "abacus"], 2, &["abacus", "bash"]);

    let left = std::fs::read_dir(at).unwrap().map(|entry| entry.unwrap().path());
    let new: Vec<PathBuf> = left.filter(|p| p.file_stem().is_some_and(|s| s == "x")).collect();
    assert!(new.is_empty(), "a failed run leaves no file: {new:?}");
}

#[test]
fn options_for_another_format_are_refused_by_name() {
    let folder = temporary();
    let at = folder.path();
    write_hill(&at.join("hill.asc"), 40);
    for file in ["hill.asc", "sierra"] {
        let with_range = ["info", file, "--elevation", "300,2100"];
        fails(at, &with_range, 1, &[file, "--elevation", "300,2100", "PNG"]);
    }
    done(at, &["train", "sierra", "-o", "s.safetensors", "--crop", "0,0,64", "--epochs", "1", "-q"]);
    done(
        at,
        &["generate", "s.safetensors", "--sketch", "single-stroke", "-o", "a.png", "--elevation", "300,900"],
    );
    done(at, &["info", "a.png", "--elevation", "0,1000"]);
    // A level of a PNG can be a void.
    let voids = |nodata: &str| {
        let out = done(at, &["info", "a.png", "--json", "--nodata", nodata]).out;
        serde_json::from_str::<Value>(&out).unwrap()["voids"].as_u64().unwrap()
    };
    assert_eq!((voids("none"), voids("70000")), (0, 0));
    assert!(voids("1") + voids("65535") > 0, "the lowest and the highest level are there");
    fails(
        at,
        &["info", "a.png", "--metres-per-unit", "0.3048"],
        1,
        &["a.png", "--metres-per-unit", "0.3048", "not for PNG", "--elevation"],
    );
    // They still do what they are for.
    let lowest = |args: &[&str]| {
        let out = done(at, &[&["info", "hill.asc", "--json"], args].concat()).out;
        serde_json::from_str::<Value>(&out).unwrap()["elevation"]["lowest"].as_f64().unwrap()
    };
    assert!((lowest(&["--metres-per-unit", "0.5"]) - lowest(&[]) / 2.0).abs() < 1e-3);
}

#[test]
fn bundled_names_mean_the_same_to_every_verb() {
    let folder = temporary();
    let at = folder.path();
    let sketch: Value = serde_json::from_str(&done(at, &["info", "lambda-ring", "--json"]).out).unwrap();
    assert_eq!((&sketch["kind"], &sketch["rows"]), (&"sketch".into(), &128.into()));
    done(at, &["render", "sierra", "--crop", "0,0,128", "-o", "plain.png"]);
    done(at, &["render", "sierra", "--crop", "0,0,128", "-o", "lines.png", "--sketch", "lambda-ring"]);
    let [plain, lines] = ["plain.png", "lines.png"].map(|name| pixels(&at.join(name)));
    assert_ne!(plain, lines);
    // A file of that name comes first, and unknown names list the known ones.
    std::fs::write(at.join("meander"), b"not a sketch").unwrap();
    fails(at, &["render", "sierra", "--sketch", "meander", "-o", "x.png"], 1, &["meander", "JSON"]);
    fails(at, &["render", "sierra", "--sketch", "omega", "-o", "x.png"], 1, &["omega", "lambda-ring"]);
    fails(at, &["info", "omega"], 1, &["omega", "sierra", "lambda-ring"]);
    let about = done(at, &["info", "--help"]).out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(about.contains("sierra, grand-canyon") && about.contains("lambda-ring"), "{about}");
}

#[test]
fn what_is_read_is_never_written_over() {
    let folder = temporary();
    let at = folder.path();
    write_hill(&at.join("hill.asc"), 48);
    let before = std::fs::read(at.join("hill.asc")).unwrap();
    for verb in ["extract", "train", "render"] {
        fails(at, &[verb, "hill.asc", "-o", "./hill.asc"], 1, &["./hill.asc", "the same file as hill.asc"]);
    }
    assert_eq!(std::fs::read(at.join("hill.asc")).unwrap(), before);
    let style = ["train", "hill.asc", "-o", "s.safetensors", "--epochs", "1", "--set", "model.extractions=1"];
    done(at, &style);
    for name in ["s.safetensors", "t.xyz", "t.tif.gz"] {
        let words = if name == "s.safetensors" { "the same file as" } else { "file extension" };
        fails(at, &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", name], 1, &[name, words]);
    }
}

/// Hills on cells of `dx` by `dy` metres, the same ground whatever the cells.
fn write_ground(path: &Path, dx: f64, dy: f64) {
    let (rows, cols) = ((2400.0 / dy) as usize, (2400.0 / dx) as usize);
    let mut text = format!("ncols {cols}\nnrows {rows}\nxllcorner 0\nyllcorner 0\ndx {dx}\ndy {dy}\n");
    for row in 0..rows {
        for col in 0..cols {
            let (x, y) = ((col as f64 + 0.5) * dx / 260.0, (row as f64 + 0.5) * dy / 310.0);
            text += &format!("{:.2} ", 500.0 + 80.0 * x.sin() * y.cos() + 40.0 * (x * 0.7 - y).sin());
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn oblong_cells_are_resampled_and_said_so() {
    let folder = temporary();
    let at = folder.path();
    write_ground(&at.join("wide.asc"), 50.0, 25.0);
    write_ground(&at.join("square.asc"), 25.0, 25.0);
    let said = done(at, &["extract", "wide.asc", "-o", "wide.geojson"]).all();
    assert!(said.contains("50 m west-east, 25 m north-south"), "{said}");
    assert!(said.contains("68x68 square cells of 35.29 m"), "{said}");
    let kept = done(at, &["extract", "wide.asc", "-o", "kept.geojson", "--keep-cells"]);
    assert!(kept.err.contains("as if they were square") && !kept.out.contains("resampled"), "{}", kept.err);
    let square = done(at, &["extract", "square.asc", "-o", "square.geojson"]);
    assert!(!(square.out + &square.err).contains("square cells"), "nothing to say");

    // The lines lie where those of the same ground on square cells lie, within two cells.
    let vertices = |name: &str| -> Vec<(f64, f64)> {
        let json: Value = serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap();
        let points = json["features"].as_array().unwrap().iter();
        let points = points.flat_map(|f| f["geometry"]["coordinates"].as_array().unwrap());
        points.map(|v| (v[0].as_f64().unwrap(), v[1].as_f64().unwrap())).collect()
    };
    let (wide, truth) = (vertices("wide.geojson"), vertices("square.geojson"));
    let near = |p: &&(f64, f64)| truth.iter().any(|t| (t.0 - p.0).hypot(t.1 - p.1) < 72.0);
    let share = wide.iter().filter(near).count() as f64 / wide.len() as f64;
    assert!(wide.len() > 20 && share > 0.9, "{share} of {}", wide.len());

    let train = ["train", "wide.asc", "-o", "s.safetensors", "--epochs", "2", "--set", "model.extractions=1"];
    assert!(done(at, &train).all().contains("resampled"));
    let style: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    assert_eq!((&style["exemplar"]["rows"], &style["exemplar"]["cols"]), (&68.into(), &68.into()));
    assert!(done(at, &["info", "wide.asc"]).out.contains("cells are not square"));
}
