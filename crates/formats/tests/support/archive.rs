//! Alembic archives made by hand: what the writer does not write, and what no program should.

#![allow(dead_code, unreachable_pub)]

use std::collections::BTreeMap;

pub const DATA: u64 = 1 << 63;
pub const MESH: &str = "schema=AbcGeom_PolyMesh_v1";
pub const SUBDIVISION: &str = "schema=AbcGeom_SubD_v1";
pub const FACE_SET: &str = "schema=AbcGeom_FaceSet_v1";
pub const TRANSFORM: &str = "schema=AbcGeom_Xform_v3";

/// Types of numbers.
pub const BOOL: u32 = 0;
pub const U8: u32 = 1;
pub const U32: u32 = 5;
pub const I32: u32 = 6;
pub const F32: u32 = 10;
pub const F64: u32 = 11;
pub const TEXT: u32 = 12;

/// The header of a property and its samples.
#[derive(Clone)]
pub struct Property {
    pub name: &'static str,
    pub metadata: &'static str,
    /// 0 a compound, 1 a scalar, 2 an array.
    pub kind: u32,
    pub number: u32,
    pub extent: u32,
    pub samples: Vec<Vec<u8>>,
    /// How many samples there are, and the first and last that differ, where those stored are not all.
    pub changes: Option<[u32; 3]>,
    pub sampling: u32,
    /// What a compound has.
    pub inner: Vec<Property>,
}

/// An object, its properties in a compound of this name, and what lies below it.
#[derive(Clone)]
pub struct Node {
    pub name: &'static str,
    pub metadata: &'static str,
    pub compound: &'static str,
    pub properties: Vec<Property>,
    pub children: Vec<Node>,
}

pub fn array<const N: usize, T: Copy>(
    name: &'static str,
    (number, extent): (u32, u32),
    sampling: u32,
    samples: &[Vec<T>],
    bytes: impl Fn(T) -> [u8; N],
) -> Property {
    let samples = samples.iter().map(|sample| sample.iter().flat_map(|&x| bytes(x)).collect()).collect();
    Property { name, metadata: "a=b", kind: 2, number, extent, samples, changes: None, sampling, inner: vec![] }
}

/// Values that are the same in all frames, and what is said of them.
pub fn parameter(name: &'static str, metadata: &'static str, extent: u32, values: &[f32]) -> Property {
    Property { metadata, ..array(name, (F32, extent), 0, &[values.to_vec()], f32::to_le_bytes) }
}

pub fn compound(name: &'static str, metadata: &'static str, inner: Vec<Property>) -> Property {
    let none = array(name, (0, 0), 0, &[], u8::to_le_bytes);
    Property { metadata, kind: 0, inner, ..none }
}

pub fn integers(name: &'static str, values: &[i32]) -> Property {
    array(name, (I32, 1), 0, &[values.to_vec()], i32::to_le_bytes)
}

pub fn face_set(name: &'static str, faces: &[i32]) -> Node {
    let (properties, children) = (vec![integers(".faces", faces)], vec![]);
    Node { name, metadata: FACE_SET, compound: ".faceset", properties, children }
}

/// A quad, an edge and a triangle of five points as programs other than this one write them, with
/// something of everything that lies on faces.
pub fn with_surface() -> Vec<u8> {
    let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 1.0];
    let mut node = mesh("cloth", positions(&[points.to_vec()]), &[&[3, 2, 1, 0], &[0, 1], &[2, 4, 1]]);
    node.metadata = SUBDIVISION;
    let indices = array(".indices", (U32, 1), 0, &[vec![0_u32, 1, 2, 3, 0, 0, 1, 2, 3]], u32::to_le_bytes);
    let values = parameter(".vals", "", 2, &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    let up = [0.0, 0.0, 2.0].repeat(6);
    let normals = [&up[..], &[0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, -1.0, 0.0]].concat();
    let scheme = array(".scheme", (TEXT, 1), 0, &[b"bilinear\0".to_vec()], u8::to_le_bytes);
    let sharp = array(".creaseSharpnesses", (F32, 1), 0, &[vec![3.0_f32, 4.0]], f32::to_le_bytes);
    node.properties.extend([
        compound("uv", "geoScope=fvr;sourceName=map1", vec![values, indices]),
        parameter("N", "geoScope=fvr;interpretation=normal", 3, &normals),
        compound(
            ".arbGeomParams",
            "",
            vec![
                parameter("map2", "geoScope=var", 2, &[0.0, 0.0, 0.1, 0.0, 0.2, 0.0, 0.3, 0.0, 0.4, 0.0]),
                parameter("tint", "geoScope=uni;interpretation=rgb", 3, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0]),
                parameter("all", "geoScope=con;interpretation=rgba", 4, &[0.25, 0.5, 0.75, 1.0]),
                parameter("short", "geoScope=fvr;interpretation=rgb", 3, &[1.0, 0.0, 0.0]),
                parameter("pair", "geoScope=vtx;notUV=1", 2, &[0.0; 10]),
                parameter("Pref", "geoScope=vtx;interpretation=vector", 3, &points),
            ],
        ),
        Property { kind: 1, ..scheme },
        // A chain of three points, and one that leads out of the mesh.
        integers(".creaseIndices", &[2, 1, 0, 1, 9]),
        integers(".creaseLengths", &[3, 2]),
        sharp,
        integers(".holes", &[1]),
    ]);
    node.children = vec![face_set("linen", &[0]), face_set("patch", &[0, 2, 7]), face_set("silk", &[2])];
    archive("", &[(1.0 / 24.0, &[1.0 / 24.0])], &[node])
}

pub fn positions(samples: &[Vec<f32>]) -> Property {
    array("P", (F32, 3), 1, samples, f32::to_le_bytes)
}

/// A mesh with these positions, faces as they are stored: clockwise.
pub fn mesh(name: &'static str, positions: Property, faces: &[&[i32]]) -> Node {
    let counts = faces.iter().map(|face| face.len() as i32).collect();
    let properties = vec![
        positions,
        array(".faceIndices", (I32, 1), 0, &[faces.concat()], i32::to_le_bytes),
        array(".faceCounts", (I32, 1), 0, &[counts], i32::to_le_bytes),
    ];
    Node { name, metadata: MESH, compound: ".geom", properties, children: vec![] }
}

/// A transform above others; its values are of the times of index `sampling`.
pub fn transform(
    name: &'static str,
    operations: &[u8],
    sampling: u32,
    values: &[Vec<f64>],
    children: Vec<Node>,
) -> Node {
    let scalar = |property: Property| Property { kind: 1, ..property };
    let (count, extent) = (operations.len() as u32, values[0].len() as u32);
    let properties = vec![
        scalar(array(".ops", (U8, count), 0, &[operations.to_vec()], u8::to_le_bytes)),
        scalar(array(".vals", (F64, extent), sampling, values, f64::to_le_bytes)),
        scalar(array(".inherits", (BOOL, 1), 0, &[vec![1]], u8::to_le_bytes)),
    ];
    Node { name, metadata: TRANSFORM, compound: ".xform", properties, children }
}

/// An archive whose times, beside the first, have these cycles in seconds and these stored times.
pub fn archive(information: &str, times: &[(f64, &[f64])], nodes: &[Node]) -> Vec<u8> {
    let mut out = Out(b"Ogawa\xff\0\x01\0\0\0\0\0\0\0\0".to_vec());
    let top = out.object(&[], "", nodes);
    let mut table = Vec::new();
    for (cycle, stored) in [(1.0, &[0.0][..])].iter().chain(times) {
        table.extend(1_u32.to_le_bytes());
        table.extend(cycle.to_le_bytes());
        table.extend((stored.len() as u32).to_le_bytes());
        table.extend(stored.iter().flat_map(|time| time.to_le_bytes()));
    }
    let children = [
        out.data(&[0; 4]),
        out.data(&10_808_i32.to_le_bytes()),
        top,
        out.data(information.as_bytes()),
        out.data(&table),
        // The metadata of meshes by an index; those of others are told inline.
        out.data(&[&[MESH.len() as u8], MESH.as_bytes()].concat()),
    ];
    let root = out.group(&children);
    out.0[8..16].copy_from_slice(&root.to_le_bytes());
    out.0
}

struct Out(Vec<u8>);

impl Out {
    fn data(&mut self, bytes: &[u8]) -> u64 {
        if bytes.is_empty() {
            return DATA;
        }
        let at = self.0.len() as u64;
        self.0.extend((bytes.len() as u64).to_le_bytes());
        self.0.extend(bytes);
        at | DATA
    }

    fn group(&mut self, children: &[u64]) -> u64 {
        if children.is_empty() {
            return 0;
        }
        let at = self.0.len() as u64;
        self.0.extend((children.len() as u64).to_le_bytes());
        self.0.extend(children.iter().flat_map(|child| child.to_le_bytes()));
        at
    }

    fn object(&mut self, properties: &[Property], compound: &'static str, nodes: &[Node]) -> u64 {
        let own = if compound.is_empty() {
            self.compound(properties)
        } else {
            let inner = self.compound(properties);
            // A compound whose name has one byte for its length.
            let headers = [&0_u32.to_le_bytes()[..], &[compound.len() as u8], compound.as_bytes()].concat();
            let headers = self.data(&headers);
            self.group(&[inner, headers])
        };
        let (mut children, mut headers) = (vec![own], Vec::new());
        for node in nodes {
            children.push(self.object(&node.properties, node.compound, &node.children));
            headers.extend((node.name.len() as u32).to_le_bytes());
            headers.extend(node.name.bytes());
            if node.metadata == MESH {
                headers.push(1);
            } else {
                headers.push(0xff);
                headers.extend((node.metadata.len() as u32).to_le_bytes());
                headers.extend(node.metadata.bytes());
            }
        }
        headers.extend([0; 32]);
        children.push(self.data(&headers));
        self.group(&children)
    }

    fn compound(&mut self, properties: &[Property]) -> u64 {
        let (mut children, mut headers) = (Vec::new(), Vec::new());
        for property in properties {
            if property.kind == 0 {
                children.push(self.compound(&property.inner));
            }
            // As programs do, what is the same is written once.
            let (mut samples, mut written) = (Vec::new(), BTreeMap::new());
            for sample in &property.samples {
                let digest = if sample.is_empty() { &[][..] } else { &[7; 16] };
                samples.push(*written.entry(sample).or_insert_with(|| self.data(&[digest, sample].concat())));
                if property.kind == 2 {
                    samples.push(DATA);
                }
            }
            if property.kind > 0 {
                children.push(self.group(&samples));
            }
            let count = property.samples.len() as u32;
            // Numbers of four bytes; metadata of the properties themselves are told inline.
            let bits = property.kind | 2 << 2 | property.number << 4 | 1 << 8 | property.extent << 12 | 0xff << 20;
            let is_constant = property.changes.is_none() && count == 1;
            let states = u32::from(property.changes.is_some()) << 9 | u32::from(is_constant) << 11;
            headers.extend((bits | states).to_le_bytes());
            let changes = property.changes.iter().flatten().copied();
            let counts = changes.chain(property.changes.is_none().then_some(count));
            if property.kind > 0 {
                headers.extend(counts.chain([property.sampling]).flat_map(u32::to_le_bytes));
            }
            headers.extend((property.name.len() as u32).to_le_bytes());
            headers.extend(property.name.bytes());
            headers.extend((property.metadata.len() as u32).to_le_bytes());
            headers.extend(property.metadata.bytes());
        }
        if !headers.is_empty() {
            children.push(self.data(&headers));
        }
        self.group(&children)
    }
}
