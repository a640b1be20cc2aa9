//! Primitives that Draco compressed (`KHR_draco_mesh_compression`), unpacked into a buffer of their
//! own. The streams are the `draco-core` crate's to read; what they say is bounded here.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf::json::Root;
use gltf::json::accessor::{ComponentType, GenericComponentType};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::attribute;
use super::buffers::Buffers;
use super::faults::{damaged, item, too_large};
use crate::error::Fault;

/// The name of the extension.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";
/// Bytes that unpacking takes for each that it gives.
const WORK: usize = 8;

/// A primitive that is packed.
struct Packed {
    place: String,
    view: usize,
    /// The accessors of its attributes, and the numbers that these have in the stream.
    attributes: Vec<(usize, u32)>,
    indices: Option<usize>,
}

/// Gives all accessors of packed primitives their numbers; files that have the plain ones too stay
/// as they are.
pub(super) fn unpack(buffers: &mut Buffers<'_>) -> Result<(), Fault> {
    let packed = packed(&buffers.root)?;
    if packed.is_empty() {
        return Ok(());
    }
    let (mut bytes, mut views, mut ranges) = (Vec::new(), HashSet::new(), Vec::new());
    for Packed { place, view, attributes, indices } in packed {
        if !views.insert(view) {
            return Err(damaged(&place, format!("shares the packed bufferView {view} with another")));
        }
        let room = (buffers.most_bytes() / WORK).saturating_sub(bytes.len());
        let mesh = mesh(buffers.view(view, &place)?.0, room)
            .ok_or_else(|| damaged(&place, "its Draco data is not understood, or is too large"))?;
        for (index, id) in attributes {
            let accessor = item(&buffers.root.accessors, "accessor", index)?;
            let wrong = || damaged(&place, format!("its Draco data has no accessor {index}"));
            let (Checked::Valid(GenericComponentType(component)), Checked::Valid(shape)) =
                (accessor.component_type, accessor.type_)
            else {
                return Err(wrong());
            };
            let attribute = mesh.attribute_by_unique_id(id).ok_or_else(wrong)?;
            let (count, width) = (mesh.num_points(), shape.multiplicity());
            if accessor.count.0 != count as u64 || usize::from(attribute.num_components()) < width {
                return Err(wrong());
            }
            if bytes.len() + 4 * width * count > room {
                return Err(too_large());
            }
            let start = bytes.len();
            attribute.read_f32s(count, width).into_iter().for_each(|x| put(&mut bytes, component, x));
            ranges.push((index, start..bytes.len()));
        }
        if let Some(index) = indices {
            let accessor = buffers.root.accessors.get_mut(index).filter(|it| it.count.0 == 3 * mesh.num_faces() as u64);
            let accessor = accessor.ok_or_else(|| damaged(&place, "its Draco data has other faces than it says"))?;
            accessor.component_type = Checked::Valid(GenericComponentType(ComponentType::U32));
            let start = bytes.len();
            bytes.extend(mesh.faces().as_flattened().iter().flat_map(|point| point.0.to_le_bytes()));
            ranges.push((index, start..bytes.len()));
        }
    }
    buffers.append(bytes, &ranges)
}

/// The packed primitives whose positions are nowhere else.
fn packed(root: &Root) -> Result<Vec<Packed>, Fault> {
    let mut all = Vec::new();
    let mut known = HashSet::new();
    for (mesh, primitives) in root.meshes.iter().map(|mesh| &mesh.primitives).enumerate() {
        for (k, primitive) in primitives.iter().enumerate() {
            let extension = primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(DRACO));
            let (Some(extension), Some(positions)) = (extension, attribute(primitive, Semantic::Positions)) else {
                continue;
            };
            let is_empty = |index: usize| root.accessors.get(index).is_some_and(|it| it.buffer_view.is_none());
            if !is_empty(positions) || !known.insert(positions) {
                continue;
            }
            let place = format!("mesh {mesh}, primitive {k}");
            let index = |value: &gltf::json::Value| value.as_u64().and_then(|x| usize::try_from(x).ok());
            let view = index(&extension["bufferView"]).ok_or_else(|| damaged(&place, "its Draco data is nowhere"))?;
            let indices = primitive.indices.map(|index| index.value()).filter(|&index| is_empty(index));
            all.push(Packed { attributes: attributes(primitive, extension, is_empty), place, view, indices });
        }
    }
    Ok(all)
}

fn attributes(
    primitive: &Primitive,
    extension: &gltf::json::Value,
    is_empty: impl Fn(usize) -> bool,
) -> Vec<(usize, u32)> {
    let numbered = primitive.attributes.iter().filter_map(|(semantic, index)| {
        let Checked::Valid(semantic) = semantic else { return None };
        let id = extension["attributes"].get(semantic.to_string())?.as_u64()?;
        Some((index.value(), u32::try_from(id).ok()?))
    });
    numbered.filter(|&(index, _)| is_empty(index)).collect()
}

/// The mesh of a stream that takes no more than so many bytes.
fn mesh(stream: &[u8], most: usize) -> Option<Mesh> {
    let limits = DecodeLimits::default()
        .with_max_points(most as u64 / 12)
        .with_max_faces(most as u64 / 12)
        .with_max_decoded_bytes(most as u64);
    let decode = || {
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut DecoderBuffer::new(stream).with_limits(limits), &mut mesh).ok()?;
        Some(mesh)
    };
    // Whatever is wrong in a foreign crate is a damaged file here.
    catch_unwind(AssertUnwindSafe(decode)).ok().flatten()
}

/// A number as accessors have it.
fn put(bytes: &mut Vec<u8>, component: ComponentType, x: f32) {
    match component {
        ComponentType::I8 => bytes.extend((x as i8).to_le_bytes()),
        ComponentType::U8 => bytes.push(x as u8),
        ComponentType::I16 => bytes.extend((x as i16).to_le_bytes()),
        ComponentType::U16 => bytes.extend((x as u16).to_le_bytes()),
        ComponentType::U32 => bytes.extend((x as u32).to_le_bytes()),
        ComponentType::F32 => bytes.extend(x.to_le_bytes()),
    }
}
