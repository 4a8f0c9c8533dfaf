//! Masks, alpha bands and transparent pixels.

use crate::crafted::{Tiff, png};
use crate::{DEFAULT, METRES, asc, case, read_files, refused, slope, tiff, told};
use ::png::{BitDepth, ColorType};
use monadnock::dem::Normalization;
use monadnock::dem::io::{Nodata, ReadOptions, read_described};

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
