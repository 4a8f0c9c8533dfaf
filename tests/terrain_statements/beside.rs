//! World files, `.prj` and `.aux.xml`.

use crate::crafted::{npy_f32, png};
use crate::{
    DEFAULT, FEET_PRJ, US_FOOT, asc, case, cells, projected, read_files, refused, slope, tiff, told,
};
use ::png::{BitDepth, ColorType};
use monadnock::dem::io::{CellSizeSource, ReadOptions, read_described};
use monadnock::dem::{Normalization, RasterSpace};

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
