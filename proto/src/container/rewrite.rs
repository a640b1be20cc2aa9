//! Writing a container again of the sections of another: with other layers of edits, with layers that become its frames, or elsewhere.

use super::codec::{self, DIFFERENCE, PLANES, RAW};
use super::edits::{EditLayer, MAX_LAYERS};
use super::reader::ContainerReader;
use super::section::{self, Entry, SectionHeader};
use super::writer::ContainerWriter;
use super::{Error, Header, tag};
use crate::report::Report;
use cager_geometry::mesh::Point;
use cager_geometry::units::Units;
use std::io::{Read, Seek, Write};

/// A layer of a file that is written.
#[derive(Clone, Debug)]
pub enum LayerSource {
    /// The one with this number among those of the file that it is made from, from 0.
    Kept(usize),
    /// Another one.
    New(EditLayer),
}

impl<W: Write> ContainerWriter<W> {
    /// Writes a container again with another origin, other units and, where there are any, other numbers of frames; everything else keeps its bytes.
    ///
    /// # Errors
    /// Damage; an output that refuses.
    pub fn copy_placed<R: Read + Seek>(
        from: &mut ContainerReader<R>,
        (origin, units): (Option<Point>, Units),
        numbers: &[f64],
        out: W,
    ) -> Result<W, Error> {
        let mut writer = Self::empty(out, Header { origin, units, ..from.header().clone() });
        writer.put(&section::prelude())?;
        for k in 0..from.entries.len() {
            let entry = from.entries[k];
            match entry.header.tag {
                tag::ORIGIN | tag::UNITS => continue,
                tag::NUMBERS if !numbers.is_empty() => continue,
                tag::ERRORS if !numbers.is_empty() => writer.number(numbers, from.frames())?,
                _ => {}
            }
            writer.copy(from, entry)?;
            if entry.header.tag == tag::HEADER {
                writer.write_placement()?;
            }
        }
        writer.end()
    }

    /// Writes a container again with these layers of edits, after all other sections, which keep their bytes.
    ///
    /// # Errors
    /// Layers that readers would refuse; damage; an output that refuses.
    pub fn copy_with_layers<R: Read + Seek>(
        from: &mut ContainerReader<R>,
        layers: &[LayerSource],
        out: W,
    ) -> Result<W, Error> {
        if layers.len() > MAX_LAYERS {
            let what = format!("a file has at most {MAX_LAYERS} layers of edits; flatten it, or take some back");
            return Err(Error::Invalid(what));
        }
        let mut writer = Self::empty(out, from.header().clone());
        writer.put(&section::prelude())?;
        let (edits, others): (Vec<Entry>, Vec<Entry>) =
            from.entries.iter().copied().partition(|entry| entry.header.tag == tag::EDIT);
        for entry in others {
            writer.copy(from, entry)?;
        }
        // What may expand farther than the file's length says.
        let mut allowance = SectionHeader::LAYERS_MORE;
        for layer in layers {
            let (header, payload, raw) = match layer {
                LayerSource::Kept(k) => {
                    let entry = *edits.get(*k).ok_or_else(|| Error::Invalid(format!("there is no layer {k}")))?;
                    (entry.header, from.payload(entry)?, None)
                }
                LayerSource::New(layer) => encoded(layer, from)?,
            };
            let times = SectionHeader::LAYERS_TIMES.saturating_mul(payload.len() as u64);
            let frames = (header.first, header.count);
            if header.raw_bytes <= times || header.raw_bytes <= allowance {
                allowance -= if header.raw_bytes <= times { 0 } else { header.raw_bytes };
                writer.payload((tag::EDIT, header.codec, header.width), &payload, header.raw_bytes as usize, frames)?;
                continue;
            }
            let raw = match (raw, layer) {
                (Some(raw), _) => raw,
                (None, LayerSource::Kept(k)) => from.raw(edits[*k])?,
                (None, LayerSource::New(_)) => payload,
            };
            writer.payload((tag::EDIT, RAW, 4), &raw, raw.len(), frames)?;
        }
        writer.end()
    }

    /// Writes a container again whose frames are the edited ones: chunks without an edited frame keep their bytes, the cages of others are stored as they
    /// are, and so is what is added to their positions. Errors of edited frames are not measured; `report` takes the place of the one in the file.
    ///
    /// # Errors
    /// Damage; an output that refuses.
    pub fn copy_flattened<R: Read + Seek>(
        from: &mut ContainerReader<R>,
        report: Option<&Report>,
        out: W,
    ) -> Result<W, Error> {
        let edited = from.edited_frames()?;
        let mut writer = Self::empty(out, from.header().clone());
        writer.put(&section::prelude())?;
        let stride = 3 * from.header().rows_per_frame as usize;
        for k in 0..from.entries.len() {
            let entry = from.entries[k];
            let SectionHeader { first, count, .. } = entry.header;
            match entry.header.tag {
                tag::EDIT => {}
                tag::FRAMES if edited[first as usize..(first + count) as usize].contains(&true) => {
                    let (mut raw, mut cage) = (Vec::new(), Vec::new());
                    for frame in first..first + count {
                        from.read_frame(frame as usize, &mut cage)?;
                        raw.extend(cage.iter().flat_map(|x| x.to_le_bytes()));
                    }
                    writer.chunk(tag::FRAMES, DIFFERENCE, 4, stride, &raw, (first, count))?;
                }
                tag::ERRORS if edited.contains(&true) => {
                    let errors = from.errors()?.into_iter().zip(&edited).flat_map(|(error, &edited)| {
                        let known = [error.l2 as f32, error.linf as f32];
                        if edited { [f32::NAN; 2] } else { known }.map(f32::to_le_bytes)
                    });
                    let raw: Vec<u8> = errors.flatten().collect();
                    writer.section(tag::ERRORS, PLANES, 4, 0, &raw)?;
                }
                tag::REPORT if report.is_some() => writer.write_report(report)?,
                _ => writer.copy(from, entry)?,
            }
        }
        writer.end()
    }

    fn copy<R: Read + Seek>(&mut self, from: &mut ContainerReader<R>, entry: Entry) -> Result<(), Error> {
        let payload = from.payload(entry)?;
        let SectionHeader { tag, codec, width, first, count, raw_bytes, .. } = entry.header;
        self.payload((tag, codec, width), &payload, raw_bytes as usize, (first, count))
    }
}

/// A layer's header without checksums, its payload, and its bytes before they were compressed.
type EncodedLayer = (SectionHeader, Vec<u8>, Option<Vec<u8>>);

/// The section of a new layer.
fn encoded<R: Read + Seek>(layer: &EditLayer, of: &ContainerReader<R>) -> Result<EncodedLayer, Error> {
    let frames = layer.frames();
    let fits = layer.check(of.vertex_rows());
    fits.map_err(|what| Error::Invalid(what.to_owned()))?;
    if frames.end > of.frames() {
        let what = format!("a layer of edits reaches to frame {}, and there are {}", frames.end - 1, of.frames());
        return Err(Error::Invalid(what));
    }
    let raw = layer.to_bytes();
    let (codec, payload) = codec::encode(PLANES, &raw, 4, 0)?;
    let header = SectionHeader {
        tag: tag::EDIT,
        codec,
        width: 4,
        first: layer.first,
        count: frames.len() as u32,
        payload_bytes: payload.len() as u64,
        raw_bytes: raw.len() as u64,
        payload_crc: 0,
    };
    Ok((header, payload, (codec != RAW).then_some(raw)))
}
