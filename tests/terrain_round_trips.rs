//! What is written comes back: heights, voids, cell size, place.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

use monadnock::dem::crs::Crs;
use monadnock::dem::io::{Nodata, ReadOptions, SampleType, WriteOptions, read, read_described, write};
use monadnock::dem::{CellSize, Dem, Georeference, Normalization, RasterSpace};
use monadnock::grid::{Cell, Grid, Window};
use proptest::prelude::*;

fn there_and_back(dem: &Dem, name: &str, options: &WriteOptions) -> Dem {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    write(dem, &path, options).unwrap();
    read(&path, &ReadOptions::default()).unwrap()
}

fn hills(rows: usize, cols: usize, void_every: usize) -> Dem {
    let heights =
        Grid::from_fn(rows, cols, |c| 1000.0 + (c.row as f32 * 0.7).sin() * 300.0 + c.col as f32 / 3.0);
    let valid = Grid::from_fn(rows, cols, |c| (c.row * cols + c.col) % void_every != 1);
    Dem::with_voids(heights, valid, CellSize::new(30.0, 25.0).unwrap()).unwrap()
}

fn places() -> Vec<(Georeference, CellSize)> {
    let mut found = Vec::new();
    for raster_space in [RasterSpace::PixelIsArea, RasterSpace::PixelIsPoint] {
        let (s, c) = 0.5f64.sin_cos();
        for (transform, epsg, x, y) in [
            ([30.0, 0.0, 300_000.0, 0.0, -25.0, 4_100_000.0], Some(32611), 30.0, 25.0),
            ([30.0, 0.0, 7680.0, 0.0, -25.0, 23040.0], None, 30.0, 25.0),
            ([1.0 / 3600.0, 0.0, -118.0, 0.0, -1.0 / 1800.0, 37.0], Some(4326), 24.7, 61.7),
            ([1.0 / 3600.0, 0.0, 30.0, 0.0, -1.0 / 3600.0, 37.0], None, 30.9, 30.8),
            ([100.0, 0.0, 980_000.0, 0.0, -100.0, 200_000.0], Some(2263), 30.480_060_96, 30.480_060_96),
            ([76.437, 0.0, -12_601_676.0, 0.0, -76.437, 4_344_030.97], Some(3857), 61.7, 61.7),
            ([30.0 * c, 25.0 * s, 3e5, 30.0 * s, -25.0 * c, 4.1e6], Some(32611), 30.0, 25.0),
            ([30.0 * c, 25.0 * s, 3e5, 30.0 * s, -25.0 * c, 4.1e6], None, 30.0, 25.0),
        ] {
            found.push((
                Georeference { transform, epsg, definition: None, raster_space },
                CellSize::new(x, y).unwrap(),
            ));
        }
    }
    // Systems that no code names, and lengths at no known place.
    for (text, x, y) in [
        ("+proj=lcc +lat_1=33 +lat_2=45 +lat_0=39 +lon_0=-96 +datum=NAD83 +units=us-ft", 30.480_060_96, 25.4),
        ("+proj=merc +lon_0=10 +k=0.9 +datum=WGS84", 27.0, 22.5),
        ("+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +datum=NAD83", 100.0, 80.0),
        ("+proj=laea +lat_0=45 +lon_0=-100 +datum=WGS84", 100.0, 80.0),
        ("+proj=stere +lat_0=90 +lat_ts=71 +lon_0=-45 +datum=WGS84", 100.0, 80.0),
        ("+proj=tmerc +lat_0=40 +lon_0=-117 +k=0.9999 +x_0=1000 +datum=NAD83 +units=ft", 30.48, 24.384),
        ("+proj=eqc +lat_ts=30 +datum=WGS84", 100.0, 80.0),
        ("+proj=longlat +R=1737400", 3.0e6, 2.4e6),
        ("LOCAL_CS[\"x\",UNIT[\"foot\",0.3048]]", 30.48, 24.384),
        ("LOCAL_CS[\"x\",UNIT[\"rod\",5.0292]]", 502.92, 402.336),
    ] {
        let definition = Crs::parse(text).unwrap();
        let degrees = definition.metres_per_unit().is_none();
        let transform = if degrees {
            [0.01, 0.0, 8.0, 0.0, -0.008, 47.0]
        } else {
            [100.0, 0.0, 3000.0, 0.0, -80.0, 5000.0]
        };
        let place = Georeference {
            transform,
            epsg: None,
            definition: Some(definition),
            raster_space: RasterSpace::PixelIsArea,
        };
        found.push((place, CellSize::new(x, y).unwrap()));
    }
    found
}

#[test]
fn geotiff_gives_everything_back_at_every_place() {
    let plain = hills(67, 41, 9);
    for (place, size) in places() {
        let dem =
            Dem::with_voids(plain.heights().clone(), plain.valid().clone(), size).unwrap().at(Some(place));
        let back = there_and_back(&dem, "a.tif", &WriteOptions::default());
        assert_eq!(back.heights(), dem.heights());
        assert_eq!(back.valid(), dem.valid());
        // A place of no stated system comes back as one in metres, which its cell size says.
        let placed = *back.georeference().unwrap();
        let metres = place.epsg.is_none() && place.definition.is_none() && place.transform[0] > 1.0;
        let definition = if metres { Crs::local(1.0).ok() } else { place.definition };
        assert_eq!(placed, Georeference { definition, ..place });
        assert_eq!(back.cell_size(), dem.cell_size(), "{place:?}");
        // Once more, for the cell size may now come from the coordinates.
        assert_eq!(there_and_back(&back, "b.tiff", &WriteOptions::default()), back);
    }
}

#[test]
fn a_window_keeps_its_place_and_cell_size() {
    let (place, size) = places()[2];
    let plain = hills(67, 41, 9);
    let dem = Dem::with_voids(plain.heights().clone(), plain.valid().clone(), size).unwrap().at(Some(place));
    let window = dem.crop(Window::new(Cell::new(10, 20), 30, 12)).unwrap();
    assert_eq!(there_and_back(&window, "a.tif", &WriteOptions::default()), window);
}

#[test]
fn geotiff_without_a_place_is_placed_at_the_origin() {
    let dem = hills(20, 30, 7);
    let back = there_and_back(&dem, "a.tif", &WriteOptions::default());
    assert_eq!(
        (back.heights(), back.valid(), back.cell_size()),
        (dem.heights(), dem.valid(), dem.cell_size())
    );
    let place = back.georeference().unwrap();
    assert_eq!(place.to_model(0.0, 20.0), (0.0, 0.0));
    assert_eq!(place.epsg, None);
    // Two-centimetre cells could be degrees, were it not for the recorded size.
    let tiny = Dem::new(dem.heights().clone(), CellSize::square(0.01).unwrap()).unwrap();
    assert_eq!(there_and_back(&tiny, "a.tif", &WriteOptions::default()).cell_size(), tiny.cell_size());
}

#[test]
fn int16_rounds_to_metres_or_refuses() {
    let dem = hills(300, 500, 11);
    let options = WriteOptions { sample_type: SampleType::Int16, ..Default::default() };
    let back = there_and_back(&dem, "a.tif", &options);
    assert_eq!(back.valid(), dem.valid());
    for (a, b) in back.heights().as_slice().iter().zip(dem.heights().as_slice()) {
        assert_eq!(*a, b.round());
    }
    let high = Dem::new(Grid::filled(2, 2, 40_000.0), CellSize::square(1.0).unwrap()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.tif");
    let message = write(&high, &path, &options).unwrap_err().to_string();
    assert!(message.contains("40000") && message.contains("32767"), "{message}");
    assert!(!path.exists());
}

#[test]
fn png_remembers_range_voids_cell_size_and_place() {
    for (place, size) in places() {
        let plain = hills(33, 21, 8);
        let dem =
            Dem::with_voids(plain.heights().clone(), plain.valid().clone(), size).unwrap().at(Some(place));
        let back = there_and_back(&dem, "a.png", &WriteOptions::default());
        assert_eq!(
            (back.valid(), back.cell_size(), back.georeference()),
            (dem.valid(), dem.cell_size(), dem.georeference())
        );
        let (low, high) = dem.range();
        let half_level = (high - low) / 65534.0 / 2.0 + 1e-4;
        for (a, b) in back.heights().as_slice().iter().zip(dem.heights().as_slice()) {
            assert!((a - b).abs() <= half_level, "{a} {b}");
        }
    }
}

#[test]
fn png_keeps_to_a_given_range() {
    let dem = hills(9, 9, 5);
    let range = |low, high| WriteOptions {
        elevation: Some(Normalization::new(low, high).unwrap()),
        ..Default::default()
    };
    let back = there_and_back(&dem, "a.png", &range(0.0, 8848.0));
    assert!((back.range().0 - dem.range().0).abs() < 0.07);
    let dir = tempfile::tempdir().unwrap();
    let message = write(&dem, &dir.path().join("a.png"), &range(0.0, 900.0)).unwrap_err().to_string();
    assert!(message.contains("elevation range") && message.contains("0,900"), "{message}");
    let flat = Dem::new(Grid::filled(3, 3, 7.5), CellSize::square(2.0).unwrap()).unwrap();
    assert_eq!(there_and_back(&flat, "a.png", &WriteOptions::default()), flat);
}

#[test]
fn npy_and_ascii_keep_heights_and_voids() {
    let dem = hills(17, 23, 6);
    let back = there_and_back(&dem, "a.npy", &WriteOptions::default());
    assert_eq!((back.heights(), back.valid()), (dem.heights(), dem.valid()));
    assert_eq!(back.cell_size(), CellSize::square(1.0).unwrap());

    let back = there_and_back(&dem, "a.asc", &WriteOptions::default());
    assert_eq!(
        (back.heights(), back.valid(), back.cell_size()),
        (dem.heights(), dem.valid(), dem.cell_size())
    );
    // A metric place is kept; a height of -9999 is not mistaken for a void.
    for raster_space in [RasterSpace::PixelIsArea, RasterSpace::PixelIsPoint] {
        let place = Georeference {
            transform: [30.0, 0.0, 7680.0, 0.0, -25.0, 23040.0],
            epsg: None,
            definition: None,
            raster_space,
        };
        let mut heights = dem.heights().clone();
        heights[Cell::new(0, 0)] = -9999.0;
        let deep = Dem::with_voids(heights, dem.valid().clone(), dem.cell_size()).unwrap().at(Some(place));
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.asc");
        write(&deep, &path, &WriteOptions::default()).unwrap();
        // Alone among hills it is refused until somebody says that it is a height.
        assert!(
            read(&path, &ReadOptions::default()).unwrap_err().to_string().contains("--nodata -99999,-9999")
        );
        let voids = Nodata::Value(-99999.0);
        assert_eq!(read(&path, &ReadOptions { nodata: voids, ..Default::default() }).unwrap(), deep);
    }
}

#[test]
fn unknown_extensions_are_listed() {
    let dem = hills(3, 3, 50);
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.jpg", "a.hgt", "terrain", "a.TIFFANY"] {
        let message = write(&dem, &dir.path().join(name), &WriteOptions::default()).unwrap_err().to_string();
        assert!(message.contains("extension") && message.contains(".npy"), "{message}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    write(&dem, &dir.path().join("a.TIF"), &WriteOptions::default()).unwrap();
}

#[test]
fn the_same_dem_is_the_same_bytes() {
    let dem = hills(700, 600, 13);
    let dir = tempfile::tempdir().unwrap();
    let bytes = |threads: usize, name: &str| {
        let path = dir.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write(&dem, &path, &WriteOptions::default())).unwrap();
        std::fs::read(path).unwrap()
    };
    assert_eq!(bytes(1, "1.tif"), bytes(3, "3.tif"));
}

#[test]
fn the_description_tells_how_a_file_is_packed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.tif");
    write(&hills(700, 600, 13), &path, &WriteOptions::default()).unwrap();
    let (_, said) = read_described(&path, &ReadOptions::default()).unwrap();
    assert_eq!((said.sample, said.packing.as_str()), ("f32", "deflate, predictor 3, 7 strips of 600x109"));
    assert_eq!(said.coordinates, "local, metre");
}

fn any_dem() -> impl Strategy<Value = Dem> {
    (2usize..20, 2usize..20).prop_flat_map(|(rows, cols)| {
        let height = prop_oneof![-500f32..9000.0, Just(0.0), Just(-9999.0), Just(-32768.0), Just(-0.0)];
        let cells = proptest::collection::vec((height, proptest::bool::weighted(0.8)), rows * cols);
        (cells, 1e-3..1e4f64, 1e-3..1e4f64).prop_filter_map("all void", move |(cells, x, y)| {
            let (heights, valid): (Vec<f32>, Vec<bool>) = cells.into_iter().unzip();
            let heights = Grid::from_vec(rows, cols, heights).ok()?;
            let valid = Grid::from_vec(rows, cols, valid).ok()?;
            Dem::with_voids(heights, valid, CellSize::new(x, y).ok()?).ok()
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_dem_survives_geotiff_npy_and_ascii(dem in any_dem()) {
        let dir = tempfile::tempdir().unwrap();
        // An .npy declares no nodata and no cell size; small cells of an .asc could be degrees.
        let given = Some(dem.cell_size());
        for (name, cell_size) in [("a.tif", None), ("a.npy", given), ("a.asc", given)] {
            let path = dir.path().join(name);
            write(&dem, &path, &WriteOptions::default()).unwrap();
            // Some of the heights are popular as markers: here it is known that they are none.
            let nodata = match std::fs::read_to_string(&path) {
                Ok(text) => Nodata::Value(text.split("nodata_value ").nth(1).unwrap().split('\n').next().unwrap().parse().unwrap()),
                Err(_) => Nodata::None,
            };
            let back = read(&path, &ReadOptions { nodata, cell_size, ..Default::default() }).unwrap();
            prop_assert_eq!(back.heights(), dem.heights());
            prop_assert_eq!(back.valid(), dem.valid());
            prop_assert_eq!(back.cell_size(), dem.cell_size());
        }
    }
}

/// Leaves files of every format for `tests/oracle/read_written.py`, which reads them with other programs.
#[test]
#[ignore = "writes files for another program to read"]
fn leave_files_for_other_programs() {
    let directory = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("written");
    std::fs::create_dir_all(&directory).unwrap();
    let plain = hills(301, 211, 9);
    for (i, (place, size)) in places().into_iter().enumerate() {
        let dem =
            Dem::with_voids(plain.heights().clone(), plain.valid().clone(), size).unwrap().at(Some(place));
        write(&dem, &directory.join(format!("{i}.tif")), &WriteOptions::default()).unwrap();
        let space = match place.raster_space {
            RasterSpace::PixelIsArea => "Area",
            RasterSpace::PixelIsPoint => "Point",
        };
        let words = serde_json::json!({
            "transform": place.transform, "epsg": place.epsg, "space": space, "definition": place.definition,
        });
        std::fs::write(directory.join(format!("{i}.json")), words.to_string()).unwrap();
    }
    let int16 = WriteOptions { sample_type: SampleType::Int16, ..Default::default() };
    write(&plain, &directory.join("int16.tif"), &int16).unwrap();
    for name in ["plain.npy", "plain.png", "plain.asc"] {
        write(&plain, &directory.join(name), &WriteOptions::default()).unwrap();
    }
    println!("{}", directory.display());

    // And how long a whole SRTM tile of 1 arc-second takes.
    let tile = Dem::new(
        Grid::from_fn(3601, 3601, |c| {
            2000.0 + (c.row as f32 / 90.0).sin() * 900.0 + (c.col as f32 / 31.0).cos() * 300.0
        }),
        CellSize::square(30.0).unwrap(),
    )
    .unwrap();
    for name in ["tile.tif", "tile.npy", "tile.png", "tile.asc"] {
        let path = directory.join(name);
        let started = std::time::Instant::now();
        write(&tile, &path, &WriteOptions::default()).unwrap();
        let written = started.elapsed();
        let started = std::time::Instant::now();
        read(&path, &ReadOptions::default()).unwrap();
        let size = std::fs::metadata(&path).unwrap().len();
        println!("{name}: written in {written:.2?}, read in {:.2?}, {size} bytes", started.elapsed());
        std::fs::remove_file(path).unwrap();
    }
}
