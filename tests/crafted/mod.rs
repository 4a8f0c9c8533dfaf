//! Terrain files put together byte by byte, so that any part of one can lie.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses its own share")]

/// TIFF value types.
pub const ASCII: u16 = 2;
pub const SHORT: u16 = 3;
pub const LONG: u16 = 4;
pub const DOUBLE: u16 = 12;

/// A little-endian classic TIFF: its entries, then the data that `data_tag` entries point to.
#[derive(Clone)]
pub struct Tiff {
    entries: Vec<(u16, u16, u32, Vec<u8>)>,
    data: Vec<u8>,
}

/// Where the data lie in every crafted TIFF.
pub const DATA_AT: u32 = 8;

impl Tiff {
    /// A sound raster of 16-bit integers in one strip, 30 m cells.
    pub fn i16(rows: u32, cols: u32, heights: &[i16]) -> Self {
        let data = heights.iter().flat_map(|z| z.to_le_bytes()).collect();
        Self::raw(rows, cols, 16, 2, data)
    }

    /// A sound raster of 32-bit floats in one strip, 30 m cells.
    pub fn f32(rows: u32, cols: u32, heights: &[f32]) -> Self {
        let data = heights.iter().flat_map(|z| z.to_le_bytes()).collect();
        Self::raw(rows, cols, 32, 3, data)
    }

    fn raw(rows: u32, cols: u32, bits: u32, format: u32, data: Vec<u8>) -> Self {
        let length = data.len() as u32;
        let tiff = Self { entries: Vec::new(), data };
        tiff.long(256, cols)
            .long(257, rows)
            .short(258, &[bits])
            .short(259, &[1])
            .short(262, &[1])
            .long(273, DATA_AT)
            .short(277, &[1])
            .long(278, rows)
            .long(279, length)
            .short(339, &[format])
            .doubles(33550, &[30.0, 30.0, 0.0])
            .doubles(33922, &[0.0, 0.0, 0.0, 0.0, 300.0, 0.0])
    }

    /// Sets an entry, replacing an earlier one.
    pub fn entry(mut self, tag: u16, kind: u16, count: u32, bytes: Vec<u8>) -> Self {
        self.entries.retain(|e| e.0 != tag);
        self.entries.push((tag, kind, count, bytes));
        self
    }

    pub fn without(mut self, tag: u16) -> Self {
        self.entries.retain(|e| e.0 != tag);
        self
    }

    pub fn long(self, tag: u16, value: u32) -> Self {
        self.entry(tag, LONG, 1, value.to_le_bytes().to_vec())
    }

    pub fn short(self, tag: u16, values: &[u32]) -> Self {
        let bytes = values.iter().flat_map(|&v| (v as u16).to_le_bytes()).collect();
        self.entry(tag, SHORT, values.len() as u32, bytes)
    }

    pub fn doubles(self, tag: u16, values: &[f64]) -> Self {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.entry(tag, DOUBLE, values.len() as u32, bytes)
    }

    pub fn text(self, tag: u16, text: &str) -> Self {
        let bytes = [text.as_bytes(), &[0]].concat();
        self.entry(tag, ASCII, bytes.len() as u32, bytes)
    }

    pub fn data(mut self, data: Vec<u8>) -> Self {
        self.data = data;
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        Self::file(&[self])
    }

    /// A file of several images.
    pub fn file(images: &[&Self]) -> Vec<u8> {
        let mut file = b"II\x2a\x00".to_vec();
        let mut pointer = file.len();
        file.extend([0; 4]);
        for image in images {
            let start = file.len() as u32 + image.data.len() as u32;
            file[pointer..pointer + 4].copy_from_slice(&start.to_le_bytes());
            let (bytes, next) = image.at(file.len() as u32);
            pointer = file.len() + next;
            file.extend(bytes);
        }
        file
    }

    /// Data, directory and values of an image that begins at `at`, and where in them the next directory is pointed to.
    fn at(&self, at: u32) -> (Vec<u8>, usize) {
        let mut entries = self.entries.clone();
        entries.sort_by_key(|e| e.0);
        for (tag, _, _, bytes) in &mut entries {
            // Where the data are, unless the entry lies.
            if *tag == 273 && *bytes == DATA_AT.to_le_bytes() {
                *bytes = at.to_le_bytes().to_vec();
            }
        }
        let mut directory = (entries.len() as u16).to_le_bytes().to_vec();
        let start = at as usize + self.data.len();
        let mut far: Vec<u8> = Vec::new();
        for (tag, kind, count, bytes) in &entries {
            directory.extend(tag.to_le_bytes());
            directory.extend(kind.to_le_bytes());
            directory.extend(count.to_le_bytes());
            if bytes.len() <= 4 {
                directory.extend(bytes);
                directory.extend(vec![0; 4 - bytes.len()]);
            } else {
                let at = start + 2 + entries.len() * 12 + 4 + far.len();
                directory.extend((at as u32).to_le_bytes());
                far.extend(bytes);
            }
        }
        let next = self.data.len() + directory.len();
        let mut bytes = self.data.clone();
        bytes.extend(directory);
        bytes.extend([0; 4]);
        bytes.extend(far);
        (bytes, next)
    }
}

/// An `.npy` with any header.
pub fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

/// An `.npy` of 32-bit floats.
pub fn npy_f32(shape: &str, heights: &[f32]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n");
    npy(&header, &heights.iter().flat_map(|z| z.to_le_bytes()).collect::<Vec<_>>())
}

/// A PNG of any colour type; `data` are its rows without filter bytes.
pub fn png(rows: u32, cols: u32, colour: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, cols, rows);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}
