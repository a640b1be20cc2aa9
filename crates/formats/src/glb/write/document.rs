//! The container: a chunk of JSON, and one of numbers, which the JSON describes.

use std::io::{self, Write};

use cager_geometry::surface::NO_MATERIAL;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

use super::super::document::{FIRST_FRAME, FRAME_RATE};
use super::look::Looks;
use super::nodes::nodes;
use super::numbers::place;
use super::{Morphs, Piece, Scene};

/// Types of numbers, and what views are for, as glTF counts them.
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const VERTICES: u32 = 34962;
const CORNERS: u32 = 34963;
/// Writes what is in front of so many bytes of numbers in a binary file.
pub(crate) fn write_head(out: &mut impl Write, json: String, length: usize) -> io::Result<()> {
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |x: usize| u32::try_from(x).map(u32::to_le_bytes).map_err(|_| io::ErrorKind::FileTooLarge);
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&word(28 + json.len() + length)?)?;
    out.write_all(&word(json.len())?)?;
    out.write_all(b"JSON")?;
    out.write_all(&json)?;
    out.write_all(&word(length)?)?;
    out.write_all(b"BIN\0")
}

impl Morphs<'_> {
    /// Writes one binary file.
    pub(crate) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write_head(out, self.json(None), self.lengths().iter().sum())?;
        self.write_numbers(out)
    }

    /// As text, with all numbers in a file of this name.
    pub(crate) fn write_apart(&self, text: &mut impl Write, data: &mut impl Write, name: &str) -> io::Result<()> {
        text.write_all(self.json(Some(name)).as_bytes())?;
        self.write_numbers(data)
    }

    fn json(&self, data: Option<&str>) -> String {
        let Scene { name, pieces, materials, times, numbering: [first, rate], .. } = self.scene;
        let stored = &self.components.stored;
        let mut layout = Layout::default();
        let lengths = self.lengths();
        let mut meshes = self.meshes(&mut layout, &lengths);
        let mut document = json!({ "asset": { "version": "2.0", "generator": "cager" }, "scene": 0 });
        let (targets, is_moving) = (stored.parts() - 1, !times.is_empty());
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        if let (Some(start), Some(end), true) = (times.first(), times.last(), targets > 0) {
            let view = layout.view(lengths[2], json!({}));
            let rest = json!({ "type": "SCALAR", "min": [start], "max": [end] });
            let input = layout.accessor(view, 0, FLOAT, times.len(), rest);
            let weights = &self.components.weights;
            let rest = json!({ "type": "SCALAR" });
            let output = layout.accessor(view, 4 * times.len(), FLOAT, weights.len(), rest);
            samplers.push(json!({ "input": input, "interpolation": "LINEAR", "output": output }));
            for (node, mesh) in meshes.iter_mut().enumerate() {
                mesh["weights"] = json!(weights[..targets]);
                channels.push(json!({ "sampler": 0, "target": { "node": node, "path": "weights" } }));
            }
        }
        self.put_attributes(&mut meshes, &mut layout, &lengths);
        if is_moving && lengths[5] > 0 {
            self.put_switches(&mut channels, &mut samplers, &mut layout, lengths[5]);
        }
        if !channels.is_empty() {
            let extras = json!({ FIRST_FRAME: first, FRAME_RATE: rate });
            let animation = json!({ "name": name, "extras": extras, "channels": channels, "samplers": samplers });
            document["animations"] = json!([animation]);
        }
        if !stored.is_float {
            document["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
            document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        }
        let (nodes, roots) = nodes(pieces, place(stored, self.scene).map(|x| x as f32), [stored.step; 3], !is_moving);
        document["scenes"] = json!([{ "nodes": roots }]);
        document["nodes"] = nodes.into();
        document["meshes"] = meshes.into();
        let uv_set = |material: u32, name: &str| {
            let has = |piece: &&Piece| piece.primitives.iter().any(|(found, _)| *found == material);
            let number = |piece: &Piece| piece.uv_names.iter().position(|found| found == name);
            pieces.iter().filter(has).find_map(number).unwrap_or(0)
        };
        Looks::of(materials, uv_set).put(&mut document);
        document["accessors"] = layout.accessors.into();
        document["bufferViews"] = layout.views.into();
        document["buffers"] = json!([{ "byteLength": layout.length }]);
        if let Some(name) = data {
            document["buffers"][0]["uri"] = utf8_percent_encode(name, &ESCAPED).to_string().into();
        }
        document.to_string()
    }

    /// The meshes with positions and corners alone.
    fn meshes(&self, layout: &mut Layout, lengths: &[usize]) -> Vec<Value> {
        let (stored, pieces) = (&self.components.stored, &self.scene.pieces);
        let (stride, mut offset) = (self.stride(), 0);
        let view = layout.view(lengths[0], json!({ "byteStride": stride, "target": VERTICES }));
        let kind = if stored.is_float { FLOAT } else { SHORT };
        for piece in pieces {
            for part in 0..stored.parts() {
                let [low, high] = stored.bounds(part, &piece.vertices);
                let rest = json!({ "type": "VEC3", "min": low, "max": high });
                layout.accessor(view, offset, kind, piece.vertices.len(), rest);
                offset += piece.vertices.len() * stride;
            }
        }
        let kind = if self.corner_size() == 2 { UNSIGNED_SHORT } else { UNSIGNED_INT };
        let view = (lengths[1] > 0).then(|| layout.view(lengths[1], json!({ "target": CORNERS })));
        let (mut meshes, mut offset) = (Vec::new(), 0);
        for piece in pieces {
            let mut primitives = Vec::new();
            for (material, triangles) in &piece.primitives {
                let (count, rest) = (3 * triangles.len(), json!({ "type": "SCALAR" }));
                let indices = layout.accessor(view.unwrap_or_default(), offset, kind, count, rest);
                offset += count * self.corner_size();
                let mut primitive = json!({ "indices": indices });
                if *material != NO_MATERIAL {
                    primitive["material"] = json!(material);
                }
                primitives.push(primitive);
            }
            if primitives.is_empty() {
                primitives.push(json!({ "mode": 0 }));
            }
            meshes.push(json!({ "name": piece.path.last(), "primitives": primitives }));
        }
        meshes
    }

    /// What vertices have, and targets.
    fn put_attributes(&self, meshes: &mut [Value], layout: &mut Layout, lengths: &[usize]) {
        let (parts, pieces) = (self.components.stored.parts(), &self.scene.pieces);
        let mut all: Vec<Vec<Value>> = Vec::new();
        for k in 0..pieces.len() {
            all.push((0..parts).map(|part| json!({ "POSITION": k * parts + part })).collect());
        }
        if lengths[3] > 0 {
            let view = layout.view(lengths[3], json!({ "byteStride": 12, "target": VERTICES }));
            let mut offset = 0;
            for (piece, attributes) in pieces.iter().zip(&mut all).filter(|(piece, _)| piece.normals.is_some()) {
                let count = piece.vertices.len();
                for attributes in attributes {
                    attributes["NORMAL"] =
                        json!(layout.accessor(view, offset, FLOAT, count, json!({ "type": "VEC3" })));
                    offset += 12 * count;
                }
            }
        }
        if lengths[4] > 0 {
            // A view for each set, as it says how far elements are apart.
            for (piece, attributes) in pieces.iter().zip(&mut all) {
                let count = piece.vertices.len();
                let uvs = (0..piece.uv_sets.len()).map(|k| (format!("TEXCOORD_{k}"), "VEC2", 8));
                let colors = (0..piece.color_sets.len()).map(|k| (format!("COLOR_{k}"), "VEC4", 16));
                for (name, shape, stride) in uvs.chain(colors) {
                    let view = layout.view(count * stride, json!({ "byteStride": stride, "target": VERTICES }));
                    attributes[0][name] = json!(layout.accessor(view, 0, FLOAT, count, json!({ "type": shape })));
                }
            }
        }
        for (mesh, mut attributes) in meshes.iter_mut().zip(all) {
            let base = attributes.remove(0);
            for primitive in mesh["primitives"].as_array_mut().into_iter().flatten() {
                primitive["attributes"] = base.clone();
                if parts > 1 {
                    primitive["targets"] = attributes.clone().into();
                }
            }
        }
    }

    /// Scales that show and hide meshes.
    fn put_switches(&self, channels: &mut Vec<Value>, samplers: &mut Vec<Value>, layout: &mut Layout, length: usize) {
        let (view, mut offset) = (layout.view(length, json!({})), 0);
        for (node, piece) in self.scene.pieces.iter().enumerate() {
            let switches = self.switches(piece);
            let (Some(first), Some(last)) = (switches.first(), switches.last()) else { continue };
            let [start, end] = [first, last].map(|&(frame, _)| self.scene.times[frame]);
            let rest = json!({ "type": "SCALAR", "min": [start], "max": [end] });
            let input = layout.accessor(view, offset, FLOAT, switches.len(), rest);
            let rest = json!({ "type": "VEC3" });
            let output = layout.accessor(view, offset + 4 * switches.len(), FLOAT, switches.len(), rest);
            offset += 16 * switches.len();
            channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": "scale" } }));
            samplers.push(json!({ "input": input, "interpolation": "STEP", "output": output }));
        }
    }
}

#[derive(Default)]
struct Layout {
    views: Vec<Value>,
    accessors: Vec<Value>,
    length: usize,
}

impl Layout {
    /// Adds the next view; gives its index.
    fn view(&mut self, length: usize, mut view: Value) -> usize {
        (view["buffer"], view["byteOffset"], view["byteLength"]) = (json!(0), json!(self.length), json!(length));
        self.length += length;
        self.views.push(view);
        self.views.len() - 1
    }

    /// Adds an accessor of some numbers in a view; gives its index.
    fn accessor(&mut self, view: usize, offset: usize, kind: u32, count: usize, mut accessor: Value) -> usize {
        (accessor["bufferView"], accessor["byteOffset"]) = (json!(view), json!(offset));
        (accessor["componentType"], accessor["count"]) = (json!(kind), json!(count));
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

/// What file names have as they are in addresses, beside letters and digits.
pub(super) const ESCAPED: AsciiSet = NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');
