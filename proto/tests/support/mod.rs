//! A small container, and taking containers apart to put them together with other contents and right checksums.

#![allow(dead_code, unreachable_pub)] // Each test file uses a part of it.

use cager_geometry::mesh::{Model, Polygons, TriMesh};
use cager_proto::container::{ContainerReader, ContainerWriter, Error, Header};
use cager_proto::report::Report;
use std::io::Cursor;

pub const PRELUDE: usize = 16;
pub const SECTION: usize = 40;
pub const LINE: usize = 40;
pub const FOOTER: usize = 24;

pub fn tetrahedron() -> TriMesh {
    TriMesh {
        vertices: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    }
}

/// The tetrahedron at a third of its size, inside of it.
pub fn small_model() -> Model {
    let cage = tetrahedron();
    let mut faces = Polygons::new();
    for triangle in &cage.triangles {
        faces.push(triangle);
    }
    Model { points: cage.vertices.iter().map(|p| p.map(|x| 0.1 + x / 3.0)).collect(), faces, ..Model::default() }
}

pub fn header(rows: u32) -> Header {
    Header {
        coordinates_definition: 3,
        coordinates: "mvc".to_owned(),
        handles: "maxvol".to_owned(),
        regularizer: "laplacian".to_owned(),
        spectrum: 20,
        lambda: 1.0,
        rows_per_frame: rows,
        ..Header::default()
    }
}

/// The cage of a frame, different in every number.
pub fn frame(k: usize, rows: usize) -> Vec<f32> {
    (0..3 * rows).map(|i| (i as f32).mul_add(0.25, (k as f32 * 0.37).sin())).collect()
}

pub fn write(rest: &Model, cage: &TriMesh, frames: usize, report: Option<&Report>) -> Vec<u8> {
    let rows = cage.vertices.len();
    let mut writer = ContainerWriter::new(Vec::new(), &header(rows as u32), rest, cage).unwrap();
    for k in 0..frames {
        writer.write_frame(&frame(k, rows), k as f32, 2.0 * k as f32).unwrap();
    }
    writer.finish(report).unwrap()
}

/// What stands for boundary elements; only coordinates look into it.
pub const ELEMENTS: [u8; 12] = [2, 0, 1, 3, 3, 4, 3, 0, 0, 0, 0, 255];

/// A container of three frames with elements, a report and an optional section that no program knows.
pub fn small_container() -> Vec<u8> {
    let mut writer = ContainerWriter::new(Vec::new(), &header(4), &small_model(), &tetrahedron()).unwrap();
    writer.add_elements(&ELEMENTS).unwrap();
    for k in 0..3 {
        writer.write_frame(&frame(k, 4), 0.5, 1.5).unwrap();
    }
    let bytes = writer.finish(Some(&Report { generator: "test".to_owned(), ..Report::default() })).unwrap();
    let mut parts = take_apart(&bytes);
    parts.insert(parts.len() - 1, Part::raw(*b"note", 1, b"of no importance"));
    put_together(&parts)
}

/// Everything that a program reads of a container.
pub fn read_all(bytes: &[u8]) -> Result<(), Error> {
    let mut reader = ContainerReader::open(Cursor::new(bytes))?;
    reader.sections();
    reader.verify()
}

/// One section, taken apart.
#[derive(Clone, Debug)]
pub struct Part {
    pub tag: [u8; 4],
    pub codec: u8,
    pub width: u8,
    pub frames: (u32, u32),
    pub raw_bytes: u64,
    pub payload: Vec<u8>,
}

impl Part {
    pub fn raw(tag: [u8; 4], width: u8, payload: &[u8]) -> Self {
        Self { tag, codec: 0, width, frames: (0, 0), raw_bytes: payload.len() as u64, payload: payload.to_vec() }
    }

    fn header(&self) -> [u8; SECTION] {
        let mut b = [0; SECTION];
        b[0..4].copy_from_slice(&self.tag);
        b[4] = self.codec;
        b[5] = self.width;
        b[8..12].copy_from_slice(&self.frames.0.to_le_bytes());
        b[12..16].copy_from_slice(&self.frames.1.to_le_bytes());
        b[16..24].copy_from_slice(&(self.payload.len() as u64).to_le_bytes());
        b[24..32].copy_from_slice(&self.raw_bytes.to_le_bytes());
        b[32..36].copy_from_slice(&crc32c::crc32c(&self.payload).to_le_bytes());
        let crc = crc32c::crc32c(&b[..36]);
        b[36..40].copy_from_slice(&crc.to_le_bytes());
        b
    }
}

/// The sections of an intact container, without the table of contents.
pub fn take_apart(bytes: &[u8]) -> Vec<Part> {
    let mut parts = Vec::new();
    for (at, length) in extents(bytes) {
        let b = &bytes[at..];
        parts.push(Part {
            tag: [b[0], b[1], b[2], b[3]],
            codec: b[4],
            width: b[5],
            frames: (u64_at(b, 8) as u32, u64_at(b, 12) as u32),
            raw_bytes: u64_at(b, 24),
            payload: b[SECTION..SECTION + length].to_vec(),
        });
    }
    parts.pop();
    parts
}

/// A container of these sections, sound in everything but what they hold.
pub fn put_together(parts: &[Part]) -> Vec<u8> {
    let mut out = vec![0; PRELUDE];
    out[..8].copy_from_slice(b"\x89CGR\r\n\x1a\n");
    out[8] = 1;
    let mut contents = Vec::new();
    for part in parts {
        contents.extend_from_slice(&(out.len() as u64).to_le_bytes());
        contents.extend_from_slice(&part.header()[..32]);
        out.extend_from_slice(&part.header());
        out.extend_from_slice(&part.payload);
    }
    let at = out.len() as u64;
    let contents = Part::raw(*b"TOC_", 1, &contents);
    out.extend_from_slice(&contents.header());
    out.extend_from_slice(&contents.payload);
    let end = (out.len() + FOOTER) as u64;
    out.extend_from_slice(&at.to_le_bytes());
    out.extend_from_slice(&end.to_le_bytes());
    out.extend_from_slice(b"CGRE\0\0\0\0");
    let sections = extents(&out);
    fix_checksums(&mut out, &sections);
    out
}

/// Offset and payload length of every section of an intact container, the table of contents last.
pub fn extents(bytes: &[u8]) -> Vec<(usize, usize)> {
    let (mut at, mut out) = (PRELUDE, Vec::new());
    while at < bytes.len() - FOOTER {
        let length = u64_at(bytes, at + 16) as usize;
        out.push((at, length));
        at += SECTION + length;
    }
    out
}

/// Makes every checksum right again after a change; `sections` are the extents from before it.
pub fn fix_checksums(bytes: &mut [u8], sections: &[(usize, usize)]) {
    let mut fix = |from: usize, to: usize, at: usize| {
        let crc = crc32c::crc32c(&bytes[from..to]);
        bytes[at..at + 4].copy_from_slice(&crc.to_le_bytes());
    };
    fix(0, 12, 12);
    for &(at, length) in sections {
        fix(at + SECTION, at + SECTION + length, at + 32);
        fix(at, at + 36, at + 36);
    }
    let end = sections.last().map_or(PRELUDE, |&(at, length)| at + SECTION + length);
    fix(end, end + 20, end + 20);
}

pub fn u64_at(b: &[u8], k: usize) -> u64 {
    (0..8).map(|i| u64::from(b[k + i]) << (8 * i)).sum()
}
