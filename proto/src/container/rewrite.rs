//! Writing a container again: elsewhere, with other layers of edits, or with edited frames.

use super::codec;
use super::edits::{EditLayer, MAX_LAYERS};
use super::reader::ContainerReader;
use super::section::{Entry, RAW, SectionHeader};
use super::writer::ContainerWriter;
use super::{Error, Header, tag};
use crate::le::extend_f32;
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
    /// Copies a container with another origin, other units and, if any, other frame numbers.
    pub fn copy_placed<R: Read + Seek>(
        from: &mut ContainerReader<R>,
        (origin, units): (Option<Point>, Units),
        numbers: &[f64],
        out: W,
    ) -> Result<W, Error> {
        let mut writer = Self::begin(out, Header { origin, units, ..from.header().clone() })?;
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

    /// Copies a container with these layers of edits after all other sections.
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
        let mut writer = Self::begin(out, from.header().clone())?;
        let (edits, others): (Vec<Entry>, Vec<Entry>) =
            from.entries.iter().copied().partition(|entry| entry.header.tag == tag::EDIT);
        for entry in others {
            writer.copy(from, entry)?;
        }
        // What may expand farther than the file's length says.
        let mut allowance = SectionHeader::LAYERS_MORE;
        for layer in layers {
            let (header, payload) = match layer {
                LayerSource::Kept(k) => {
                    let entry = *edits.get(*k).ok_or_else(|| Error::Invalid(format!("there is no layer {k}")))?;
                    (entry.header, from.payload(entry)?)
                }
                LayerSource::New(layer) => encoded(layer, from)?,
            };
            if header.raw_bytes <= SectionHeader::LAYERS_TIMES.saturating_mul(payload.len() as u64) {
                writer.payload(header, &payload)?;
            } else if header.raw_bytes <= allowance {
                allowance -= header.raw_bytes;
                writer.payload(header, &payload)?;
            } else {
                let raw = codec::decode(&header, payload, 1, 0)?;
                writer.payload(SectionHeader { codec: RAW, width: 4, ..header }, &raw)?;
            }
        }
        writer.end()
    }

    /// Copies a container with its frames as edited: chunks with an edited frame are stored
    /// uncoded. Errors of edited frames are unknown; `report` replaces that of the file.
    pub fn copy_flattened<R: Read + Seek>(
        from: &mut ContainerReader<R>,
        report: Option<&Report>,
        out: W,
    ) -> Result<W, Error> {
        let edited = from.edited_frames()?;
        let mut writer = Self::begin(out, from.header().clone())?;
        for k in 0..from.entries.len() {
            let entry = from.entries[k];
            match entry.header.tag {
                tag::EDIT => {}
                tag::FRAMES if edited[entry.header.frames()].contains(&true) => {
                    let (mut raw, mut cage) = (Vec::new(), Vec::new());
                    for frame in entry.header.frames() {
                        from.read_frame(frame, &mut cage)?;
                        extend_f32(&mut raw, &cage);
                    }
                    let SectionHeader { first, count, .. } = entry.header;
                    writer.encoded(SectionHeader::new(tag::FRAMES, (first, count)), &raw)?;
                }
                tag::ERRORS if edited.contains(&true) => {
                    let errors = from.errors()?.into_iter().zip(&edited).flat_map(|(error, &edited)| {
                        let known = [error.l2 as f32, error.linf as f32];
                        if edited { [f32::NAN; 2] } else { known }.map(f32::to_le_bytes)
                    });
                    let raw: Vec<u8> = errors.flatten().collect();
                    writer.section(tag::ERRORS, &raw)?;
                }
                tag::REPORT if report.is_some() => writer.write_report(report)?,
                _ => writer.copy(from, entry)?,
            }
        }
        writer.end()
    }

    fn copy<R: Read + Seek>(&mut self, from: &mut ContainerReader<R>, entry: Entry) -> Result<(), Error> {
        let payload = from.payload(entry)?;
        self.payload(entry.header, &payload)
    }
}

/// The section of a new layer.
fn encoded<R: Read + Seek>(layer: &EditLayer, of: &ContainerReader<R>) -> Result<(SectionHeader, Vec<u8>), Error> {
    of.check_layer(layer)?;
    let frames = layer.frames();
    if frames.end > of.frames() {
        let what = format!("a layer of edits reaches to frame {}, and there are {}", frames.end - 1, of.frames());
        return Err(Error::Invalid(what));
    }
    codec::encode(SectionHeader::new(tag::EDIT, (layer.first, frames.len() as u32)), &layer.to_bytes(), 1)
}
