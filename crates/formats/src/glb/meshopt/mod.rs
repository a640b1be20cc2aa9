//! Views packed as `KHR_meshopt_compression` has it, or as its first version, `EXT_…`, does.
//!
//! Names follow its appendices A (streams) and B (filters). Every reader gives `None` for a stream
//! that ends early, goes on too long, or refers to what was not there before.

mod attributes;
mod bytes;
mod filters;
mod indices;

use gltf::json::buffer::View;

/// How a view is packed, and where.
pub(super) struct Packed {
    pub(super) buffer: usize,
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) count: usize,
    pub(super) stride: usize,
    mode: Mode,
}

enum Mode {
    Attributes(Option<filters::Filter>),
    Triangles,
    Indices,
}

impl Packed {
    /// The outer `None` where a view is not packed, the inner where it is not understood.
    pub(super) fn of(view: &View) -> Option<Option<Self>> {
        let others = &view.extensions.as_ref()?.others;
        let extension = others.get("KHR_meshopt_compression").or_else(|| others.get("EXT_meshopt_compression"))?;
        let number = |name| extension.get(name)?.as_u64();
        let text = |name| extension.get(name)?.as_str();
        let mode = match (text("mode"), text("filter").unwrap_or("NONE")) {
            (Some("ATTRIBUTES"), "NONE") => Some(Mode::Attributes(None)),
            (Some("ATTRIBUTES"), "EXPONENTIAL") => Some(Mode::Attributes(Some(filters::exponential))),
            (Some("ATTRIBUTES"), "QUATERNION") => Some(Mode::Attributes(Some(filters::quaternion))),
            (Some("ATTRIBUTES"), "COLOR") => Some(Mode::Attributes(Some(filters::color))),
            (Some("TRIANGLES"), "NONE") => Some(Mode::Triangles),
            (Some("INDICES"), "NONE") => Some(Mode::Indices),
            // Octahedra are no positions.
            _ => None,
        };
        let packed = || {
            let packed = Self {
                buffer: number("buffer")?.try_into().ok()?,
                offset: number("byteOffset").unwrap_or(0),
                length: number("byteLength")?,
                count: number("count")?.try_into().ok()?,
                stride: number("byteStride")?.try_into().ok()?,
                mode: mode?,
            };
            let fits = match packed.mode {
                Mode::Attributes(_) => packed.stride.is_multiple_of(4) && (4..=256).contains(&packed.stride),
                Mode::Triangles => matches!(packed.stride, 2 | 4) && packed.count.is_multiple_of(3),
                Mode::Indices => matches!(packed.stride, 2 | 4),
            };
            fits.then_some(packed)
        };
        Some(packed())
    }

    pub(super) fn size(&self) -> Option<usize> {
        self.count.checked_mul(self.stride)
    }

    /// Unpacks the view; the caller bounds its size.
    pub(super) fn unpack(&self, stream: &[u8]) -> Option<Vec<u8>> {
        match self.mode {
            Mode::Attributes(filter) => {
                let mut bytes = attributes::decode(stream, self.count, self.stride)?;
                if let Some(filter) = filter {
                    bytes.chunks_exact_mut(self.stride).for_each(filter);
                }
                Some(bytes)
            }
            Mode::Triangles => Some(self.narrowed(&indices::triangles(stream, self.count / 3)?)),
            Mode::Indices => Some(self.narrowed(&indices::sequence(stream, self.count)?)),
        }
    }

    fn narrowed(&self, indices: &[u32]) -> Vec<u8> {
        indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(self.stride)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::bytes::{number, signed};

    #[test]
    fn numbers_take_up_to_five_bytes() {
        let number = |mut bytes: &[u8]| number(&mut bytes);
        assert_eq!(number(&[0x7f]), Some(0x7f));
        assert_eq!(number(&[0x81, 0x04]), Some(0x201));
        assert_eq!(number(&[0xff, 0xa0, 0x05]), Some(0x1507f));
        assert_eq!(number(&[0xff; 5]), None);
        assert_eq!(number(&[0xff]), None);
        assert_eq!([0, 1, 2, 3].map(signed), [0, u32::MAX, 1, u32::MAX - 1]);
    }
}
