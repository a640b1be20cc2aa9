//! The container: a chunk of JSON, and one of positions, corners, times and weights.

use std::io::{self, Write};

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

use super::super::document::{FIRST_FRAME, FRAME_RATE};
use super::stored::Stored;
use super::{Morphs, Scene};
use crate::error::Fault;

/// Types of numbers, and what views are for, as glTF counts them.
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const VERTICES: u32 = 34962;
const CORNERS: u32 = 34963;
/// Vertices that corners of two bytes count; the last number has a meaning of its own.
const FEW: usize = 65_535;

/// Where the middle of the stored positions is.
pub(super) fn place(stored: &Stored, scene: &Scene) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(stored.centre[k]) + scene.origin[k])
}

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

    fn write_numbers(&self, out: &mut impl Write) -> io::Result<()> {
        self.write_positions(out)?;
        self.write_corners(out)?;
        let animation = self.scene.times.iter().chain(&self.components.weights);
        animation.chain(self.normals.as_flattened()).try_for_each(|x| out.write_all(&x.to_le_bytes()))
    }

    /// Refuses what the lengths in the file cannot count.
    pub(super) fn check(&self) -> Result<(), Fault> {
        // What is described beside the numbers takes far less than this.
        const OTHER: usize = 1 << 24;
        if self.lengths().iter().sum::<usize>() > u32::MAX as usize - OTHER {
            return Err(Fault::unsupported(
                "cannot hold more than 4 GiB; take fewer morph targets (--targets), or write .usdc or .abc",
            ));
        }
        Ok(())
    }

    /// Bytes of a position: whole numbers are filled up to whole words.
    fn stride(&self) -> usize {
        if self.components.stored.is_float { 12 } else { 8 }
    }

    fn corner_size(&self) -> usize {
        if self.components.stored.points() <= FEW { 2 } else { 4 }
    }

    fn lengths(&self) -> [usize; 4] {
        let positions = self.components.stored.parts() * self.components.stored.points() * self.stride();
        let corners = (3 * self.scene.triangles.len() * self.corner_size()).next_multiple_of(4);
        let normals = 12 * self.normals.len();
        [positions, corners, 4 * (self.scene.times.len() + self.components.weights.len()), normals]
    }

    fn write_positions(&self, out: &mut impl Write) -> io::Result<()> {
        let values = &self.components.stored.values;
        if self.components.stored.is_float {
            return values.iter().try_for_each(|x| out.write_all(&x.to_le_bytes()));
        }
        values.as_chunks().0.iter().try_for_each(|&[x, y, z]: &[f32; 3]| {
            out.write_all([x, y, z, 0.0].map(|x| (x as i16).to_le_bytes()).as_flattened())
        })
    }

    fn write_corners(&self, out: &mut impl Write) -> io::Result<()> {
        let (corners, small) = (self.scene.triangles.as_flattened(), self.corner_size() == 2);
        for corner in corners {
            let bytes = corner.to_le_bytes();
            out.write_all(if small { &bytes[..2] } else { &bytes })?;
        }
        if small && corners.len() % 2 == 1 {
            out.write_all(&[0; 2])?;
        }
        Ok(())
    }

    fn json(&self, data: Option<&str>) -> String {
        let Scene { name, triangles, times, numbering: [first, rate], .. } = self.scene;
        let (points, targets, stride) =
            (self.components.stored.points(), self.components.stored.parts() - 1, self.stride());
        let mut layout = Layout::default();
        let [positions, corners, animation, normals] = self.lengths();
        let view = layout.view(positions, json!({ "byteStride": stride, "target": VERTICES }));
        let kind = if self.components.stored.is_float { FLOAT } else { SHORT };
        for part in 0..=targets {
            let [low, high] = self.components.stored.bounds(part);
            let rest = json!({ "type": "VEC3", "min": low, "max": high });
            layout.accessor(view, part * points * stride, kind, points, rest);
        }
        let mut primitive = json!({});
        if triangles.is_empty() {
            primitive["mode"] = json!(0);
        } else {
            let kind = if self.corner_size() == 2 { UNSIGNED_SHORT } else { UNSIGNED_INT };
            let view = layout.view(corners, json!({ "target": CORNERS }));
            let rest = json!({ "type": "SCALAR" });
            primitive["indices"] = json!(layout.accessor(view, 0, kind, 3 * triangles.len(), rest));
        }
        let mut document =
            json!({ "asset": { "version": "2.0", "generator": "cager" }, "scene": 0, "scenes": [{ "nodes": [0] }] });
        let mut mesh = json!({ "name": name });
        if let (Some(start), Some(end), true) = (times.first(), times.last(), targets > 0) {
            let view = layout.view(animation, json!({}));
            let rest = json!({ "type": "SCALAR", "min": [start], "max": [end] });
            let input = layout.accessor(view, 0, FLOAT, times.len(), rest);
            let rest = json!({ "type": "SCALAR" });
            let output = layout.accessor(view, 4 * times.len(), FLOAT, self.components.weights.len(), rest);
            mesh["weights"] = json!(self.components.weights[..targets]);
            document["animations"] = json!([{
                "name": name,
                "extras": { FIRST_FRAME: first, FRAME_RATE: rate },
                "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
                "samplers": [{ "input": input, "interpolation": "LINEAR", "output": output }],
            }]);
        }
        let mut attributes: Vec<Value> = (0..=targets).map(|part| json!({ "POSITION": part })).collect();
        if normals > 0 {
            let view = layout.view(normals, json!({ "byteStride": 12, "target": VERTICES }));
            for (part, attributes) in attributes.iter_mut().enumerate() {
                let offset = 12 * part * points;
                attributes["NORMAL"] = json!(layout.accessor(view, offset, FLOAT, points, json!({ "type": "VEC3" })));
            }
        }
        primitive["attributes"] = attributes.remove(0);
        if targets > 0 {
            primitive["targets"] = attributes.into();
        }
        mesh["primitives"] = json!([primitive]);
        if !self.components.stored.is_float {
            document["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
            document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        }
        let (place, scale) =
            (place(&self.components.stored, self.scene).map(|x| x as f32), [self.components.stored.step; 3]);
        document["nodes"] = json!([{ "name": name, "mesh": 0, "translation": place, "scale": scale }]);
        document["meshes"] = json!([mesh]);
        document["accessors"] = layout.accessors.into();
        document["bufferViews"] = layout.views.into();
        document["buffers"] = json!([{ "byteLength": layout.length }]);
        if let Some(name) = data {
            document["buffers"][0]["uri"] = utf8_percent_encode(name, &ESCAPED).to_string().into();
        }
        document.to_string()
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
const ESCAPED: AsciiSet = NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');
