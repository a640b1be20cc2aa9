//! The container: a chunk of JSON, and one of positions, corners, times and weights.

use std::fmt::Write as _;
use std::io::{self, Write};

use super::super::lenient::{FIRST_FRAME, FRAME_RATE};
use super::Scene;
use super::stored::{Stored, Values};
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

pub(super) struct Document<'a> {
    pub(super) scene: &'a Scene,
    pub(super) stored: &'a Stored,
    /// Those of all targets, frame after frame.
    pub(super) weights: &'a [f32],
    /// Those of the base and of all targets; empty where none are wanted.
    pub(super) normals: &'a [[f32; 3]],
}

impl Document<'_> {
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let mut json = self.json(None).into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let length = self.lengths().iter().sum::<usize>();
        let word = |x: usize| u32::try_from(x).map(u32::to_le_bytes).map_err(|_| io::ErrorKind::FileTooLarge);
        out.write_all(b"glTF\x02\0\0\0")?;
        out.write_all(&word(28 + json.len() + length)?)?;
        out.write_all(&word(json.len())?)?;
        out.write_all(b"JSON")?;
        out.write_all(&json)?;
        out.write_all(&word(length)?)?;
        out.write_all(b"BIN\0")?;
        self.write_numbers(out)
    }

    /// As text, with all numbers in a file of this name.
    pub(super) fn write_apart(&self, text: &mut impl Write, data: &mut impl Write, name: &str) -> io::Result<()> {
        text.write_all(self.json(Some(name)).as_bytes())?;
        self.write_numbers(data)
    }

    fn write_numbers(&self, out: &mut impl Write) -> io::Result<()> {
        self.write_positions(out)?;
        self.write_corners(out)?;
        let animation = self.scene.times.iter().chain(self.weights);
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

    fn is_float(&self) -> bool {
        matches!(self.stored.values, Values::Floats(_))
    }

    /// Bytes of a position: whole numbers are filled up to whole words.
    fn stride(&self) -> usize {
        if self.is_float() { 12 } else { 8 }
    }

    fn corner_size(&self) -> usize {
        if self.stored.points() <= FEW { 2 } else { 4 }
    }

    /// Bytes of the four views.
    fn lengths(&self) -> [usize; 4] {
        let positions = self.stored.parts() * self.stored.points() * self.stride();
        let corners = (3 * self.scene.triangles.len() * self.corner_size()).next_multiple_of(4);
        let normals = 12 * self.normals.len();
        [positions, corners, 4 * (self.scene.times.len() + self.weights.len()), normals]
    }

    fn write_positions(&self, out: &mut impl Write) -> io::Result<()> {
        match &self.stored.values {
            Values::Floats(values) => values.iter().try_for_each(|x| out.write_all(&x.to_le_bytes())),
            Values::Shorts(values) => values.as_chunks().0.iter().try_for_each(|[x, y, z]: &[i16; 3]| {
                [*x, *y, *z, 0].iter().try_for_each(|x| out.write_all(&x.to_le_bytes()))
            }),
        }
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
        let Scene { name, triangles, .. } = self.scene;
        let (targets, has_faces) = (self.stored.parts() - 1, !triangles.is_empty());
        let mut text = String::from(r#"{"asset":{"version":"2.0","generator":"cager"},"#);
        if !self.is_float() {
            text += r#""extensionsUsed":["KHR_mesh_quantization"],"extensionsRequired":["KHR_mesh_quantization"],"#;
        }
        let place = place(self.stored, self.scene);
        let step = f64::from(self.stored.step);
        let _ = write!(
            text,
            r#""scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"name":"{name}","mesh":0,"translation":{},"scale":[{step},{step},{step}]}}],"#,
            list(place.map(|x| f64::from(x as f32)))
        );
        // Accessors: positions of the base and the targets, then corners, times and weights as far as there are any, and normals.
        let first_normals = targets + 1 + usize::from(has_faces) + if targets > 0 { 2 } else { 0 };
        let normal = |k: usize| match self.normals {
            [] => String::new(),
            _ => format!(r#","NORMAL":{}"#, first_normals + k),
        };
        let primitive = if has_faces { format!(r#","indices":{}"#, targets + 1) } else { r#","mode":0"#.to_owned() };
        let _ = write!(
            text,
            r#""meshes":[{{"name":"{name}","primitives":[{{"attributes":{{"POSITION":0{}}}{primitive}"#,
            normal(0)
        );
        if targets > 0 {
            let all: Vec<String> = (1..=targets).map(|k| format!(r#"{{"POSITION":{k}{}}}"#, normal(k))).collect();
            let _ = write!(
                text,
                r#","targets":[{}]}}],"weights":{}}}],"#,
                all.join(","),
                list(self.weights[..targets].iter().map(|&x| f64::from(x)))
            );
            let times = targets + 1 + usize::from(has_faces);
            let [first, rate] = self.scene.numbering;
            let _ = write!(
                text,
                r#""animations":[{{"name":"{name}","extras":{{"{FIRST_FRAME}":{first},"{FRAME_RATE}":{rate}}},"channels":[{{"sampler":0,"target":{{"node":0,"path":"weights"}}}}],"samplers":[{{"input":{times},"interpolation":"LINEAR","output":{}}}]}}],"#,
                times + 1
            );
        } else {
            text += "}]}],";
        }
        let _ = write!(text, r#""accessors":[{}],"bufferViews":[{}],"#, self.accessors(), self.views());
        let uri = data.map_or_else(String::new, |name| format!(r#","uri":"{}""#, escaped(name)));
        let _ = write!(text, r#""buffers":[{{"byteLength":{}{uri}}}]}}"#, self.lengths().iter().sum::<usize>());
        text
    }

    fn accessors(&self) -> String {
        let (points, stride) = (self.stored.points(), self.stride());
        let kind = if self.is_float() { FLOAT } else { SHORT };
        let accessor = |view: usize, offset: usize, kind: u32, count: usize, rest: &str| {
            format!(r#"{{"bufferView":{view},"byteOffset":{offset},"componentType":{kind},"count":{count},{rest}}}"#)
        };
        let mut all: Vec<String> = (0..self.stored.parts())
            .map(|part| {
                let [low, high] = self.stored.bounds(part);
                let rest = format!(r#""type":"VEC3","min":{},"max":{}"#, list(low), list(high));
                accessor(0, part * points * stride, kind, points, &rest)
            })
            .collect();
        let scalar = r#""type":"SCALAR""#;
        let mut view = 1;
        if !self.scene.triangles.is_empty() {
            let kind = if self.corner_size() == 2 { UNSIGNED_SHORT } else { UNSIGNED_INT };
            all.push(accessor(view, 0, kind, 3 * self.scene.triangles.len(), scalar));
            view += 1;
        }
        let times = &self.scene.times;
        if let (Some(first), Some(last)) = (times.first(), times.last()) {
            let bounds = format!(r#"{scalar},"min":[{}],"max":[{}]"#, f64::from(*first), f64::from(*last));
            all.push(accessor(view, 0, FLOAT, times.len(), &bounds));
            all.push(accessor(view, 4 * times.len(), FLOAT, self.weights.len(), scalar));
            view += 1;
        }
        all.extend(
            (0..self.normals.len() / points)
                .map(|part| accessor(view, 12 * part * points, FLOAT, points, r#""type":"VEC3""#)),
        );
        all.join(",")
    }

    fn views(&self) -> String {
        let [positions, corners, animation, normals] = self.lengths();
        let stride = self.stride();
        let mut all =
            vec![format!(r#"{{"buffer":0,"byteLength":{positions},"byteStride":{stride},"target":{VERTICES}}}"#)];
        if corners > 0 {
            all.push(format!(r#"{{"buffer":0,"byteOffset":{positions},"byteLength":{corners},"target":{CORNERS}}}"#));
        }
        if animation > 0 {
            all.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{animation}}}"#, positions + corners));
        }
        if normals > 0 {
            let start = positions + corners + animation;
            all.push(format!(
                r#"{{"buffer":0,"byteOffset":{start},"byteLength":{normals},"byteStride":12,"target":{VERTICES}}}"#
            ));
        }
        all.join(",")
    }
}

/// Numbers as JSON has them.
fn list(numbers: impl IntoIterator<Item = f64>) -> String {
    let words: Vec<String> = numbers.into_iter().map(|x| x.to_string()).collect();
    format!("[{}]", words.join(","))
}

/// A file name as an address has it.
fn escaped(name: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.bytes()
        .map(|byte| if is_plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") })
        .collect()
}
