//! What lies on the faces of the model: names as JSON behind their length, then numbers as `cager-codec` codes them.

use super::reader::ContainerReader;
use super::writer::ContainerWriter;
use super::{Error, tag};
use cager_codec::CodedSurface;
use cager_geometry::mesh::Polygons;
use cager_geometry::surface::Surface;
use std::io::{Read, Seek, Write};

/// Texts of a thing that is named, its keys among them, rather too many.
const KEYS: u64 = 32;
/// Names of pictures by frame, unless the file has bytes for more; they take 50 bytes of memory each.
const MOST_PICTURE_NAMES: u64 = 1 << 20;

impl<W: Write> ContainerWriter<W> {
    pub(super) fn write_surface(&mut self, coded: &CodedSurface) -> Result<(), Error> {
        let names = serde_json::to_vec(&coded.outline).map_err(|e| Error::Invalid(e.to_string()))?;
        let length = u32::try_from(names.len()).map_err(|_| Error::TooLarge("names of 4 GiB".to_owned()))?;
        self.section(tag::SURFACE, &[&length.to_le_bytes()[..], &names, &coded.bytes].concat())
    }
}

impl<R: Read + Seek> ContainerReader<R> {
    /// What lies on the faces of the model, and these faces in the order of the source, which is that of the surface;
    /// `None` where the file has nothing of it.
    pub fn surface(&mut self) -> Result<Option<(Surface, Polygons)>, Error> {
        let Some((offset, raw)) = self.optional(tag::SURFACE)? else { return Ok(None) };
        let corrupt = |what: &str| Error::corrupt(offset, format!("what lies on the faces {what}"));
        let (length, rest) = raw.split_first_chunk::<4>().ok_or_else(|| corrupt("is cut"))?;
        let (names, numbers) =
            rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(|| corrupt("is cut"))?;
        // Before any is made: parts have points, faces have materials, creases and groups.
        let things = self.header.points.saturating_add(self.header.rest_corners).saturating_mul(8);
        let count = |mark: u8| names.iter().filter(|&&b| b == mark).count() as u64;
        // Texts are those within these, and names of pictures by frame.
        let texts = KEYS.saturating_mul(count(b'{')).saturating_add(MOST_PICTURE_NAMES).saturating_add(self.file_bytes);
        if count(b'{') > things.saturating_add(1 << 16) || count(b'"') / 2 > texts {
            return Err(corrupt("names more than lies on them"));
        }
        let outline = serde_json::from_slice(names).map_err(|e| corrupt(&format!("cannot be read ({e})")))?;
        let coded = CodedSurface { outline, bytes: numbers.to_vec() };
        let rest = self.rest()?;
        let decoded = coded.decode(&rest.faces, rest.points.len());
        decoded.map(Some).map_err(|cause| Error::corrupt(offset, cause.to_string()))
    }
}
