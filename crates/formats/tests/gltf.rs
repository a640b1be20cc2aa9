//! Binary glTF as the specification lets it be written.

mod support;

use support::*;

/// The tetrahedron's file with its JSON changed, and its binary data.
fn changed(changes: &[(&str, &str)], data: &[u8]) -> Vec<u8> {
    let mut json = glb_json("");
    for (from, to) in changes {
        assert!(json.contains(from), "{from}");
        json = json.replace(from, to);
    }
    glb_file(&json, data)
}

const POSITIONS: &str = r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}"#;
const FIRST_VIEW: &str = r#"{"buffer":0,"byteLength":48}"#;
const SECOND_VIEW: &str = r#"{"buffer":0,"byteOffset":48,"byteLength":24}"#;
const PRIMITIVE: &str = r#"{"attributes":{"POSITION":0},"indices":1}"#;

#[test]
fn quantized_positions_are_whole_numbers_or_fractions() {
    let steps = [[0, 0, 0], [1, 0, 0], [0, -2, 0], [0, 0, 127_i8]];
    let mut data: Vec<u8> = steps.iter().flat_map(|p| [p[0] as u8, p[1] as u8, p[2] as u8, 0]).collect();
    data.resize(48, 0);
    data.extend(&glb_data()[48..]);
    let strided = (FIRST_VIEW, r#"{"buffer":0,"byteLength":48,"byteStride":4}"#);
    let required = (r#"{"asset""#, r#"{"extensionsRequired":["KHR_mesh_quantization"],"asset""#);
    let whole = r#"{"bufferView":0,"componentType":5120,"count":4,"type":"VEC3"}"#;
    let model = read("a.glb", changed(&[strided, required, (POSITIONS, whole)], &data)).unwrap();
    assert_eq!(model.points, steps.map(|p| p.map(f64::from)));
    let fractions = whole.replace(r#""count""#, r#""normalized":true,"count""#);
    let model = read("a.glb", changed(&[strided, required, (POSITIONS, &fractions)], &data)).unwrap();
    assert_eq!(model.points, steps.map(|p| p.map(|x| f64::from(x) / 127.0)));
}

#[test]
fn sparse_accessors_replace_some_elements() {
    let mut data = glb_data();
    data.extend([1, 0, 3, 0]);
    data.extend([7.0_f32, 8.0, 9.0, -1.0, -2.0, -3.0].iter().flat_map(|x| x.to_le_bytes()));
    let views = format!(
        r#"{SECOND_VIEW},{{"buffer":0,"byteOffset":72,"byteLength":4}},{{"buffer":0,"byteOffset":76,"byteLength":24}}"#
    );
    let sparse =
        r#""count":4,"sparse":{"count":2,"indices":{"bufferView":2,"componentType":5123},"values":{"bufferView":3}}"#;
    let file = |positions: &str, data: &[u8]| {
        changed(&[(POSITIONS, &positions.replace(r#""count":4"#, sparse)), (SECOND_VIEW, &views)], data)
    };
    let mut points = POINTS;
    (points[1], points[3]) = ([7.0, 8.0, 9.0], [-1.0, -2.0, -3.0]);
    assert_eq!(read("a.glb", file(POSITIONS, &data)).unwrap().points, points);
    // Without a view the others are zeros.
    (points[0], points[2]) = ([0.0; 3], [0.0; 3]);
    let zeros = POSITIONS.replace(r#""bufferView":0,"#, "");
    assert_eq!(read("a.glb", file(&zeros, &data)).unwrap().points, points);
    data[74] = 4;
    assert!(message(read("a.glb", file(POSITIONS, &data))).contains("reaches beyond"));
}

#[test]
fn buffers_may_be_data_uris() {
    let base64 = |bytes: &[u8]| {
        let digit =
            |k: u32| b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"[k as usize & 63] as char;
        let word = |b: &[u8]| u32::from_be_bytes([0, b[0], b[1], b[2]]);
        bytes.chunks(3).flat_map(|b| [18, 12, 6, 0].map(|shift| digit(word(b) >> shift))).collect::<String>()
    };
    let text = base64(&glb_data());
    let file = |uri: &str| changed(&[(r#"{"byteLength":72}"#, &format!(r#"{{"byteLength":72,"uri":"{uri}"}}"#))], &[]);
    for kind in ["data:application/octet-stream;base64,", "data:;base64,", "data:application/gltf-buffer;base64,"] {
        assert_eq!(read("a.glb", file(&format!("{kind}{text}"))).unwrap(), tetrahedron(), "{kind}");
    }
    assert!(message(read("a.glb", file("data:;base64,*"))).contains("buffer 0 is not base64"));
    assert!(message(read("a.glb", file("a.bin"))).contains("has its data in another file"));
}

/// A whole number in groups of seven bits.
fn number(mut value: u32, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn zigzag(value: i64) -> u32 {
    (if value < 0 { -2 * value - 1 } else { 2 * value }) as u32
}

/// Attributes of up to 16 elements, each byte of each difference as it is.
fn packed_attributes(bytes: &[u8], stride: usize, version: u8) -> Vec<u8> {
    let mut out = vec![0xa0 | version];
    if version == 1 {
        out.extend(vec![0xff; stride / 4]);
    }
    for k in 0..stride {
        let column: Vec<u8> = bytes.iter().skip(k).step_by(stride).copied().collect();
        let differences =
            (0..column.len()).map(|i| column[i].wrapping_sub(if i == 0 { 0 } else { column[i - 1] }) as i8);
        let mut differences: Vec<u8> = differences.map(|d| zigzag(d.into()) as u8).collect();
        if version == 0 {
            out.push(3);
            differences.resize(16, 0);
        }
        out.extend(differences);
    }
    out.resize(out.len() + if version == 0 { 32 - stride } else { 24 - stride - stride / 4 }, 0);
    out.resize(out.len() + stride + if version == 0 { 0 } else { stride / 4 }, 0);
    out
}

/// Triangles, each written out.
fn packed_triangles() -> Vec<u8> {
    let (mut codes, mut data, mut last) = (vec![0xe1], Vec::new(), 0);
    for face in FACES {
        codes.push(0xff);
        data.push(0xff);
        for index in face {
            number(zigzag(i64::from(index) - last), &mut data);
            last = index.into();
        }
    }
    [codes, data, vec![0; 16]].concat()
}

fn packed_sequence() -> Vec<u8> {
    let (mut out, mut last) = (vec![0xd1], 0);
    for &index in FACES.as_flattened() {
        number(zigzag(i64::from(index) - last) << 1, &mut out);
        last = index.into();
    }
    [out, vec![0; 4]].concat()
}

fn packed_file(extension: &str, version: u8, mode: &str) -> Vec<u8> {
    let indices = if mode == "TRIANGLES" { packed_triangles() } else { packed_sequence() };
    let points = packed_attributes(&glb_data()[..48], 12, version);
    let packed = |offset: usize, bytes: &[u8], what: &str| {
        let length = bytes.len();
        format!(
            r#","extensions":{{"{extension}":{{"buffer":0,"byteOffset":{offset},"byteLength":{length},{what}}}}}}}"#
        )
    };
    let first = r#"{"buffer":1,"byteLength":48"#.to_owned()
        + &packed(0, &points, r#""byteStride":12,"count":4,"mode":"ATTRIBUTES""#);
    let second = r#"{"buffer":1,"byteLength":24"#.to_owned()
        + &packed(points.len(), &indices, &format!(r#""byteStride":2,"count":12,"mode":"{mode}""#));
    let required = format!(r#"{{"extensionsRequired":["{extension}"],"asset""#);
    let changes = [
        (r#"{"asset""#, required.as_str()),
        (FIRST_VIEW, &first),
        (SECOND_VIEW, &second),
        (r#"[{"byteLength":72}]"#, r#"[{"byteLength":999},{"byteLength":72}]"#),
    ];
    changed(&changes, &[points, indices].concat())
}

#[test]
fn packed_views_are_unpacked() {
    for (extension, version) in [("EXT_meshopt_compression", 0), ("KHR_meshopt_compression", 1)] {
        for mode in ["TRIANGLES", "INDICES"] {
            assert_eq!(
                read("a.glb", packed_file(extension, version, mode)).unwrap(),
                tetrahedron(),
                "{extension} {mode}"
            );
        }
    }
}

#[test]
fn packed_views_that_are_damaged_are_named() {
    let whole = packed_file("KHR_meshopt_compression", 1, "TRIANGLES");
    let start = whole.windows(4).rposition(|w| w == b"BIN\0").unwrap() + 4;
    for at in [start, start + 1] {
        let mut file = whole.clone();
        file[at] = 0x77;
        assert!(message(read("a.glb", &file)).contains("the packed bufferView 0 is not understood"), "{at}");
    }
    // Far more is promised than a file of this size can hold.
    let bomb =
        String::from_utf8_lossy(&whole[20..start - 8]).replace(r#""count":4,"mode""#, r#""count":400000000,"mode""#);
    assert!(message(read("a.glb", glb_file(bomb.trim_end(), &whole[start..]))).contains("too often"));
}

#[test]
fn a_strip_of_a_byte_a_triangle_is_not_taken_for_endless_copies() {
    let triangles = 60_000_usize;
    let points = triangles + 2;
    // Every block of 256 elements says of its twelve bytes that nothing changes.
    let mut data = vec![0xa1];
    data.extend(vec![0xaa; 3 * points.div_ceil(256)]);
    data.resize(data.len() + 24, 0);
    let split = data.len();
    data.extend([0xe1, 0xf0]);
    data.resize(data.len() + triangles - 1 + 16, 0);
    let extension = |offset: usize, length: usize, stride: usize, count: usize, mode: &str| {
        format!(
            r#"{{"buffer":1,"byteLength":{},"extensions":{{"EXT_meshopt_compression":{{"buffer":0,"byteOffset":{offset},"byteLength":{length},"byteStride":{stride},"count":{count},"mode":"{mode}"}}}}}}"#,
            stride * count
        )
    };
    let first = extension(0, split, 12, points, "ATTRIBUTES");
    let second = extension(split, data.len() - split, 4, 3 * triangles, "TRIANGLES");
    let positions = POSITIONS.replace(r#""count":4"#, &format!(r#""count":{points}"#));
    let corners = format!(r#""componentType":5125,"count":{}"#, 3 * triangles);
    let file = changed(
        &[
            (FIRST_VIEW, &first),
            (SECOND_VIEW, &second),
            (POSITIONS, &positions),
            (r#""componentType":5123,"count":12"#, &corners),
            (r#"[{"byteLength":72}]"#, r#"[{"byteLength":99},{"byteLength":999}]"#),
        ],
        &data,
    );
    let model = read("a.glb", file).unwrap();
    assert_eq!((model.points.len(), model.faces.indices().len()), (points, 3 * triangles));
    assert_eq!(model.faces.indices()[3 * triangles - 1] as usize, points - 1);
}

/// The tetrahedron as the reference encoder packs it (Draco 1.5, positions of 14 bits).
const DRACO: &str = "445241434f02020101000000040400030000012f01011001ff000001000903000002010101000f0301102f013003\
    005082000056d500000060550100719c5505000000000000ff3f00000000000000000000000010c0000010400e";

fn draco_file(stream: &[u8]) -> Vec<u8> {
    let extension = r#"{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":0}}}"#;
    let packed = format!(r#"{{"attributes":{{"POSITION":0}},"indices":1,"extensions":{extension}}}"#);
    let json = glb_json("")
        .replace(r#"{"asset""#, r#"{"extensionsRequired":["KHR_draco_mesh_compression"],"asset""#)
        .replace(PRIMITIVE, &packed)
        .replace(FIRST_VIEW, &format!(r#"{{"buffer":0,"byteLength":{}}}"#, stream.len()))
        .replace(&format!(",{SECOND_VIEW}"), "")
        .replace(r#""bufferView":0,"componentType""#, r#""componentType""#)
        .replace(r#""bufferView":1,"componentType""#, r#""componentType""#)
        .replace(r#"{"byteLength":72}"#, &format!(r#"{{"byteLength":{}}}"#, stream.len()));
    glb_file(&json, stream)
}

#[test]
fn what_draco_packed_is_unpacked() {
    let digits: Vec<u8> = DRACO.bytes().map(|digit| (digit as char).to_digit(16).unwrap() as u8).collect();
    let stream: Vec<u8> = digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect();
    let model = read("a.glb", draco_file(&stream)).unwrap();
    // Points and faces come in the order of the stream.
    let place = |point: u32| -> usize {
        let near = |wanted: &[f64; 3]| (0..3).all(|k| (model.points[point as usize][k] - wanted[k]).abs() < 2e-4);
        POINTS.iter().position(near).unwrap_or_else(|| panic!("{:?}", model.points[point as usize]))
    };
    let turned = |face: [usize; 3]| (0..3).map(|k| [face[k], face[(k + 1) % 3], face[(k + 2) % 3]]).min().unwrap();
    let mut faces: Vec<[usize; 3]> =
        model.faces.iter().map(|face| turned([place(face[0]), place(face[1]), place(face[2])])).collect();
    faces.sort_unstable();
    let mut wanted = FACES.map(|face| turned(face.map(|point| point as usize)));
    wanted.sort_unstable();
    assert_eq!((model.points.len(), &faces[..]), (4, &wanted[..]));
    for length in 0..stream.len() {
        let told = message(read("a.glb", draco_file(&stream[..length])));
        assert!(told.contains("mesh 0, primitive 0: its Draco data is not understood"), "{length}: {told}");
    }
    // More points than the accessor says.
    let file = String::from_utf8_lossy(&draco_file(&stream)[20..]).into_owned();
    let json = file.split_once("BIN\0").unwrap().0;
    let end = json.rfind('}').unwrap() + 1;
    let fewer = json[..end].replace(r#""count":4"#, r#""count":3"#);
    assert!(message(read("a.glb", glb_file(&fewer, &stream))).contains("its Draco data has no accessor 0"));
}

const SKIN: &str = r#","nodes":[{"mesh":0,"skin":0,"translation":[9,9,9]},{"children":[2],"translation":[0,0,1]},{"rotation":[0,0,0.70710678118,0.70710678118]}],"skins":[{"joints":[1,2]}]"#;

/// With two joints that move all points half and half.
fn skinned(rest: &str, weights: [u8; 4]) -> Vec<u8> {
    let json = glb_json(rest)
        .replace("\"byteLength\":72", "\"byteLength\":104")
        .replace(SECOND_VIEW, &format!(r#"{SECOND_VIEW},{{"buffer":0,"byteOffset":72,"byteLength":16}},{{"buffer":0,"byteOffset":88,"byteLength":16}}"#))
        .replace(r#""SCALAR"}]"#, r#""SCALAR"},{"bufferView":2,"componentType":5121,"count":4,"type":"VEC4"},{"bufferView":3,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"}]"#)
        .replace(r#""POSITION":0"#, r#""POSITION":0,"JOINTS_0":2,"WEIGHTS_0":3"#);
    let mut data = glb_data();
    data.extend([0, 1, 0, 0].repeat(4));
    data.extend(weights.repeat(4));
    glb_file(&json, &data)
}

#[test]
fn a_skinned_mesh_is_where_its_joints_put_it() {
    let close = |found: &[[f64; 3]], wanted: [[f64; 3]; 4]| {
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((0..3).all(|k| (found[k] - wanted[k]).abs() < 1e-6), "{found:?} is not {wanted:?}");
        }
    };
    // Half raised, half raised and turned by a quarter; the mesh node's own place counts for nothing.
    let model = read("a.glb", skinned(SKIN, [100, 100, 0, 0])).unwrap();
    close(&model.points, POINTS.map(|[x, y, z]| [(x - y) / 2.0, (x + y) / 2.0, z + 1.0]));
    // Without weights, and without the attributes, points stay as they were modelled.
    for file in [skinned(SKIN, [0; 4]), glb_file(&glb_json(SKIN), &glb_data())] {
        assert_eq!(read("a.glb", file).unwrap(), tetrahedron());
    }
    let named = |rest: &str| message(read("a.glb", skinned(rest, [1, 1, 0, 0])));
    assert!(named(&SKIN.replace(r#"[1,2]"#, "[1]")).contains("vertex 0 names joint 1, but the skin has 1"));
    assert!(named(&SKIN.replace(r#"[1,2]"#, "[1,7]")).contains("node 7"));
    assert!(named(&SKIN.replace(r#""skin":0"#, r#""skin":3"#)).contains("skin 3"));
    let many: String = (1..9).map(|set| format!(r#","JOINTS_{set}":2,"WEIGHTS_{set}":3"#)).collect();
    let json = glb_json(SKIN).replace(r#""POSITION":0"#, &format!(r#""POSITION":0{many}"#));
    assert!(message(read("a.glb", glb_file(&json, &glb_data()))).contains("more than 32 joints"));
    let outside = SKIN.replace(r#","nodes""#, r#","scenes":[{"nodes":[0]}],"nodes""#);
    assert!(named(&outside).contains("node 1 moves a skin but is not in the scene"));
}

#[test]
fn joints_are_bound_by_inverse_matrices() {
    let json = glb_json(&SKIN.replace(r#"[1,2]}"#, r#"[1],"inverseBindMatrices":2}"#))
        .replace("\"byteLength\":72", "\"byteLength\":136")
        .replace(SECOND_VIEW, &format!(r#"{SECOND_VIEW},{{"buffer":0,"byteOffset":72,"byteLength":64}}"#))
        .replace(r#""SCALAR"}]"#, r#""SCALAR"},{"bufferView":2,"componentType":5126,"count":1,"type":"MAT4"},{"componentType":5121,"count":4,"type":"VEC4","sparse":{"count":0,"indices":{"bufferView":2,"componentType":5121},"values":{"bufferView":2}}},{"bufferView":0,"componentType":5121,"count":4,"type":"VEC4"}]"#)
        .replace(r#""POSITION":0"#, r#""POSITION":0,"JOINTS_0":3,"WEIGHTS_0":4"#);
    let mut data = glb_data();
    // Twice as large, and mirrored in x.
    data.extend(
        [-2.0_f32, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0]
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    let model = read("a.glb", glb_file(&json, &data)).unwrap();
    // Of the bytes that stand for weights, only those of the last vertex are not all zero.
    assert_eq!(model.points[..3], POINTS[..3]);
    assert_eq!(model.points[3], [0.0, 0.0, -3.5]);
    assert_eq!(model.faces.indices()[..3], [0, 1, 2], "turned back");
}

#[test]
fn morph_targets_count_as_far_as_they_do_at_rest() {
    let targets = r#"{"attributes":{"POSITION":0},"indices":1,"targets":[{"POSITION":0},{"POSITION":0},{}]}"#;
    let file = |rest: &str, weights: &str| {
        let json = glb_json(rest).replace(&format!("[{PRIMITIVE}]"), &format!("[{targets}]{weights}"));
        read("a.glb", glb_file(&json, &glb_data())).unwrap().points
    };
    let scaled = |by: f64| POINTS.map(|p| p.map(|x| by * x)).to_vec();
    assert_eq!(file("", ""), scaled(1.0));
    assert_eq!(file("", r#","weights":[0.5,0,1]"#), scaled(1.5));
    assert_eq!(file(r#","nodes":[{"mesh":0,"weights":[0,2,0]}]"#, r#","weights":[0.5,0,1]"#), scaled(3.0));
}

#[test]
fn what_is_not_read_is_named_with_the_way_out() {
    let with = |changes: &[(&str, &str)]| message(read("a.glb", changed(changes, &glb_data())));
    let required = |name: &str| with(&[(r#"{"asset""#, &format!(r#"{{"extensionsRequired":["{name}"],"asset""#))]);
    assert!(required("ACME_splines").contains("needs the extension \"ACME_splines\", which is not read"));
    let draco =
        r#"{"attributes":{"POSITION":0},"indices":1,"extensions":{"KHR_draco_mesh_compression":{"bufferView":0}}}"#;
    let empty = POSITIONS.replace(r#""bufferView":0,"#, "");
    assert!(with(&[(PRIMITIVE, draco), (POSITIONS, &empty)]).contains("its Draco data is not understood"));
    // Without Draco, an accessor without data has zeros.
    let zeros = read("a.glb", changed(&[(POSITIONS, &empty)], &glb_data())).unwrap();
    assert_eq!(zeros.points, [[0.0; 3]; 4]);
    assert!(with(&[("5126", "5125")]).contains("positions are Vec3 of U32"));
    let copies = r#","nodes":[{"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{}}}}]"#;
    let error = message(read("a.glb", glb_file(&glb_json(copies), &glb_data())));
    assert!(error.contains("node 0 repeats its mesh by EXT_mesh_gpu_instancing"), "{error}");
    // What changes no shape is passed over, and Draco where the plain data is there as well.
    for changes in [
        [(r#"{"asset""#, r#"{"extensionsRequired":["KHR_materials_unlit","KHR_texture_transform"],"asset""#)],
        [(PRIMITIVE, draco)],
    ] {
        assert_eq!(read("a.glb", changed(&changes, &glb_data())).unwrap(), tetrahedron());
    }
}

#[test]
fn valid_documents_that_stricter_readers_refuse_are_read() {
    let nodes = r#","nodes":[{"mesh":0}],"scene":0,"scenes":[{"nodes":[0]},{"name":"Scene.001"}]"#;
    for (what, json) in [
        ("a scene without nodes", glb_json(nodes)),
        ("extras of all types", {
            let extras = |value: &str| format!(r#","extras":{value},"nodes":[{{"mesh":0,"extras":{value}}}]"#);
            glb_json(&(extras("[1,2]") + r#","materials":[{"extras":7},{"extras":null}],"skins":[]"#))
                .replace(r#""count":4"#, r#""extras":"note","count":4"#)
        }),
        ("pictures that are not read", {
            let pictures = r#","images":[{"uri":7}],"samplers":[{"wrapS":"x"}],"cameras":[{"type":1}],"textures":[{"source":"a"}],"#;
            glb_json(&format!(r#"{pictures}"materials":[{{"emissiveFactor":[1],"alphaMode":3}}]"#))
        }),
        (
            "whole numbers with a point",
            glb_json("").replace(r#""count":4"#, r#""count":4.0"#).replace("5126", "5126.0"),
        ),
        ("what is nothing", glb_json(r#","scene":null,"nodes":null,"skins":null"#)),
        ("names that are numbers", glb_json(r#","nodes":[{"mesh":0,"name":12}]"#)),
        ("animations of nothing", glb_json(r#","animations":[{"name":"a"}]"#)),
        ("a byte order mark", format!("\u{feff}{}", glb_json(""))),
        ("zeros behind", glb_json("") + "\0\0\0"),
        ("extensions that change no shape", {
            let name = r#"{"extensionsRequired":["KHR_node_visibility","KHR_texture_transform"],"asset""#;
            glb_json("").replace(r#"{"asset""#, name)
        }),
        ("a stride of 0", glb_json("").replace(r#""byteLength":48}"#, r#""byteLength":48,"byteStride":0}"#)),
    ] {
        let file = glb_file(&json, &glb_data());
        assert_eq!(read("a.glb", file).unwrap_or_else(|error| panic!("{what}: {error}")), tetrahedron(), "{what}");
    }
    let mut latin = glb_file(&glb_json(r#","nodes":[{"mesh":0,"name":"B@r"}]"#), &glb_data());
    let at = latin.iter().position(|&byte| byte == b'@').unwrap();
    latin[at] = 0xe4;
    assert_eq!(read("a.glb", latin).unwrap(), tetrahedron());
}

#[test]
fn scenes_without_a_mesh_and_documents_of_the_first_version_are_called_that() {
    let text = |json: &str| message(read("a.gltf", json));
    assert!(text(r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"name":"Scene"}]}"#).contains("has no points"));
    let elsewhere = glb_json(r#","nodes":[{"mesh":0}],"scene":0,"scenes":[{"name":"Empty"},{"nodes":[0]}]"#);
    let said = message(read("a.glb", glb_file(&elsewhere, &glb_data())));
    assert!(said.contains("has meshes, but none in the scene that it shows, scene 0"), "{said}");
    let first = r#"{"asset":{"version":"1.0"},"meshes":{"a":{}},"scenes":{"b":{"nodes":[]}}}"#;
    assert!(text(first).contains("is glTF 1.0; export the mesh as glTF 2.0"));
    assert!(text("{}").contains("has JSON that is not glTF 2.0"));
}

#[test]
fn a_thousand_copies_of_a_mesh_are_read() {
    // 4,000 × 60 points in a file of some kilobytes.
    let nodes: Vec<String> = (0..4000).map(|k| format!(r#"{{"mesh":0,"translation":[{k},0,0]}}"#)).collect();
    let json = glb_json(&format!(r#","nodes":[{}]"#, nodes.join(",")));
    let primitives = vec![PRIMITIVE; 15].join(r#","#).replace(r#""indices":1"#, r#""indices":1,"mode":4"#);
    let model = read("a.glb", glb_file(&json.replace(PRIMITIVE, &primitives), &glb_data())).unwrap();
    assert_eq!((model.points.len(), model.faces.len()), (16_000, 15 * 16_000));
}
