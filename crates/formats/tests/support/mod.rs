//! Small files of every format, all of the same tetrahedron where they can be.

#![allow(dead_code, unreachable_pub)]

pub mod archive;
pub mod document;

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use cager_formats::{Error, FrameReader, MeshFormat, read_model_bytes};
use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::surface::{Channel, CornerSet, Texture};

pub const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, -2.25]];
pub const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

pub fn polygons(faces: &[&[u32]]) -> Polygons {
    let mut polygons = Polygons::new();
    for face in faces {
        polygons.push(face);
    }
    polygons
}

pub fn tetrahedron() -> Model {
    Model { points: POINTS.to_vec(), faces: polygons(&FACES.each_ref().map(<[u32; 3]>::as_slice)), ..Model::default() }
}

pub fn read(name: &str, bytes: impl AsRef<[u8]>) -> Result<Model, Error> {
    let name = Path::new(name);
    read_model_bytes(MeshFormat::from_path(name)?, name, bytes.as_ref())
}

pub fn message<T>(result: Result<T, Error>) -> String {
    result.err().expect("an error").to_string()
}

pub fn obj() -> Vec<u8> {
    b"# t\nv 0 0 0\nv 1 0 0\nv 0 1.5 0\nv 0 0 -2.25\nf 1 3 2\nf 1/1 2/2 4/3\nf 1//1 4//1 3//1\nf -3 -2 -1\n".to_vec()
}

pub fn off() -> Vec<u8> {
    b"OFF\n4 4 6\n0 0 0\n1 0 0\n0 1.5 0\n0 0 -2.25\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n".to_vec()
}

fn ply_header(encoding: &str) -> String {
    format!(
        "ply\nformat {encoding} 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
         property double z\nproperty uchar red\nelement extra 1\nproperty list ushort short things\nproperty int one\n\
         element face 4\nproperty list uchar uint vertex_index\nproperty float quality\nend_header\n"
    )
}

pub fn ply_ascii() -> Vec<u8> {
    let body = "0 0 0 255\n1 0 0 255\n0 1.5 0 255\n0 0 -2.25 255\n2 7 -8 9\n3 0 2 1 0.5\n3 0 1 3 0.5\n3 0 3 2 0.5\n3 1 \
                2 3 0.5\n";
    (ply_header("ascii") + body).into_bytes()
}

pub fn ply_binary(big: bool) -> Vec<u8> {
    let mut file = ply_header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
    let mut put = |little: &[u8]| {
        let mut bytes = little.to_vec();
        if big {
            bytes.reverse();
        }
        file.extend(bytes);
    };
    for [x, y, z] in POINTS {
        put(&(x as f32).to_le_bytes());
        put(&(y as f32).to_le_bytes());
        put(&z.to_le_bytes());
        put(&[255]);
    }
    put(&2_u16.to_le_bytes());
    put(&7_i16.to_le_bytes());
    put(&(-8_i16).to_le_bytes());
    put(&9_i32.to_le_bytes());
    for face in FACES {
        put(&[3]);
        for index in face {
            put(&index.to_le_bytes());
        }
        put(&0.5_f32.to_le_bytes());
    }
    file
}

/// Points in the order in which its faces meet them: 0 2 1 3.
pub fn stl_ascii() -> Vec<u8> {
    let mut text = String::from("solid t\n");
    for face in FACES {
        text += " facet normal 0 0 0\n  outer loop\n";
        for [x, y, z] in face.map(|index| POINTS[index as usize]) {
            text += &format!("   vertex {x} {y} {z:e}\n");
        }
        text += "  endloop\n endfacet\n";
    }
    (text + "endsolid t\n").into_bytes()
}

pub fn stl_binary() -> Vec<u8> {
    let mut file = vec![0; 80];
    file[..5].copy_from_slice(b"solid");
    file.extend((FACES.len() as u32).to_le_bytes());
    for face in FACES {
        file.extend([0; 12]);
        for index in face {
            file.extend(POINTS[index as usize].iter().flat_map(|&x| (x as f32).to_le_bytes()));
        }
        file.extend([0; 2]);
    }
    file
}

/// The binary chunk of [`glb`]: 48 bytes of positions, then 24 bytes of 16-bit indices.
pub fn glb_data() -> Vec<u8> {
    let mut data: Vec<u8> = POINTS.as_flattened().iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    data.extend(FACES.as_flattened().iter().flat_map(|&index| (index as u16).to_le_bytes()));
    data
}

/// Accessor 0 has the positions and 1 the indices; `rest` is what else the document has.
pub fn glb_json(rest: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":72}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}]{rest}}}"#
    )
}

pub fn glb_file(json: &str, data: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + data.len() as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(data);
    file
}

pub fn glb() -> Vec<u8> {
    let nodes = r#","scenes":[{"nodes":[0]}],"nodes":[{"children":[1],"scale":[1,1,1]},{"mesh":0}]"#;
    glb_file(&glb_json(nodes), &glb_data())
}

/// Every mesh format in every encoding, by file name.
pub fn meshes() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.obj", obj()),
        ("a.off", off()),
        ("a.ply", ply_ascii()),
        ("little.ply", ply_binary(false)),
        ("big.ply", ply_binary(true)),
        ("a.stl", stl_ascii()),
        ("b.stl", stl_binary()),
        ("a.glb", glb()),
        ("a.abc", abc_mesh()),
    ]
}

/// Two frames of two points: 0, 1, 2, … 11.
pub fn coordinates() -> Vec<f32> {
    (0..12_u8).map(f32::from).collect()
}

pub fn npy(descr: &str, rest: &str, data: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': {descr}, {rest}}}\n");
    let mut file = b"\x93NUMPY\x01\0".to_vec();
    file.extend((text.len() as u16).to_le_bytes());
    file.extend(text.bytes());
    file.extend(data);
    file
}

pub fn little(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

pub fn big(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_be_bytes()).collect()
}

pub fn npy_f4() -> Vec<u8> {
    npy("'<f4'", "'fortran_order': False, 'shape': (2, 2, 3), ", &little(&coordinates()))
}

pub fn pc2() -> Vec<u8> {
    let mut file = b"POINTCACHE2\0\x01\0\0\0\x02\0\0\0\0\0\0\0\0\0\x80\x3f\x02\0\0\0".to_vec();
    file.extend(little(&coordinates()));
    file
}

/// At 24 frames per second.
pub fn mdd() -> Vec<u8> {
    let mut file = b"\0\0\0\x02\0\0\0\x02\0\0\0\0\x3d\x2a\xaa\xab".to_vec();
    file.extend(big(&coordinates()));
    file
}

/// At 24 frames per second.
pub fn abc() -> Vec<u8> {
    let frames: Vec<Vec<f32>> = coordinates().chunks(6).map(<[f32]>::to_vec).collect();
    archive::archive("", &[(1.0 / 24.0, &[0.0])], &[archive::mesh("m", archive::positions(&frames), &[])])
}

pub fn abc_mesh() -> Vec<u8> {
    let faces = FACES.map(|face| face.map(|index| index as i32).into_iter().rev().collect::<Vec<_>>());
    let faces: Vec<&[i32]> = faces.iter().map(Vec::as_slice).collect();
    let points: Vec<f32> = POINTS.as_flattened().iter().map(|&x| x as f32).collect();
    let mesh = archive::mesh("m", archive::positions(&[points]), &faces);
    let still = archive::transform("t", &[0x10], 0, &[vec![0.0; 3]], vec![mesh]);
    archive::archive("", &[(1.0 / 24.0, &[0.0])], &[still])
}

pub fn caches() -> Vec<(&'static str, Vec<u8>)> {
    [plain_caches(), vec![("a.abc", abc())]].concat()
}

/// Those that are a header and all coordinates.
pub fn plain_caches() -> Vec<(&'static str, Vec<u8>)> {
    vec![("a.npy", npy_f4()), ("a.pc2", pc2()), ("a.mdd", mdd())]
}

/// All frames of a reader, which has as many as it says.
pub fn all(reader: &mut dyn FrameReader) -> Vec<Vec<f64>> {
    let (mut frames, mut frame) = (Vec::new(), Vec::new());
    while reader.read_next(&mut frame).unwrap() {
        frames.push(frame.clone());
    }
    assert_eq!(frames.len(), reader.frames());
    frames
}

pub fn numbers(reader: &dyn FrameReader) -> Vec<f64> {
    (0..reader.frames()).map(|frame| reader.number(frame)).collect()
}

pub fn wide(frames: &[Vec<f32>]) -> Vec<Vec<f64>> {
    frames.iter().map(|frame| frame.iter().map(|&x| x.into()).collect()).collect()
}

/// Two points with a morph target, and three keys of its weight.
pub fn animated_glb() -> Vec<u8> {
    let json = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":60}],
        "bufferViews":[{"buffer":0,"byteLength":24},{"buffer":0,"byteOffset":12,"byteLength":24},{"buffer":0,"byteOffset":36,"byteLength":24}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":2,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":2,"type":"VEC3"},
        {"bufferView":2,"componentType":5126,"count":3,"type":"SCALAR"},{"bufferView":2,"byteOffset":12,"componentType":5126,"count":3,"type":"SCALAR"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":0,"targets":[{"POSITION":1}]}]}],"nodes":[{"mesh":0}],
        "animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}],"samplers":[{"input":2,"output":3}]}]}"#;
    let numbers = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 0.0, 0.5, 1.0, 0.25, 0.5, -1.0_f32];
    glb_file(json, &numbers.map(f32::to_le_bytes).concat())
}

/// The arrays of an archive of NumPy by their names, all numbers one after another.
pub fn arrays(path: &Path) -> HashMap<String, Vec<f64>> {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let mut found = HashMap::new();
    for k in 0..archive.len() {
        let mut file = archive.by_index(k).unwrap();
        let (name, mut bytes) = (file.name().unwrap().trim_end_matches(".npy").to_owned(), Vec::new());
        file.read_to_end(&mut bytes).unwrap();
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
        let four = bytes[start..].as_chunks().0;
        let values = if header.contains("'<f4'") {
            four.iter().map(|&four| f32::from_le_bytes(four).into()).collect()
        } else if header.contains("'<i4'") {
            four.iter().map(|&four| i32::from_le_bytes(four).into()).collect()
        } else {
            continue;
        };
        found.insert(name, values);
    }
    found
}

/// Numbers that look like chance, the same in every run.
pub fn random(seed: u64) -> impl FnMut() -> usize {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    }
}

pub fn set<const N: usize>(name: &str, values: &[[f32; N]], corners: &[u32]) -> CornerSet<N> {
    CornerSet { name: name.to_owned(), values: values.to_vec(), corners: corners.to_vec() }
}

/// The value of each corner.
pub fn by_corner<const N: usize>(set: &CornerSet<N>) -> Vec<[f32; N]> {
    set.corners.iter().map(|&corner| set.values[corner as usize]).collect()
}

pub fn texture(channel: Channel, path: &str) -> Texture {
    Texture::new(channel, path)
}

/// Captures beside the repository, or where the environment says.
pub fn data() -> PathBuf {
    std::env::var_os("CAGER_CAPTURES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from)
}

/// The folder of a character that Blender wrote, where it has this file.
pub fn character(file: &str) -> Option<PathBuf> {
    let found = Some(data().join("character")).filter(|folder| folder.join(file).is_file());
    if found.is_none() {
        eprintln!("skipped: no character");
    }
    found
}
