//! What a stored number means: units of heights, markers, nodata.

use crate::crafted::{Tiff, npy_f32};
use crate::{DEFAULT, METRES, US_FOOT, asc, at, case, keys, read_files, refused, slope, tiff, told};
use monadnock::dem::io::{Nodata, ReadOptions, read_described};

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
