//! What terrain files say, half say, or say beside themselves: place, units, ground size, validity. Nothing is guessed in
//! silence; what the caller says comes first.
//!
//! Each situation of the collection in `../shared/cases` that is about terrain, where that is there, and two more of its
//! kind that are made here.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

mod crafted;

use ::png::{BitDepth, ColorType};
use crafted::{Tiff, npy_f32, png};
use monadnock::dem::io::{CellSizeSource, Description, Nodata, ReadOptions, read_described};
use monadnock::dem::{CellSize, Dem, Normalization, RasterSpace};
use std::io::Write;
use std::path::{Path, PathBuf};

type Read = monadnock::Result<(Dem, Description)>;

const DEFAULT: ReadOptions = ReadOptions {
    elevation: None,
    cell_size: None,
    band: None,
    nodata: Nodata::AsDeclared,
    metres_per_unit: None,
};

const US_FOOT: f64 = 1200.0 / 3937.0;

/// A file of the collection.
fn case(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases").join(name);
    if !path.exists() {
        eprintln!("skipped: no {}", path.display());
        return None;
    }
    Some(path)
}

/// Reads the first of `files`, the others beside it.
fn read_files(files: &[(&str, &[u8])], options: &ReadOptions) -> Read {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    read_described(&folder.path().join(files[0].0), options)
}

#[track_caller]
fn refused(read: Read, words: &[&str]) {
    let message = read.map(|(dem, said)| (dem.range(), said)).expect_err("must be refused").to_string();
    for word in words {
        assert!(message.contains(word), "{word:?} is not in: {message}");
    }
    assert!(message.len() < 420, "too long: {message}");
}

#[track_caller]
fn told(said: &Description, words: &[&str]) {
    let all = [said.notes.join("\n"), said.warnings.join("\n")].join("\n");
    for word in words {
        assert!(all.contains(word), "{word:?} is not in: {all}");
    }
}

#[track_caller]
fn cells(dem: &Dem, x: f64, y: f64) {
    let (found, near) = (dem.cell_size(), |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3);
    assert!(near(found.x(), x) && near(found.y(), y), "{found:?} is not {x} x {y}");
}

/// Heights from 1500 m on, 12 x 10 cells.
fn slope() -> Vec<f32> {
    (0..120u16).map(|i| 1500.0 + f32::from(i)).collect()
}

fn tiff() -> Tiff {
    Tiff::f32(12, 10, &slope())
}

/// Places the raster's north-west corner.
fn at(tiff: Tiff, side: f64, x: f64, y: f64) -> Tiff {
    tiff.doubles(33550, &[side, side, 0.0]).doubles(33922, &[0.0, 0.0, 0.0, x, y, 0.0])
}

/// GeoKeys of short codes.
fn keys(tiff: Tiff, keys: &[(u32, u32)]) -> Tiff {
    let mut directory = vec![1, 1, 0, keys.len() as u32];
    directory.extend(keys.iter().flat_map(|&(key, value)| [key, 0, 1, value]));
    tiff.short(34735, &directory)
}

/// In the projected system of an EPSG code, 30 units a cell.
fn projected(code: u32) -> Tiff {
    keys(at(tiff(), 30.0, 500_000.0, 4_100_000.0), &[(1024, 1), (1025, 1), (3072, code)])
}

fn asc(header: &str) -> Vec<u8> {
    let heights: Vec<String> = slope().iter().map(f32::to_string).collect();
    format!("ncols 10\nnrows 12\n{header}\n{}\n", heights.join(" ")).into_bytes()
}

const METRES: &str = "xllcorner 500000\nyllcorner 4100000\ncellsize 30";

#[test]
fn heights_in_other_units_become_metres() {
    if let Some(path) = case("vertical-6360.tif") {
        let (dem, said) = read_described(&path, &DEFAULT).unwrap();
        let (low, high) = dem.range();
        assert!((low - 1709.0).abs() < 0.5 && (high - 2358.0).abs() < 0.5, "{low} {high}");
        told(&said, &["heights converted to metres", "US survey foot"]);
    }
    let lowest = |tiff: Tiff, options: &ReadOptions| {
        let (dem, said) = read_files(&[("a.tif", &tiff.bytes())], options).unwrap();
        (f64::from(dem.range().0), said)
    };
    // A vertical system in feet (NAVD88 in US feet is the collection's), and a unit by its key.
    let compound = |vertical: (u32, u32)| {
        keys(at(tiff(), 30.0, 5e5, 4.1e6), &[(1024, 1), (1025, 1), (3072, 26911), vertical])
    };
    for (key, metres) in
        [((4096, 8228), 0.3048), ((4099, 9003), US_FOOT), ((4099, 9014), 1.8288), ((4096, 5703), 1.0)]
    {
        let (low, said) = lowest(compound(key), &DEFAULT);
        assert!((low / (1500.0 * metres) - 1.0).abs() < 1e-6, "{key:?}: {low}");
        assert_eq!(said.notes.iter().any(|n| n.contains("converted")), metres != 1.0);
    }
    // Unknown: said, or refused where a unit is named; the caller overrules either.
    let (low, said) = lowest(compound((4096, 32_000)), &DEFAULT);
    assert_eq!(low, 1500.0);
    told(&said, &["EPSG:32000", "taken for metres", "--metres-per-unit"]);
    let strange = compound((4099, 9102)).bytes();
    refused(
        read_files(&[("a.tif", &strange)], &DEFAULT),
        &["a.tif", "VerticalUnitsGeoKey", "9102", "--metres-per-unit"],
    );
    let furlongs =
        r#"<GDALMetadata><Item name="UNITTYPE" sample="0" role="unittype">furlong</Item></GDALMetadata>"#;
    let furlongs = tiff().text(42112, furlongs);
    refused(read_files(&[("a.tif", &furlongs.bytes())], &DEFAULT), &["furlong", "--metres-per-unit"]);
    let given = ReadOptions { metres_per_unit: Some(2.0), ..DEFAULT };
    for tiff in [compound((4096, 8228)), compound((4099, 9102)), furlongs] {
        assert_eq!(lowest(tiff, &given).0, 3000.0);
    }
}

#[test]
fn linear_units_follow_from_codes() {
    if let Some(path) = case("clarke-foot.tif") {
        let (dem, _) = read_described(&path, &DEFAULT).unwrap();
        cells(&dem, 30.48, 30.48);
        let given = ReadOptions { cell_size: CellSize::square(30.0).ok(), ..DEFAULT };
        assert_eq!(read_described(&path, &given).unwrap().0.cell_size().x(), 30.0);
    }
    // Of the code alone: US feet, international feet, links.
    for (code, metres, x, y) in
        [(2227, US_FOOT, 6.5e6, 1.9e6), (2223, 0.3048, 7e5, 8e5), (3167, 20.116_756, 40_000.0, 22_000.0)]
    {
        let tiff = at(projected(code), 30.0, x, y);
        let (dem, said) = read_files(&[("a.tif", &tiff.bytes())], &DEFAULT).unwrap();
        assert!((dem.cell_size().x() / (30.0 * metres) - 1.0).abs() < 0.011, "{code}: {:?}", dem.cell_size());
        assert_eq!(said.cell_size_source, CellSizeSource::File);
        assert_eq!(dem.georeference().unwrap().epsg, Some(code));
    }
    // Of a key: a chain; one that defines its own; one that contradicts the code; one beside a code that nobody knows.
    let unit = |code: u32, unit: u32| {
        keys(at(tiff(), 30.0, 5e5, 4.1e6), &[(1024, 1), (1025, 1), (3072, code), (3076, unit)])
    };
    let side = |tiff: &Tiff| {
        read_files(&[("a.tif", &tiff.bytes())], &DEFAULT).map(|(dem, said)| (dem.cell_size().x(), said))
    };
    let (link, _) = side(&unit(32_767, 9098)).unwrap();
    assert!((link / (30.0 * 0.201_168) - 1.0).abs() < 1e-9, "{link}");
    let (feet, said) = side(&unit(32_611, 9002)).unwrap();
    assert!((feet / 9.144 - 1.0).abs() < 0.01, "{feet}");
    told(&said, &["EPSG:32611", "metre", "foot", "the file counts"]);
    let (feet, said) = side(&unit(29_999, 9003)).unwrap();
    assert!((feet / (30.0 * US_FOOT) - 1.0).abs() < 1e-9, "{feet}");
    told(&said, &["EPSG:29999", "US survey foot"]);
    let own = unit(32_767, 32_767).doubles(34736, &[2.5]);
    let own = own.short(
        34735,
        &[1, 1, 0, 5, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32767, 3076, 0, 1, 32767, 3077, 34736, 1, 0],
    );
    assert_eq!(side(&own).unwrap().0, 75.0);
    refused(
        read_files(&[("a.tif", &unit(32_767, 9101).bytes())], &DEFAULT),
        &["ProjLinearUnitsGeoKey", "9101", "--cell-size"],
    );
    let given = ReadOptions { cell_size: CellSize::square(7.0).ok(), ..DEFAULT };
    let (dem, said) = read_files(&[("a.tif", &unit(32_767, 9101).bytes())], &given).unwrap();
    assert_eq!(dem.cell_size().x(), 7.0);
    told(&said, &["ProjLinearUnitsGeoKey is 9101", "not used"]);
    // An unknown code: metres are assumed, and every command says so.
    let (side, said) = side(&projected(29_999)).unwrap();
    assert_eq!((side, said.cell_size_source), (30.0, CellSizeSource::AssumedUnit));
    told(&said, &["EPSG:29999", "taken for metres", "--cell-size"]);
}

#[test]
fn stretched_maps_are_measured_on_the_ground() {
    for name in ["mercator-3395.tif", "mercator-user.tif"] {
        let Some(path) = case(name) else { continue };
        let (dem, said) = read_described(&path, &DEFAULT).unwrap();
        let side = dem.cell_size().x();
        assert!((29.9..30.2).contains(&side), "{name}: {side}");
        told(&said, &["60 m", "on the ground"]);
    }
    let ground = |code: u32, side: f64, x: f64, y: f64| {
        let tiff = keys(at(tiff(), side, x, y), &[(1024, 1), (1025, 1), (3072, code)]);
        let (dem, said) = read_files(&[("a.tif", &tiff.bytes())], &DEFAULT).unwrap();
        (dem, said)
    };
    // At 60 N: Esri's code of world mercator, equirectangular, web mercator; near the pole nothing is stretched.
    cells(&ground(54_004, 60.0, 1e6, 8_362_698.5).0, 30.08, 30.08);
    let (plate, said) = ground(4087, 60.0, 1_113_195.0, 6_654_073.0);
    cells(&plate, 30.08, 60.0);
    told(&said, &["60 m", "30.08 x 60 m on the ground"]);
    cells(&ground(3857, 60.0, 1e6, 8_399_738.0).0, 30.0, 30.0);
    let (polar, said) = ground(3413, 100.0, 0.0, -2_000_000.0);
    cells(&polar, 100.0, 100.0);
    assert!(said.notes.is_empty(), "{said:?}");
    cells(&ground(3413, 100.0, 0.0, 0.0).0, 103.1, 103.1);
    // A mercator that only its keys describe, true at 60 N.
    let user = at(tiff(), 60.0, 1e6, 4_190_000.0).doubles(34736, &[0.0, 60.0, 0.0, 0.0]);
    let user = user.short(
        34735,
        &[
            1, 1, 0, 9, 1024, 0, 1, 1, 1025, 0, 1, 1, 2048, 0, 1, 4326, 3072, 0, 1, 32767, 3075, 0, 1, 7,
            3076, 0, 1, 9001, 3078, 34736, 1, 1, 3080, 34736, 1, 0, 3082, 34736, 1, 2,
        ],
    );
    let (dem, said) = read_files(&[("a.tif", &user.bytes())], &DEFAULT).unwrap();
    cells(&dem, 60.0, 60.0);
    assert!(dem.georeference().unwrap().definition.is_some() && said.notes.is_empty(), "{said:?}");
    // Places that the projection does not have, or far beyond what it can show.
    let beyond = keys(at(tiff(), 30.0, 5e5, 4.1e6), &[(1024, 1), (1025, 1), (3072, 3167)]).bytes();
    refused(read_files(&[("a.tif", &beyond)], &DEFAULT), &["a.tif", "EPSG:3167", "--cell-size"]);
    let nowhere = keys(at(tiff(), 60.0, 9e9, 9e9), &[(1024, 1), (1025, 1), (3072, 3035)]).bytes();
    refused(read_files(&[("a.tif", &nowhere)], &DEFAULT), &["a.tif", "EPSG:3035", "--cell-size"]);
}

#[test]
fn masks_make_voids() {
    if let Some(path) = case("mask-internal.tif") {
        let (dem, said) = read_described(&path, &DEFAULT).unwrap();
        assert_eq!((dem.void_count(), dem.range().0), (600, 1709.0));
        told(&said, &["mask in the file", "600"]);
    }
    // 10 columns take two bytes a row: the first column, and the last two.
    let bits: Vec<u8> = std::iter::repeat_n([0b0111_1111, 0b0000_0000], 12).flatten().collect();
    let whole: Vec<u8> = (0..120u8).map(|i| if i < 7 { 0 } else { 255 }).collect();
    let mask = |bits: u32, data: Vec<u8>| {
        let length = data.len() as u32;
        tiff().data(data).long(254, 4).short(258, &[bits]).short(262, &[4]).short(339, &[1]).long(279, length)
    };
    for (mask, voids) in [(mask(1, bits.clone()), 36), (mask(8, whole.clone()), 7)] {
        // A smaller image of the mask comes first.
        let overview = mask.clone().long(254, 5).long(256, 5).long(257, 6);
        let file = Tiff::file(&[&tiff(), &overview, &mask]);
        let (dem, _) = read_files(&[("a.tif", &file)], &DEFAULT).unwrap();
        assert_eq!(dem.void_count(), voids);
        let all = ReadOptions { nodata: Nodata::None, ..DEFAULT };
        assert_eq!(read_files(&[("a.tif", &file)], &all).unwrap().0.void_count(), 0);
    }
    let swapped =
        Tiff::file(&[&tiff(), &mask(1, bits.iter().map(|b| b.reverse_bits()).collect()).short(266, &[2])]);
    assert_eq!(read_files(&[("a.tif", &swapped)], &DEFAULT).unwrap().0.void_count(), 36);
    // Beside the file, as GDAL writes them: an ordinary image of bytes.
    let outside = mask(8, whole).without(254).short(262, &[1]).bytes();
    let (dem, said) = read_files(&[("a.tif", &tiff().bytes()), ("a.tif.msk", &outside)], &DEFAULT).unwrap();
    assert_eq!(dem.void_count(), 7);
    told(&said, &["a.tif.msk", "7 cells"]);
    let ascii = asc(METRES);
    assert_eq!(
        read_files(&[("a.asc", &ascii), ("a.asc.msk", &outside)], &DEFAULT).unwrap().0.void_count(),
        7
    );
    // Of another size, of unknown compression: refused, unless every number is to be a height.
    let small = Tiff::f32(2, 2, &[1.0; 4]).bytes();
    let zstd = Tiff::file(&[&tiff(), &mask(1, bits).short(259, &[50000])]);
    refused(
        read_files(&[("a.tif", &tiff().bytes()), ("a.tif.msk", &small)], &DEFAULT),
        &["a.tif.msk", "2 rows", "--nodata none"],
    );
    refused(read_files(&[("a.tif", &zstd)], &DEFAULT), &["a.tif", "mask", "Zstandard", "--nodata none"]);
    let all = ReadOptions { nodata: Nodata::None, ..DEFAULT };
    assert_eq!(read_files(&[("a.tif", &zstd)], &all).unwrap().0.void_count(), 0);
}

#[test]
fn transparency_makes_voids() {
    if let Some(path) = case("alpha-band.tif") {
        let first = ReadOptions { band: Some(1), ..DEFAULT };
        assert_eq!(read_described(&path, &first).unwrap().0.void_count(), 600);
    }
    // Heights and alpha in turn, in two kinds of number; alpha of any value but 0 counts as known.
    let both: Vec<f32> =
        slope().iter().enumerate().flat_map(|(i, &z)| [z, if i < 9 { 0.0 } else { 0.5 }]).collect();
    let floats = Tiff::f32(12, 20, &both).long(256, 10).short(277, &[2]).short(338, &[2]);
    let whole: Vec<i16> = both.iter().map(|&z| z.ceil() as i16).collect();
    let integers = Tiff::i16(12, 20, &whole).long(256, 10).short(277, &[2]).short(338, &[1]);
    for tiff in [floats.clone(), integers] {
        for band in [None, Some(1)] {
            let (dem, said) =
                read_files(&[("a.tif", &tiff.bytes())], &ReadOptions { band, ..DEFAULT }).unwrap();
            assert_eq!((dem.void_count(), dem.range().0), (9, 1509.0));
            told(&said, &["band 2 (transparency)", "9 cells"]);
        }
    }
    // Asked for all the same; no alpha: two bands of heights.
    let second = ReadOptions { band: Some(2), ..DEFAULT };
    let (dem, said) = read_files(&[("a.tif", &floats.bytes())], &second).unwrap();
    assert_eq!(dem.range(), (0.0, 0.5));
    told(&said, &["band 2", "transparency"]);
    let unmarked = floats.short(338, &[0]).bytes();
    refused(read_files(&[("a.tif", &unmarked)], &DEFAULT), &["number of bands", "2", "--band"]);
}

#[test]
fn transparent_pixels_of_a_png_are_voids() {
    let ranged = ReadOptions { elevation: Normalization::new(0.0, 65535.0).ok(), ..DEFAULT };
    if let Some(path) = case("trns16.png") {
        let (dem, said) = read_described(&path, &ranged).unwrap();
        assert!(dem.void_count() > 0);
        told(&said, &["is transparent"]);
    }
    let levels: Vec<u8> = (0..120u16).flat_map(|i| (1500 + 3 * i).to_be_bytes()).collect();
    let transparent = |depth: BitDepth, level: u16, levels: &[u8]| {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, 10, 12);
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(depth);
        encoder.set_trns(level.to_be_bytes().to_vec());
        encoder.write_header().unwrap().write_image_data(levels).unwrap();
        bytes
    };
    let sixteen = transparent(BitDepth::Sixteen, 1500 + 3 * 7, &levels);
    let eight: Vec<u8> = (0..120).map(|i| 100 + i % 60).collect();
    let eight = transparent(BitDepth::Eight, 101, &eight);
    assert_eq!(read_files(&[("a.png", &sixteen)], &ranged).unwrap().0.void_count(), 1);
    assert_eq!(read_files(&[("a.png", &eight)], &ranged).unwrap().0.void_count(), 2);
    // The caller names other levels, or none.
    let with = |nodata| ReadOptions { nodata, ..ranged };
    assert_eq!(read_files(&[("a.png", &eight)], &with(Nodata::None)).unwrap().0.void_count(), 0);
    assert_eq!(
        read_files(&[("a.png", &eight)], &with(Nodata::Either([100.0, 103.0]))).unwrap().0.void_count(),
        4
    );
    // An alpha channel of 8 and of 16 bits.
    let alpha8: Vec<u8> = (0..120u8).flat_map(|i| [100 + i, if i < 5 { 0 } else { 1 }]).collect();
    let alpha8 = png(12, 10, ColorType::GrayscaleAlpha, BitDepth::Eight, &alpha8);
    let alpha16: Vec<u8> =
        (0..120u16).flat_map(|i| [(1500 + i).to_be_bytes(), [0, u8::from(i >= 11)]].concat()).collect();
    let alpha16 = png(12, 10, ColorType::GrayscaleAlpha, BitDepth::Sixteen, &alpha16);
    for (file, voids) in [(alpha8, 5), (alpha16, 11)] {
        let (dem, said) = read_files(&[("a.png", &file)], &ranged).unwrap();
        assert_eq!(dem.void_count(), voids);
        told(&said, &["alpha channel", "void"]);
        assert_eq!(read_files(&[("a.png", &file)], &with(Nodata::None)).unwrap().0.void_count(), 0);
    }
    let colours = png(12, 10, ColorType::Rgba, BitDepth::Eight, &[9; 480]);
    refused(read_files(&[("a.png", &colours)], &ranged), &["colour type", "Rgba", "greyscale"]);
}

#[test]
fn strange_numbers_are_refused_until_explained() {
    for (name, number) in
        [("marker-32767.tif", "32767"), ("marker-10000.tif", "10000"), ("marker-u16-55537.tif", "55537")]
    {
        let Some(path) = case(name) else { continue };
        refused(read_described(&path, &DEFAULT), &[name, number, "--nodata"]);
        let numbers = [-32768.0, -32767.0, 32767.0, -10_000.0, 10_000.0, 55_537.0];
        let dems =
            numbers.map(|v| read_described(&path, &ReadOptions { nodata: Nodata::Value(v), ..DEFAULT }));
        assert!(dems.into_iter().flatten().any(|(dem, _)| dem.void_count() > 0), "{name}");
        let none = ReadOptions { nodata: Nodata::None, ..DEFAULT };
        assert_eq!(read_described(&path, &none).unwrap().0.void_count(), 0);
    }
    if let Some(path) = case("marker-zero-collar-real.tif") {
        told(&read_described(&path, &DEFAULT).unwrap().1, &["413 cells of 0", "--nodata 0"]);
    }
    let strange = |marker: f32| {
        let mut heights = slope();
        heights[3..8].fill(marker);
        heights
    };
    for marker in [-9999.0, 9999.0, 65535.0, -32767.0, 32767.0, -10_000.0, 1e20, 3.4e38, -3.4e38, 99_999.0] {
        let heights = strange(marker);
        let tif = Tiff::f32(12, 10, &heights);
        let text: Vec<String> = heights.iter().map(f32::to_string).collect();
        let ascii = format!("ncols 10\nnrows 12\n{METRES}\nnodata_value -1\n{}", text.join(" "));
        for (name, bytes) in [
            ("a.tif", tif.bytes()),
            ("a.tif", tif.clone().text(42113, "-1").bytes()),
            ("a.tif", tif.text(42113, "nan").bytes()),
            ("a.npy", npy_f32("(12, 10)", &heights)),
            ("a.asc", ascii.into_bytes()),
        ] {
            refused(read_files(&[(name, &bytes)], &DEFAULT), &[name, "cells", "--nodata"]);
            let options = ReadOptions { nodata: Nodata::Either([-1.0, marker.into()]), ..DEFAULT };
            assert_eq!(read_files(&[(name, &bytes)], &options).unwrap().0.void_count(), 5, "{marker}");
        }
    }
    // A collar is told.
    let (dem, said) =
        read_files(&[("a.tif", &Tiff::f32(12, 10, &strange(1000.0)).bytes())], &DEFAULT).unwrap();
    assert_eq!(dem.void_count(), 0);
    told(&said, &["5 cells of 1000", "1500 to 1619", "--nodata 1000"]);
}

#[test]
fn what_nodata_texts_mean() {
    for (name, voids) in [("nodata-qnan.tif", 100), ("nodata-key.asc", 0), ("nodata-null.asc", 0)] {
        let Some(path) = case(name) else { continue };
        assert_eq!(read_described(&path, &DEFAULT).unwrap().0.void_count(), voids, "{name}");
        let given = ReadOptions { nodata: Nodata::Value(2131.0), ..DEFAULT };
        assert!(read_described(&path, &given).unwrap().0.void_count() > voids, "{name}");
    }
    let tif = |text: &str| tiff().text(42113, text).bytes();
    let ascii = |text: &str| asc(&format!("{METRES}\n{text}"));
    for text in ["1.#QNAN", "-nan", "null", "", "none"] {
        let (dem, _) = read_files(&[("a.tif", &tif(text))], &DEFAULT).unwrap();
        assert_eq!(dem.void_count(), 0, "{text}");
    }
    for text in ["NODATA 1501", "nodata_VALUE 1501.0"] {
        assert_eq!(read_files(&[("a.asc", &ascii(text))], &DEFAULT).unwrap().0.void_count(), 1);
    }
    // One that is no number: refused, and overruled by any word of the caller.
    for (name, bytes) in [("a.tif", tif("-9999,0")), ("a.asc", ascii("nodata_value nichts"))] {
        refused(read_files(&[(name, &bytes)], &DEFAULT), &[name, "--nodata"]);
        for (nodata, voids) in [(Nodata::None, 0), (Nodata::Value(1501.0), 1)] {
            let (dem, _) = read_files(&[(name, &bytes)], &ReadOptions { nodata, ..DEFAULT }).unwrap();
            assert_eq!(dem.void_count(), voids);
        }
    }
    let missing =
        String::from_utf8(asc(&format!("{METRES}\nnodata_value null"))).unwrap().replace(" 1501 ", " null ");
    assert_eq!(read_files(&[("a.asc", missing.as_bytes())], &DEFAULT).unwrap().0.void_count(), 1);
}

#[test]
fn world_files_place_a_raster() {
    if let Some(path) = case("worldfile.tif") {
        let (dem, _) = read_described(&path, &DEFAULT).unwrap();
        let place = dem.georeference().unwrap();
        assert_eq!((dem.cell_size().x(), place.to_model(0.0, 0.0)), (30.0, (500_000.0, 4_100_000.0)));
    }
    let bare = tiff().without(33550).without(33922).bytes();
    let world = b"30\n0\n0\n-30\n500015\n4099985\n";
    let grey = png(12, 10, ColorType::Grayscale, BitDepth::Eight, &(0..120).collect::<Vec<u8>>());
    let array = npy_f32("(12, 10)", &slope());
    let ranged = ReadOptions { elevation: Normalization::new(0.0, 1000.0).ok(), ..DEFAULT };
    for (name, bytes, beside) in [
        ("a.tif", &bare, "a.tfw"),
        ("a.tif", &bare, "a.tifw"),
        ("a.tif", &bare, "A.TFW"),
        ("a.tif", &bare, "a.wld"),
        ("a.png", &grey, "a.pgw"),
        ("a.npy", &array, "a.wld"),
    ] {
        let (dem, said) = read_files(&[(name, bytes), (beside, world)], &ranged).unwrap();
        let place = dem.georeference().unwrap_or_else(|| panic!("{beside}: no place"));
        assert_eq!((dem.cell_size().x(), place.to_model(0.0, 0.0)), (30.0, (500_000.0, 4_100_000.0)));
        told(&said, &[beside, "no coordinate system is stated"]);
    }
    // Rotated; south up; together with a system in feet.
    let turned = b"24\n18\n18\n-24\n500000\n4100000\n";
    cells(&read_files(&[("a.tif", &bare), ("a.tfw", turned)], &DEFAULT).unwrap().0, 30.0, 30.0);
    let (dem, _) = read_files(&[("a.tif", &bare), ("a.tfw", b"30 0 0 30 15 15")], &DEFAULT).unwrap();
    assert_eq!(
        (dem.heights().as_slice()[0], dem.georeference().unwrap().to_model(0.0, 0.0)),
        (1610.0, (0.0, 360.0))
    );
    let (dem, _) =
        read_files(&[("a.tif", &bare), ("a.tfw", world), ("a.prj", b"EPSG:2227")], &DEFAULT).unwrap();
    assert!((dem.cell_size().x() / (30.0 * US_FOOT) - 1.0).abs() < 0.01, "{:?}", dem.cell_size());
    // Not used, not read, in degrees: each is said.
    let (_, said) = read_files(&[("a.tif", &tiff().bytes()), ("a.tfw", world)], &DEFAULT).unwrap();
    told(&said, &["a.tfw is not used"]);
    let (_, said) = read_files(&[("a.tif", &bare), ("a.tfw", b"30,0\n0\n")], &DEFAULT).unwrap();
    told(&said, &["a.tfw is there and not read", "six", "1 m assumed"]);
    let degrees = b"0.01\n0\n0\n-0.01\n8.005\n46.995\n";
    refused(
        read_files(&[("a.tif", &bare), ("a.tfw", degrees)], &DEFAULT),
        &["a.tif", "degrees", "--cell-size"],
    );
    let (dem, _) =
        read_files(&[("a.tif", &bare), ("a.tfw", degrees), ("a.prj", b"EPSG:4326")], &DEFAULT).unwrap();
    cells(&dem, 760.9, 1111.7);
}

const FEET_PRJ: &[u8] = br#"PROJCS["NAD_1983_StatePlane_California_III_FIPS_0403_Feet",GEOGCS["GCS_North_American_1983",
    DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],
    UNIT["Degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic"],PARAMETER["False_Easting",6561666.666666666],
    PARAMETER["False_Northing",1640416.666666667],PARAMETER["Central_Meridian",-120.5],
    PARAMETER["Standard_Parallel_1",37.06666666666667],PARAMETER["Standard_Parallel_2",38.43333333333333],
    PARAMETER["Latitude_Of_Origin",36.5],UNIT["Foot_US",0.3048006096012192]]"#;

#[test]
fn prj_files_name_the_system() {
    if let Some(path) = case("prj-feet.asc") {
        cells(&read_described(&path, &DEFAULT).unwrap().0, 30.0, 30.0);
    }
    let ascii = asc("xllcorner 6500000\nyllcorner 1900000\ncellsize 100");
    for (text, side) in [
        (FEET_PRJ, 100.0 * US_FOOT),
        // ArcInfo's own key words; a projection that is not known, but in kilometres.
        (b"Projection    STATEPLANE\nFipszone 403\nUnits         FEET\nParameters\n", 100.0 * US_FOOT),
        (
            br#"PROJCS["x",GEOGCS["y",UNIT["Degree",0.0174]],PROJECTION["Bonne"],UNIT["Kilometer",1000.0]]"#,
            100_000.0,
        ),
    ] {
        let (dem, said) = read_files(&[("a.asc", &ascii), ("a.prj", text)], &DEFAULT).unwrap();
        assert!((dem.cell_size().x() / side - 1.0).abs() < 1e-3, "{:?}", dem.cell_size());
        told(&said, &["coordinate system from a.prj"]);
        assert_eq!(said.cell_size_source, CellSizeSource::File);
    }
    let degrees = asc("xllcorner 8\nyllcorner 46.5\ncellsize 0.01");
    let wgs84 = br#"GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]"#;
    let (dem, _) = read_files(&[("a.asc", &degrees), ("a.prj", wgs84)], &DEFAULT).unwrap();
    cells(&dem, 766.1, 1111.6);
    // Heights in feet of a compound system.
    let compound = br#"COMPD_CS["x",PROJCS["y",GEOGCS["z",UNIT["Degree",0.0174]],PROJECTION["Bonne"],UNIT["metre",1]],VERT_CS["h",UNIT["foot",0.3048]]]"#;
    let (dem, _) = read_files(&[("a.asc", &ascii), ("a.prj", compound)], &DEFAULT).unwrap();
    assert!((dem.range().0 - 457.2).abs() < 1e-3, "{:?}", dem.range());
    let (_, said) = read_files(&[("a.asc", &ascii), ("a.prj", b"somewhere")], &DEFAULT).unwrap();
    told(&said, &["a.prj is there and not read", "no coordinate system is stated"]);
    let (_, said) =
        read_files(&[("a.tif", &projected(32611).bytes()), ("a.prj", FEET_PRJ)], &DEFAULT).unwrap();
    told(&said, &["a.prj is not used"]);
    let (_, said) =
        read_files(&[("a.tif", &projected(32611).bytes()), ("a.hdr", b""), ("a.tif.ovr", b"")], &DEFAULT)
            .unwrap();
    told(&said, &["a.hdr is there and not read"]);
}

#[test]
fn aux_xml_files_count_before_the_file() {
    if let Some(path) = case("auxxml.tif") {
        let (dem, said) = read_described(&path, &DEFAULT).unwrap();
        assert!(dem.void_count() > 0);
        told(&said, &["heights converted to metres"]);
    }
    let pam = |inside: &str| format!("<PAMDataset>{inside}</PAMDataset>").into_bytes();
    let band = |inside: &str| pam(&format!("<PAMRasterBand band=\"1\">{inside}</PAMRasterBand>"));
    let own = projected(32611).text(42113, "1502").bytes();
    let with = |xml: &[u8]| read_files(&[("a.tif", &own), ("a.tif.aux.xml", xml)], &DEFAULT);
    let (dem, _) =
        with(&band("<NoDataValue>1501</NoDataValue><Scale>0.5</Scale><Offset>10</Offset>")).unwrap();
    assert_eq!((dem.void_count(), dem.valid().as_slice()[1], dem.range().0), (1, false, 760.0));
    let (dem, _) = with(&band("<UnitType>US survey foot</UnitType>")).unwrap();
    assert!((f64::from(dem.range().0) / (1500.0 * US_FOOT) - 1.0).abs() < 1e-6);
    let place = "<SRS>EPSG:2227</SRS><GeoTransform>6500000, 100, 0, 1900000, 0, -100</GeoTransform>\
                 <Metadata><MDI key=\"AREA_OR_POINT\">Point</MDI></Metadata>";
    let (dem, _) = with(&pam(place)).unwrap();
    let g = dem.georeference().unwrap();
    assert_eq!(
        (g.epsg, g.raster_space, g.to_model(0.0, 0.0)),
        (Some(2227), RasterSpace::PixelIsPoint, (6.5e6, 1.9e6))
    );
    cells(&dem, 100.0 * US_FOOT, 100.0 * US_FOOT);
    // For another band; not understood in part, or at all: said. An unknown unit is refused until the caller says one.
    assert!(
        with(&pam("<PAMRasterBand band=\"2\"><NoDataValue>1501</NoDataValue></PAMRasterBand>"))
            .unwrap()
            .0
            .valid()
            .as_slice()[1]
    );
    told(&with(&band("<Scale>much</Scale>")).unwrap().1, &["a.tif.aux.xml", "Scale", "much", "not used"]);
    told(&with(b"<PAMDataset>").unwrap().1, &["a.tif.aux.xml is there and not read"]);
    told(&with(b"<html/>").unwrap().1, &["a.tif.aux.xml is there and not read", "html"]);
    let furlongs = band("<UnitType>furlong</UnitType>");
    refused(with(&furlongs), &["a.tif.aux.xml", "furlong", "--metres-per-unit"]);
    let given = ReadOptions { metres_per_unit: Some(2.0), ..DEFAULT };
    let (dem, _) = read_files(&[("a.tif", &own), ("a.tif.aux.xml", &furlongs)], &given).unwrap();
    assert_eq!(dem.range().0, 3000.0);
}

#[test]
fn the_whole_name_of_an_srtm_tile_counts() {
    if let Some(path) = case("N45W074T86.hgt.gz") {
        refused(read_described(&path, &DEFAULT), &["N45W074T86", "\"T86\"", "--cell-size"]);
        let given = ReadOptions { cell_size: CellSize::square(10.0).ok(), ..DEFAULT };
        let (dem, said) = read_described(&path, &given).unwrap();
        assert_eq!((dem.cell_size().x(), dem.georeference()), (10.0, None));
        told(&said, &["no place"]);
    }
    let tile: Vec<u8> = (0..1201 * 1201u32).flat_map(|i| ((i % 1201) as i16).to_be_bytes()).collect();
    for name in ["n37w118.hgt", "N37W118.SRTMGL3.hgt", "NASADEM_HGT_n37w118.hgt"] {
        let (dem, _) = read_files(&[(name, &tile)], &DEFAULT).unwrap();
        let (x, y) = dem.georeference().unwrap().to_model(0.5, 0.5);
        assert!((x + 118.0).abs() < 1e-9 && (y - 38.0).abs() < 1e-9, "{name}: {x} {y}");
    }
    for name in ["N37W118_part2.hgt", "N37W118b.hgt", "tile.hgt"] {
        refused(read_files(&[(name, &tile)], &DEFAULT), &[name, "N36W118.hgt", "--cell-size"]);
    }
}

fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn a_zip_with_one_raster_is_read() {
    let tile: Vec<u8> = (0..1201 * 1201u32).flat_map(|i| ((i % 1201) as i16).to_be_bytes()).collect();
    let nasadem = zipped(&[("n37w118.hgt", &tile), ("n37w118.num", &[1; 9]), ("n37w118.swb", &[0; 9])]);
    let (dem, said) = read_files(&[("NASADEM_HGT_n37w118.zip", &nasadem)], &DEFAULT).unwrap();
    assert_eq!((dem.shape(), said.packing.as_str()), ((1201, 1201), "zip"));
    assert_eq!(dem.georeference().unwrap().epsg, Some(4326));
    let ascii = asc("xllcorner 6500000\nyllcorner 1900000\ncellsize 100");
    let folder = zipped(&[("dem/readme.txt", b"hello"), ("dem/a.asc", &ascii), ("dem/a.prj", FEET_PRJ)]);
    let (dem, said) = read_files(&[("terrain.zip", &folder)], &DEFAULT).unwrap();
    cells(&dem, 100.0 * US_FOOT, 100.0 * US_FOOT);
    told(&said, &["a.prj"]);
    let two = zipped(&[("a.asc", &ascii), ("b.asc", &ascii)]);
    refused(read_files(&[("two.zip", &two)], &DEFAULT), &["two.zip", "a.asc, b.asc", "allowed: one"]);
    refused(read_files(&[("none.zip", &zipped(&[("a.txt", b"")]))], &DEFAULT), &["none.zip", "none"]);
    refused(read_files(&[("torn.zip", &folder[..folder.len() / 2])], &DEFAULT), &["torn.zip", "zip archive"]);
    refused(
        read_files(&[("bad.zip", &zipped(&[("b.asc", b"ncols x")]))], &DEFAULT),
        &["bad.zip", "b.asc", "ncols"],
    );
}

#[test]
fn degrees_are_not_taken_for_metres() {
    if let Some(path) = case("degrees-0.05.asc") {
        refused(read_described(&path, &DEFAULT), &["degrees-0.05.asc", "degrees", "--cell-size"]);
    }
    for (west, south, side) in [
        (-118.0, 36.0, 0.000_278),
        (8.0, 46.0, 0.0083),
        (-118.5, 36.5, 0.25),
        (-20.0, 30.0, 1.0),
        (170.0, -50.0, 2.5),
    ] {
        let grid = asc(&format!("xllcorner {west}\nyllcorner {south}\ncellsize {side}"));
        refused(
            read_files(&[("a.asc", &grid)], &DEFAULT),
            &["a.asc", "degrees", &side.to_string(), "--cell-size"],
        );
        let tif = at(tiff(), side, west, south + 12.0 * side).bytes();
        refused(read_files(&[("a.tif", &tif)], &DEFAULT), &["a.tif", "degrees", "--cell-size"]);
        let given = ReadOptions { cell_size: CellSize::square(30.0).ok(), ..DEFAULT };
        for (name, bytes) in [("a.asc", &grid), ("a.tif", &tif)] {
            assert_eq!(read_files(&[(name, bytes)], &given).unwrap().0.cell_size().x(), 30.0);
        }
    }
    // Degrees for the size of cells at a place in metres; small cells that are metres.
    let mixed = asc("xllcorner 500000\nyllcorner 4100000\ncellsize 0.000833");
    refused(read_files(&[("a.asc", &mixed)], &DEFAULT), &["degrees", "--cell-size"]);
    for header in
        ["xllcorner 500000\nyllcorner 4100000\ncellsize 0.5", "xllcorner 0\nyllcorner 0\ncellsize 1"]
    {
        let (_, said) = read_files(&[("a.asc", &asc(header))], &DEFAULT).unwrap();
        told(&said, &["no coordinate system is stated", "metres"]);
    }
}

#[test]
fn a_given_cell_size_overrules_what_does_not_parse() {
    let given = ReadOptions { cell_size: CellSize::new(20.0, 25.0).ok(), ..DEFAULT };
    let skewed = [30.0, 10.0, 0.0, 0.0, 0.0, -30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    for (what, bytes) in [
        ("ModelPixelScale", tiff().doubles(33550, &[0.0, -1.0, 0.0]).bytes()),
        ("ModelTiepoint", tiff().doubles(33922, &[0.0, 1.0]).bytes()),
        ("GTModelTypeGeoKey", keys(tiff(), &[(1024, 3)]).bytes()),
        ("GTRasterTypeGeoKey", keys(tiff(), &[(1025, 7)]).bytes()),
        ("GeoKeyDirectory", tiff().short(34735, &[1, 1, 0, 9]).bytes()),
        ("GeogAngularUnitsGeoKey", keys(tiff(), &[(1024, 2), (2048, 4326), (2054, 9001)]).bytes()),
        ("MONADNOCK_CELL_SIZE", tiff().text(42112, r#"<Item name="MONADNOCK_CELL_SIZE">x</Item>"#).bytes()),
    ] {
        refused(read_files(&[("a.tif", &bytes)], &DEFAULT), &["a.tif", what]);
        let (dem, said) = read_files(&[("a.tif", &bytes)], &given).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((dem.cell_size().x(), dem.cell_size().y()), (20.0, 25.0));
        told(&said, &[what, "not used, as --cell-size is given"]);
    }
    let skewed = tiff().doubles(34264, &skewed).bytes();
    refused(read_files(&[("a.tif", &skewed)], &DEFAULT), &["skewed", "--cell-size"]);
    assert_eq!(read_files(&[("a.tif", &skewed)], &given).unwrap().0.cell_size().x(), 20.0);
    for header in
        ["xllcorner west\nyllcorner 0\ncellsize 30", "cellsize 30", "xllcorner 0\nyllcorner 0\ncellsize 0"]
    {
        refused(read_files(&[("a.asc", &asc(header))], &DEFAULT), &["a.asc"]);
        let (dem, _) = read_files(&[("a.asc", &asc(header))], &given).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((dem.cell_size().y(), dem.georeference()), (25.0, None));
    }
}
