//! GeoTIFF, read and written.
//!
//! Header, layout and unpacking are our own, checked against the file's length before anything is allocated (why:
//! `unpack.rs`); the `tiff` crate writes. Classic and BigTIFF, both byte orders; strips and tiles (GDAL's absent
//! ones are voids); none, LZW, deflate, PackBits; predictors 1 to 3; integers of 8 to 64 bits, floats of 16 to 64.

mod decode;
mod directory;
mod encode;
mod georeference;
mod layout;
mod masks;
mod metadata;
mod projection;
mod unpack;

pub(super) use decode::read;
pub(super) use encode::write;
pub(super) use masks::read_mask;

/// TIFF, GeoTIFF and GDAL tags, by number.
mod tag {
    pub(super) const NEW_SUBFILE_TYPE: u16 = 254;
    pub(super) const WIDTH: u16 = 256;
    pub(super) const HEIGHT: u16 = 257;
    pub(super) const BITS_PER_SAMPLE: u16 = 258;
    pub(super) const COMPRESSION: u16 = 259;
    pub(super) const PHOTOMETRIC: u16 = 262;
    pub(super) const FILL_ORDER: u16 = 266;
    pub(super) const STRIP_OFFSETS: u16 = 273;
    pub(super) const SAMPLES_PER_PIXEL: u16 = 277;
    pub(super) const ROWS_PER_STRIP: u16 = 278;
    pub(super) const STRIP_BYTE_COUNTS: u16 = 279;
    pub(super) const PLANAR_CONFIGURATION: u16 = 284;
    pub(super) const PREDICTOR: u16 = 317;
    pub(super) const TILE_WIDTH: u16 = 322;
    pub(super) const TILE_LENGTH: u16 = 323;
    pub(super) const TILE_OFFSETS: u16 = 324;
    pub(super) const TILE_BYTE_COUNTS: u16 = 325;
    pub(super) const EXTRA_SAMPLES: u16 = 338;
    pub(super) const SAMPLE_FORMAT: u16 = 339;
    pub(super) const MODEL_PIXEL_SCALE: u16 = 33550;
    pub(super) const MODEL_TIEPOINT: u16 = 33922;
    pub(super) const MODEL_TRANSFORMATION: u16 = 34264;
    pub(super) const GEO_KEY_DIRECTORY: u16 = 34735;
    pub(super) const GEO_DOUBLE_PARAMS: u16 = 34736;
    pub(super) const GEO_ASCII_PARAMS: u16 = 34737;
    pub(super) const GDAL_METADATA: u16 = 42112;
    pub(super) const GDAL_NODATA: u16 = 42113;

    /// The tag's name in messages.
    pub(super) fn name(tag: u16) -> String {
        let known = match tag {
            WIDTH => "ImageWidth",
            HEIGHT => "ImageLength",
            BITS_PER_SAMPLE => "BitsPerSample",
            COMPRESSION => "Compression",
            PHOTOMETRIC => "PhotometricInterpretation",
            STRIP_OFFSETS => "StripOffsets",
            SAMPLES_PER_PIXEL => "SamplesPerPixel",
            ROWS_PER_STRIP => "RowsPerStrip",
            STRIP_BYTE_COUNTS => "StripByteCounts",
            PLANAR_CONFIGURATION => "PlanarConfiguration",
            PREDICTOR => "Predictor",
            TILE_WIDTH => "TileWidth",
            TILE_LENGTH => "TileLength",
            TILE_OFFSETS => "TileOffsets",
            TILE_BYTE_COUNTS => "TileByteCounts",
            SAMPLE_FORMAT => "SampleFormat",
            MODEL_PIXEL_SCALE => "ModelPixelScale",
            MODEL_TIEPOINT => "ModelTiepoint",
            MODEL_TRANSFORMATION => "ModelTransformation",
            GEO_KEY_DIRECTORY => "GeoKeyDirectory",
            GEO_DOUBLE_PARAMS => "GeoDoubleParams",
            GEO_ASCII_PARAMS => "GeoAsciiParams",
            NEW_SUBFILE_TYPE => "NewSubfileType",
            FILL_ORDER => "FillOrder",
            EXTRA_SAMPLES => "ExtraSamples",
            GDAL_METADATA => "GDAL_METADATA",
            GDAL_NODATA => "GDAL_NODATA",
            _ => return format!("tag {tag}"),
        };
        known.to_owned()
    }
}

/// GeoKeys and their codes (OGC GeoTIFF 1.1, annex B).
mod key {
    pub(super) const MODEL_TYPE: u16 = 1024;
    pub(super) const RASTER_TYPE: u16 = 1025;
    pub(super) const CITATION: u16 = 1026;
    pub(super) const GEODETIC_CRS: u16 = 2048;
    pub(super) const GEODETIC_DATUM: u16 = 2050;
    pub(super) const ANGULAR_UNITS: u16 = 2054;
    pub(super) const SEMI_MAJOR_AXIS: u16 = 2057;
    pub(super) const SEMI_MINOR_AXIS: u16 = 2058;
    pub(super) const INVERSE_FLATTENING: u16 = 2059;
    pub(super) const PROJECTED_CRS: u16 = 3072;
    pub(super) const PROJECTED_CITATION: u16 = 3073;
    pub(super) const LINEAR_UNITS: u16 = 3076;
    pub(super) const LINEAR_UNIT_SIZE: u16 = 3077;
    pub(super) const PROJECTION_CRS: u16 = 3074;
    pub(super) const PROJECTION: u16 = 3075;
    pub(super) const PARALLEL_1: u16 = 3078;
    pub(super) const PARALLEL_2: u16 = 3079;
    pub(super) const ORIGIN_LONG: u16 = 3080;
    pub(super) const ORIGIN_LAT: u16 = 3081;
    pub(super) const FALSE_EASTING: u16 = 3082;
    pub(super) const FALSE_NORTHING: u16 = 3083;
    pub(super) const FALSE_ORIGIN_LONG: u16 = 3084;
    pub(super) const FALSE_ORIGIN_LAT: u16 = 3085;
    pub(super) const FALSE_ORIGIN_EASTING: u16 = 3086;
    pub(super) const FALSE_ORIGIN_NORTHING: u16 = 3087;
    pub(super) const CENTER_LONG: u16 = 3088;
    pub(super) const CENTER_LAT: u16 = 3089;
    pub(super) const CENTER_EASTING: u16 = 3090;
    pub(super) const CENTER_NORTHING: u16 = 3091;
    pub(super) const ORIGIN_SCALE: u16 = 3092;
    pub(super) const CENTER_SCALE: u16 = 3093;
    pub(super) const POLE_LONG: u16 = 3095;
    pub(super) const VERTICAL_CRS: u16 = 4096;
    pub(super) const VERTICAL_UNITS: u16 = 4099;

    pub(super) const PROJECTED: u16 = 1;
    pub(super) const GEOGRAPHIC: u16 = 2;
    pub(super) const PIXEL_IS_AREA: u16 = 1;
    pub(super) const PIXEL_IS_POINT: u16 = 2;
    pub(super) const DEGREE: u16 = 9102;
    pub(super) const USER_DEFINED: u16 = 32767;

    /// The key's name in messages.
    pub(super) fn name(key: u16) -> String {
        match key {
            LINEAR_UNITS => "ProjLinearUnitsGeoKey".to_owned(),
            LINEAR_UNIT_SIZE => "ProjLinearUnitSizeGeoKey".to_owned(),
            VERTICAL_UNITS => "VerticalUnitsGeoKey".to_owned(),
            _ => format!("GeoKey {key}"),
        }
    }
}
