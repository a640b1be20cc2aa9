//! Positions and indices from the binary chunk.

use cager_core::mesh::Point;
use gltf::json::Root;
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::validation::Checked;

use super::{dangling, too_large};
use crate::error::Fault;

pub(super) struct Buffers<'a> {
    pub(super) root: &'a Root,
    pub(super) binary: &'a [u8],
}

impl Buffers<'_> {
    /// The positions of an accessor, which must have no more than `most`.
    pub(super) fn positions(&self, index: usize, most: usize, place: &str) -> Result<Vec<Point>, Fault> {
        let (component, shape) = self.kind(index, place)?;
        if (component, shape) != (ComponentType::F32, Type::Vec3) {
            return Err(Fault::unsupported(format!(
                "{place}: positions are {shape:?} of {component:?}, not Vec3 of F32; export the mesh without quantization"
            )));
        }
        let mut points = Vec::new();
        self.for_each(index, most, place, |bytes: &[u8; 12]| {
            let coordinates = bytes.as_chunks::<4>().0;
            points.push([0, 1, 2].map(|k| f64::from(f32::from_le_bytes(coordinates[k]))));
        })?;
        Ok(points)
    }

    /// The colours of an accessor in linear light, which must have no more than `most`; an opacity is passed over.
    pub(super) fn colors(&self, index: usize, most: usize, place: &str) -> Result<Vec<[f32; 3]>, Fault> {
        let (component, shape) = self.kind(index, place)?;
        let (size, value): (usize, fn(&[u8]) -> f32) = match component {
            ComponentType::U8 => (1, |b| f32::from(b[0]) / 255.0),
            ComponentType::U16 => (2, |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0),
            ComponentType::F32 => (4, |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => return Ok(Vec::new()),
        };
        let channels = match shape {
            Type::Vec3 => 3,
            Type::Vec4 => 4,
            _ => return Ok(Vec::new()),
        };
        let Elements { bytes, stride, count } = self.elements(index, size * channels, most, place)?;
        // The last element may be shorter than the stride, but has all its channels.
        let color = |element: &[u8]| [0, 1, 2].map(|k| value(&element[k * size..]));
        Ok(bytes.chunks(stride).take(count).map(color).collect())
    }

    /// The vertex indices of an accessor, which must have no more than `most`.
    pub(super) fn indices(&self, index: usize, most: usize, place: &str) -> Result<Vec<u32>, Fault> {
        let mut indices = Vec::new();
        match self.kind(index, place)? {
            (ComponentType::U8, Type::Scalar) => {
                self.for_each(index, most, place, |&[byte]: &[u8; 1]| indices.push(byte.into()))?;
            }
            (ComponentType::U16, Type::Scalar) => {
                self.for_each(index, most, place, |&bytes| indices.push(u16::from_le_bytes(bytes).into()))?;
            }
            (ComponentType::U32, Type::Scalar) => {
                self.for_each(index, most, place, |&bytes| indices.push(u32::from_le_bytes(bytes)))?;
            }
            (component, shape) => {
                return Err(Fault::damaged(format!(
                    "{place}: indices are {shape:?} of {component:?}, not unsigned integers; export the mesh again"
                )));
            }
        }
        Ok(indices)
    }

    fn kind(&self, index: usize, place: &str) -> Result<(ComponentType, Type), Fault> {
        let accessors = &self.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| dangling(&format!("accessor {index}"), accessors.len()))?;
        if accessor.sparse.is_some() {
            return Err(Fault::unsupported(format!(
                "{place}: accessor {index} is sparse; export the mesh without that"
            )));
        }
        match (accessor.component_type, accessor.type_) {
            (Checked::Valid(GenericComponentType(component)), Checked::Valid(shape)) => Ok((component, shape)),
            _ => Err(Fault::damaged(format!("{place}: accessor {index} has an unknown type; export the mesh again"))),
        }
    }

    /// Calls `each` with every element.
    fn for_each<const N: usize>(
        &self,
        index: usize,
        most: usize,
        place: &str,
        mut each: impl FnMut(&[u8; N]),
    ) -> Result<(), Fault> {
        let Elements { bytes, stride, count } = self.elements(index, N, most, place)?;
        for element in bytes.chunks(stride).take(count) {
            // The last element may be shorter than the stride, but not than `N`.
            if let Some(element) = element.first_chunk() {
                each(element);
            }
        }
        Ok(())
    }

    /// The elements, of `size` bytes, of an accessor whose type is known.
    fn elements(&self, index: usize, size: usize, most: usize, place: &str) -> Result<Elements<'_>, Fault> {
        let accessor = &self.root.accessors[index];
        let views = &self.root.buffer_views;
        let Some(view) = accessor.buffer_view else {
            return Err(Fault::unsupported(format!(
                "{place}: accessor {index} has no data of its own; export the mesh without compression"
            )));
        };
        let view = views.get(view.value()).ok_or_else(|| dangling(&format!("bufferView {view}"), views.len()))?;
        let stored = self.root.buffers.get(view.buffer.value());
        if view.buffer.value() != 0 || stored.is_none_or(|buffer| buffer.uri.is_some()) {
            return Err(Fault::unsupported(format!(
                "{place}: accessor {index} has its data in another file; export one self-contained .glb"
            )));
        }
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(Fault::damaged(format!(
                "{place}: accessor {index} has elements of {size} bytes at a stride of {stride}; export the mesh again"
            )));
        }
        let outside = || {
            Fault::damaged(format!(
                "{place}: accessor {index} reaches beyond the binary data; copy or export the file again"
            ))
        };
        let part = |bytes: &'_ [u8], offset: u64| usize::try_from(offset).ok().filter(|&offset| offset <= bytes.len());
        let start = part(self.binary, view.byte_offset.map_or(0, |offset| offset.0)).ok_or_else(outside)?;
        let length = part(&self.binary[start..], view.byte_length.0).ok_or_else(outside)?;
        let bytes = &self.binary[start..start + length];
        let offset = part(bytes, accessor.byte_offset.map_or(0, |offset| offset.0)).ok_or_else(outside)?;
        let bytes = &bytes[offset..];
        let Some(last) = accessor.count.0.checked_sub(1) else {
            return Ok(Elements { bytes: &[], stride, count: 0 });
        };
        let end = last.checked_mul(stride as u64).and_then(|start| start.checked_add(size as u64));
        if end.is_none_or(|end| end > bytes.len() as u64) {
            return Err(outside());
        }
        if last >= most as u64 {
            return Err(too_large());
        }
        Ok(Elements { bytes, stride, count: last as usize + 1 })
    }
}

/// Where the elements of an accessor are; all of them are there.
struct Elements<'a> {
    bytes: &'a [u8],
    /// Bytes from the start of one to the start of the next, at least the size of one.
    stride: usize,
    count: usize,
}
