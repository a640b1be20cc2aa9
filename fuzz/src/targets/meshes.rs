//! Mesh files, and matrices.

use crate::Target;
use cager_formats::{MeshFormat, read_matrix_bytes, read_model_bytes};
use std::path::Path;

const fn target(
    name: &'static str,
    run: fn(&[u8]),
    seeds: fn() -> Vec<Vec<u8>>,
    words: &'static [&'static str],
) -> Target {
    Target { name, run, seeds, words, fixed: 1 << 20, per_byte: 64 }
}

pub(super) const OBJ: Target = target(
    "obj",
    |bytes| read(MeshFormat::Obj, bytes),
    || {
        let polygons =
            b"# t\nv 0 0 0\nv 1 0 0\nv 0 1.5 0\nv 0 0 -2.25\nf 1 3 2\nf 1/1 2/2 4/3\nf 1//1 4//1 3//1\nf -3 -2 -1\n";
        let others = b"mtllib a.mtl\no a b\ng\nv 1e3 -.5 +7 1 0.5 0.5\r\nvn 0 0 1\nvt 0 0\nv 1 2 \\\n 3\nl 1 2\nv 0 0 9\nf 1 2 3 \\\n 1";
        vec![polygons.to_vec(), others.to_vec()]
    },
    &[
        "v ",
        "f ",
        "fo ",
        "\nf -1 -2 -3",
        "vn ",
        "vt ",
        "//",
        "/",
        "\\\n",
        "#",
        "\r\n",
        "o ",
        "g ",
        "1e999",
        "inf",
        "nan",
        "-0",
        "p ",
        "l ",
    ],
);

pub(super) const OFF: Target = target(
    "off",
    |bytes| read(MeshFormat::Off, bytes),
    || {
        let plain = b"OFF\n4 4 6\n0 0 0\n1 0 0\n0 1.5 0\n0 0 -2.25\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
        let colored = b"COFF # c\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n0 1 0 0 0 0 0\n3 0 1 2 0.5 0.5 0.5\n";
        let lines = b"OFF3 1\n0 0 0\n1 0 0\n0 1 0\n3 0\n1 # c\n2\n";
        vec![plain.to_vec(), colored.to_vec(), lines.to_vec()]
    },
    &["OFF", "OFF3 1 0\n", "COFF", "NOFF", "STOFF", "4OFF", "nOFF", "BINARY", "#", "\n", "3 0 1 2"],
);

pub(super) const PLY: Target = target(
    "ply",
    |bytes| read(MeshFormat::Ply, bytes),
    || {
        let header = |encoding: &str| {
            format!(
                "ply\nformat {encoding} 1.0\ncomment c\nobj_info i\nelement vertex 3\nproperty float x\nproperty float y\n\
                 property double z\nproperty uchar red\nelement extra 1\nproperty list ushort short things\n\
                 element face 1\nproperty list uchar uint vertex_index\nproperty float quality\nend_header\n"
            )
        };
        let ascii = header("ascii") + "0 0 0 255\n1 0 0 255\n0 1.5 0 255\n2 7 -8\n3 0 2 1 0.5\n";
        let binary = |big: bool| {
            let mut file = header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
            let mut put = |little: &[u8]| {
                let mut bytes = little.to_vec();
                if big {
                    bytes.reverse();
                }
                file.extend(bytes);
            };
            for k in 0..3_u8 {
                put(&f32::from(k).to_le_bytes());
                put(&f32::from(k * k).to_le_bytes());
                put(&1.5_f64.to_le_bytes());
                put(&[255]);
            }
            put(&1_u16.to_le_bytes());
            put(&7_i16.to_le_bytes());
            put(&[3]);
            (0..3_u32).for_each(|k| put(&k.to_le_bytes()));
            put(&0.5_f32.to_le_bytes());
            file
        };
        let strips = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty char x\nproperty char y\nproperty char z\nelement tristrips 2\n\
                       property list uchar char vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n8 0 1 2 1 0 -1 2 1\n3 0 1 2\n";
        vec![ascii.into_bytes(), binary(false), binary(true), strips.to_vec()]
    },
    &[
        "element vertex ",
        "element face ",
        "element ",
        "property ",
        "property list ",
        "uchar ",
        "ushort ",
        "uint ",
        "char ",
        "short ",
        "int ",
        "float ",
        "double ",
        "int8 ",
        "uint32 ",
        "float64 ",
        "vertex_indices",
        "vertex_index",
        "end_header\n",
        "format ascii 1.0\n",
        "format binary_little_endian 1.0\n",
        "comment ",
        "\r\n",
        "x\n",
        "element tristrips ",
        "-1",
    ],
);

pub(super) const STL: Target = target(
    "stl",
    |bytes| read(MeshFormat::Stl, bytes),
    || {
        let ascii = b"solid t\n facet normal 0 0 0\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 -2.5e0\n  endloop\n endfacet\nendsolid t\n";
        let mut binary = vec![0; 80];
        binary[..5].copy_from_slice(b"solid");
        binary.extend(2_u32.to_le_bytes());
        for face in 0..2_u8 {
            binary.extend([0; 12]);
            binary.extend((0..9_u8).flat_map(|k| f32::from(k * face + k).to_le_bytes()));
            binary.extend([0; 2]);
        }
        vec![ascii.to_vec(), binary]
    },
    &["solid ", "facet ", "normal ", "outer loop", "vertex ", "endloop", "endfacet", "endsolid"],
);

pub(super) const GLB: Target = Target {
    // A document of tiny objects grows more than other formats do; `crates/formats/tests/hostile.rs` has the bound for large ones.
    per_byte: 2048,
    ..target("glb", |bytes| read(MeshFormat::Glb, &with_lengths(bytes)), glb_seeds, GLB_WORDS)
};

pub(super) const GLB_WORDS: &[&str] = &[
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\"",
    "\"nodes\":[",
    "\"mesh\":0",
    "\"children\":[0]",
    "\"scale\":[1,1,1]",
    "\"matrix\":[",
    "\"rotation\":[0,0,0,1]",
    "\"translation\":[0,0,0]",
    "\"skin\":0",
    "\"scene\":0",
    "\"mode\":5",
    "\"mode\":6",
    "\"mode\":0",
    "\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":1,\"componentType\":5123},\"values\":{\"bufferView\":0}}",
    "\"componentType\":5125",
    "\"componentType\":5121",
    "\"componentType\":5126",
    "\"byteStride\":12",
    "\"byteOffset\":4",
    "\"normalized\":true",
    "\"count\":",
    "\"VEC3\"",
    "\"SCALAR\"",
    "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]",
    "\"extensions\":{\"KHR_meshopt_compression\":{\"buffer\":0,\"byteLength\":40,\"byteStride\":4,\"count\":4,\"mode\":\"ATTRIBUTES\",\"filter\":\"EXPONENTIAL\"}}",
    "\"mode\":\"TRIANGLES\"",
    "\"mode\":\"INDICES\"",
    "\"filter\":\"COLOR\"",
    "\"uri\":\"data:;base64,AAAA\"",
    "\"JOINTS_0\":1,\"WEIGHTS_0\":0",
    "\"inverseBindMatrices\":0",
    "\"componentType\":5122",
    "\"MAT4\"",
    "\"weights\":[0.5]",
    "\"targets\":[{\"POSITION\":0}]",
    "BIN\0",
    "JSON",
];

fn glb_seeds() -> Vec<Vec<u8>> {
    let file = |rest: &str| {
        let mut data: Vec<u8> = (0..12_u8).flat_map(|k| f32::from(k % 5).to_le_bytes()).collect();
        data.extend([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3_u16].iter().flat_map(|index| index.to_le_bytes()));
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":72}}],"bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},{{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}]{rest}}}"#
        );
        glb_file(json, &data)
    };
    vec![
        file(""),
        file(
            r#","scenes":[{"nodes":[0]}],"scene":0,"nodes":[{"children":[1],"scale":[1,2,1],"rotation":[0,0,0,1]},{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1]}]"#,
        ),
        file(
            r#","nodes":[{"mesh":0,"skin":0},{"translation":[1,2,3]}],"skins":[{"joints":[1]}],"materials":[{}],"animations":[]"#,
        ),
        packed_glb(),
    ]
}

/// The chunks of JSON and of binary data in their container, after a byte that has the lengths made right again.
fn glb_file(json: String, data: &[u8]) -> Vec<u8> {
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"\x01glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + data.len() as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(data);
    file
}

/// With its positions and indices packed.
fn packed_glb() -> Vec<u8> {
    let mut data = vec![0xa1];
    for _ in 0..3 {
        // Of four bytes: none, of few bits, of more, and as they are.
        data.extend([0b11_01_00_10, 0x01, 0x0f, 0xf0, 0, 0x55, 0xaa, 1, 2, 3, 4]);
    }
    data.resize(64, 0);
    data.extend([0xe1, 0xf0, 0x00, 0x1f, 0xff, 0x02, 0xf1, 0x01, 0x05]);
    data.resize(64 + 9 + 16, 0);
    data.extend([0xd1, 0, 2, 4, 6, 0, 0, 0, 0]);
    let view = |offset: usize, length: usize, stride: usize, count: usize, mode: &str| {
        let size = stride * count;
        format!(
            r#"{{"buffer":1,"byteLength":{size},"extensions":{{"EXT_meshopt_compression":{{"buffer":0,"byteOffset":{offset},"byteLength":{length},"byteStride":{stride},"count":{count},"mode":"{mode}"}}}}}}"#
        )
    };
    let views =
        [view(0, 64, 12, 4, "ATTRIBUTES"), view(64, 25, 4, 12, "TRIANGLES"), view(89, 9, 4, 4, "INDICES")].join(",");
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":98}},{{"byteLength":999}}],"bufferViews":[{views}],"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},{{"bufferView":1,"componentType":5125,"count":12,"type":"SCALAR"}},{{"bufferView":2,"componentType":5125,"count":4,"type":"SCALAR"}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}},{{"attributes":{{"POSITION":0}},"indices":2,"mode":5}}]}}]}}"#
    );
    glb_file(json, &data)
}

/// Where the first byte says so, the lengths are made right again, so that changes of the JSON get further.
pub(super) fn with_lengths(bytes: &[u8]) -> Vec<u8> {
    let Some((mode, file)) = bytes.split_first() else { return Vec::new() };
    let mut file = file.to_vec();
    if mode & 1 != 0 && file.len() >= 20 {
        let binary =
            (20..file.len().saturating_sub(3)).rfind(|&k| &file[k..k + 4] == b"BIN\0").map_or(file.len(), |k| k - 4);
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        file[12..16].copy_from_slice(&(binary.saturating_sub(20) as u32).to_le_bytes());
        if binary + 8 <= file.len() {
            file[binary..binary + 4].copy_from_slice(&(length - binary as u32 - 8).to_le_bytes());
        }
    }
    file
}

fn read(format: MeshFormat, bytes: &[u8]) {
    let name = Path::new("a").with_extension(format.extension());
    match read_model_bytes(format, &name, bytes) {
        Ok(model) => {
            assert!(!model.points.is_empty(), "no points");
            assert!(model.points.as_flattened().iter().all(|x| x.is_finite()), "a point is not finite");
            assert!(
                model.faces.indices().iter().all(|&index| (index as usize) < model.points.len()),
                "an index lies outside"
            );
            assert!(model.faces.arities().iter().all(|&corners| corners >= 3), "a face has fewer than three corners");
            let corners: usize = model.faces.arities().iter().map(|&corners| corners as usize).sum();
            assert_eq!(corners, model.faces.indices().len(), "corners");
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(&format!("{}: ", name.display())) && text.len() < 600, "{text}");
        }
    }
}

pub(super) const MTX: Target = target(
    "mtx",
    |bytes| {
        let Ok(matrix) = read_matrix_bytes(Path::new("x.mtx"), bytes) else { return };
        let inside = |&(i, j, x): &(u32, u32, f64)| {
            (i as usize) < matrix.rows() && (j as usize) < matrix.columns() && x.abs() <= 1e100
        };
        assert!(matrix.entries().iter().all(inside), "an entry that cannot be");
        assert!(matrix.entries().is_sorted_by_key(|&(i, j, _)| (i, j)), "entries out of order");
    },
    || {
        let general = b"%%MatrixMarket matrix coordinate real general\n% c\n3 4 3\n1 1 0.5\n3 4 -1e-3\n2 1 7\n";
        let symmetric = b"%%MatrixMarket matrix coordinate integer symmetric\r\n3 3 2\r\n2 1 -4\r\n3 3 1\r\n";
        let pattern = b"%%MatrixMarket matrix coordinate pattern general\n2 2 1\n1 2\n";
        vec![general.to_vec(), symmetric.to_vec(), pattern.to_vec()]
    },
    &[
        "%%MatrixMarket matrix ",
        "coordinate",
        "array",
        "real",
        "integer",
        "pattern",
        "complex",
        "general",
        "symmetric",
        "hermitian",
        "1 1 1\n",
        "4294967295",
        "18446744073709551616",
        "1e999",
        "nan",
        "%",
    ],
);
