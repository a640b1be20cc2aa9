//! What users rely on when they read models.

mod support;

use cager_formats::{Error, MeshFormat, ReadModel, read_mesh, read_model};
use support::*;

#[test]
fn every_format_gives_the_same_tetrahedron() {
    for (name, bytes) in meshes() {
        let mut model = read(name, bytes).unwrap();
        if name.ends_with("stl") {
            assert_eq!(model.faces.indices()[..6], [0, 1, 2, 0, 2, 3], "{name}");
            model.points.swap(1, 2);
            assert_eq!(model.points, POINTS, "{name}");
        } else {
            // Of a scene the path is known too.
            model.surface = Default::default();
            assert_eq!(model, tetrahedron(), "{name}");
        }
    }
}

#[test]
fn obj_points_keep_their_order_and_polygons_their_corners() {
    let model = read(
        "a.obj",
        "mtllib x\no thing\nf 5 1 2 \\\n 3 4\r\nv\t1 2 3 0.5 0.5 0.5\nv 1 2 3 1.0\nvn 0 0 1\nvt 0 0\nv 0.1 1e-3 +4 # \
         c\n\
         v -0.0 5. .5\ng side\nusemtl m\ns off\nv 9 9 9\nf 1 2 3 4 # quad\nl 1 2\np 1\nf -1/2/3 -2 -3/-1\nvp 1 2 3",
    )
    .unwrap();
    assert_eq!(model.points, [[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [0.1, 1e-3, 4.0], [-0.0, 5.0, 0.5], [9.0; 3]]);
    assert_eq!(model.faces, polygons(&[&[4, 0, 1, 2, 3], &[0, 1, 2, 3], &[4, 3, 2]]));
}

#[test]
fn a_vertex_continued_over_lines_is_read_and_later_lines_keep_their_numbers() {
    let text = "v 1 \\\n2 \\\n3\nv 1 2 x\n";
    assert!(message(read("a.obj", text)).contains("line 4: \"x\" is not a number"));
}

#[test]
fn files_with_carriage_returns_alone_are_read() {
    let text = String::from_utf8(obj()).unwrap().replace('\n', "\r");
    assert_eq!(read("a.obj", text).unwrap(), tetrahedron());
    let text = String::from_utf8(ply_ascii()).unwrap().replace('\n', "\r\n");
    assert_eq!(read("a.ply", text).unwrap(), tetrahedron());
}

#[test]
fn a_point_cloud_is_a_model_without_faces() {
    let files = [
        ("a.obj", "v 1 2 3\n"),
        ("a.off", "OFF 1 0 0\n1 2 3"),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 \
             3",
        ),
    ];
    for (name, text) in files {
        let model = read(name, text).unwrap();
        assert_eq!(model.points, [[1.0, 2.0, 3.0]], "{name}");
        assert!(model.faces.is_empty(), "{name}");
    }
}

#[test]
fn colours_come_with_the_points_where_every_point_has_one() {
    let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
    let channels = |kind: &str| ["red", "green", "blue", "alpha"].map(|c| format!("property {kind} {c}\n")).concat();
    let ply = |kind: &str, values: &str| format!("{head}{}end_header\n{values}", channels(kind));
    for (name, text) in [
        ("a.obj", "v 1 2 3 1 0.2 0\nv 4 5 6 0 0 0.502\n".to_owned()),
        ("a.obj", "v 1 2 3 255 51 0\nv 4 5 6 0 0 128\n".to_owned()),
        ("a.ply", ply("uchar", "1 2 3 255 51 0 255\n4 5 6 0 0 128 255\n")),
        ("a.ply", ply("ushort", "1 2 3 65535 13107 0 9\n4 5 6 0 0 32896 9\n")),
        ("a.ply", ply("float", "1 2 3 1 0.2 0 1\n4 5 6 0 0 0.502 1\n")),
    ] {
        let model = read(name, &text).unwrap();
        assert_eq!(model.colors, [[255, 51, 0], [0, 0, 128]], "{text}");
        assert_eq!(model.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    }
    for (name, text) in [
        ("a.obj", "v 1 2 3 1 0 0\nv 4 5 6\n".to_owned()),
        ("a.obj", "v 1 2 3 1 0 0\nv 4 5 6 1 0 x\n".to_owned()),
        ("a.obj", "v 1 2 3 1 0 0\nv 4 5 6 1 0 nan\n".to_owned()),
        ("a.obj", "v 1 2 3 1 0 0 1\nv 4 5 6 1 0 0 1\n".to_owned()),
        ("a.ply", format!("{head}property uchar red\nend_header\n1 2 3 255\n4 5 6 0\n")),
        ("a.ply", ply("uchar", "1 2 3 300 51 0 255\n4 5 6 0 0 128 255\n")),
        ("a.ply", ply("int", "1 2 3 255 51 0 255\n4 5 6 0 0 128 255\n")),
    ] {
        let model = read(name, &text).unwrap();
        assert!(model.colors.is_empty() && model.points.len() == 2, "{text}");
    }
}

#[test]
fn colours_of_a_glb_are_light_and_unreadable_ones_are_left_out() {
    let nodes = r#","scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}]"#;
    let colored = |accessor: &str, bytes: &[u8]| {
        let views = r#"{"buffer":0,"byteOffset":48,"byteLength":24}"#;
        let json = glb_json(nodes)
            .replace("\"byteLength\":72", &format!("\"byteLength\":{}", 72 + bytes.len()))
            .replace(views, &format!(r#"{views},{{"buffer":0,"byteOffset":72,"byteLength":{}}}"#, bytes.len()))
            .replace(r#""SCALAR"}]"#, &format!(r#""SCALAR"}},{{"bufferView":2,"count":4,{accessor}}}]"#))
            .replace(r#""POSITION":0"#, r#""POSITION":0,"COLOR_0":2"#);
        let mut data = glb_data();
        data.extend(bytes);
        read("a.glb", glb_file(&json, &data)).unwrap()
    };
    let bytes: Vec<u8> = [[0, 55, 255, 7]; 4].concat();
    let model = colored(r#""componentType":5121,"normalized":true,"type":"VEC4""#, &bytes);
    assert_eq!((model.points.len(), model.colors), (4, vec![[0, 128, 255]; 4]));
    let floats: Vec<u8> = [0.0f32, 0.2159, 4.0].map(f32::to_le_bytes).concat().repeat(4);
    assert_eq!(colored(r#""componentType":5126,"type":"VEC3""#, &floats).colors, [[0, 128, 255]; 4]);
    // Beyond the data, and of another type.
    for accessor in [r#""componentType":5126,"type":"VEC4""#, r#""componentType":5120,"type":"VEC3""#] {
        assert_eq!(colored(accessor, &floats[..16]), tetrahedron(), "{accessor}");
    }
}

#[test]
fn a_face_that_repeats_a_vertex_is_kept() {
    assert_eq!(read("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 2\n").unwrap().faces, polygons(&[&[0, 1, 1]]));
}

#[test]
fn off_variants_are_read() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let files = [
        "OFF 3 1 3\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "# made by hand\nOFF\n\n3 1\n0 0 0 # first\n1 0 0\n\n0 1 0\n3 0 1 2 255 0 0\n",
        "COFF\n3 1 0\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n0 1 0 1 1 1 1\n3 0 1 2\n",
        "STCNOFF\n3 1 0\n0 0 0 0 0 1 1 1 1 1 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "OFF3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "OFF # of some program\n# 3 points\n3 # points\n1\n0 0 0\n1 0 0\n0 1 0\n3\n0 1 # on\n2 255 0 0\n",
    ];
    for text in files {
        let model = read("a.off", text).unwrap();
        assert_eq!((model.points.as_slice(), model.faces), (points.as_slice(), polygons(&[&[0, 1, 2]])), "{text}");
    }
}

#[test]
fn edges_and_points_among_faces_are_left_out_and_counted() {
    let ply = String::from_utf8(ply_ascii()).unwrap().replace("face 4", "face 6") + "2 1 2 0.5\n1 3 0.5\n";
    let off = String::from_utf8(off()).unwrap().replace("4 4 6", "4 6 6") + "2 0 1\n1 3\n";
    let edges = String::from_utf8(obj()).unwrap() + "f 1/1 2/2\nf 3\nl 1 2\np 1\n";
    let dir = std::env::temp_dir().join(format!("cager-left-out-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    for (name, text) in [("a.ply", ply), ("a.off", off), ("a.obj", edges)] {
        let path = dir.join(name);
        std::fs::write(&path, text).unwrap();
        let ReadModel { model, note, .. } = read_mesh(&path, &[]).unwrap();
        assert_eq!(model, tetrahedron(), "{name}");
        assert!(
            note.unwrap().ends_with(": left out 2 faces of fewer than three corners, which have no area"),
            "{name}"
        );
    }
    std::fs::write(dir.join("b.obj"), obj()).unwrap();
    assert_eq!(read_mesh(&dir.join("b.obj"), &[]).unwrap().note, None);
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn obj_faces_of_the_first_kind_are_read() {
    let text = String::from_utf8(obj()).unwrap().replace("\nf ", "\nfo ");
    assert_eq!(read("a.obj", text).unwrap(), tetrahedron());
}

#[test]
fn ply_strips_are_unfolded() {
    let strips = |element: &str, strip: &str| {
        let head = "ply\nformat ascii 1.0\nelement vertex 5\nproperty int x\nproperty int y\nproperty int z\n";
        let points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n";
        let list = "property list int int vertex_indices";
        read("a.ply", format!("{head}element tristrips {element}\n{list}\nend_header\n{points}{strip}\n"))
            .map(|m| m.faces)
    };
    let two = polygons(&[&[0, 1, 2], &[2, 1, 3]]);
    assert_eq!(strips("1", "4 0 1 2 3").unwrap(), two);
    let again = polygons(&[&[0, 1, 2], &[2, 1, 3], &[4, 3, 2], &[0, 1, 2]]);
    assert_eq!(strips("2", "9 0 1 2 3 -1 4 3 2 -1\n3 0 1 2").unwrap(), again);
    // A vertex that is repeated turns the strip without a face.
    assert_eq!(strips("1", "6 0 1 2 2 3 4").unwrap(), polygons(&[&[0, 1, 2], &[3, 2, 4]]));
    assert_eq!(strips("1", "2 0 1").unwrap(), polygons(&[]));
    assert!(message(strips("1", "3 0 1 5")).contains("strip 0: the face names vertex 5"));
    assert!(message(strips("1", "3 0 1 -2")).contains("strip 0: the face names vertex -2"));
}

#[test]
fn ply_lines_that_other_programs_note_are_passed_over() {
    let text = String::from_utf8(ply_ascii()).unwrap();
    let noted = text
        .replace("comment by hand\n", "comment\nTextureFile wood.png\n\n  obj_info made by hand\n")
        .replace("element face 4", "element face 4 of them")
        .replace("property float x", "  property  float\tx ")
        .replace("vertex_index", "corners");
    assert_eq!(read("a.ply", noted).unwrap(), tetrahedron());
}

#[test]
fn stl_files_with_more_or_less_behind_their_triangles_are_read() {
    let whole = stl_binary();
    let mut longer = whole.clone();
    longer[..5].copy_from_slice(b"COLOR");
    longer.extend(b"notes of some program");
    assert_eq!(read("a.stl", longer).unwrap(), read("a.stl", whole).unwrap());
    let text = String::from_utf8(stl_ascii()).unwrap();
    let open = text.replace("endsolid t\n", "");
    assert_eq!(read("a.stl", &open).unwrap(), read("a.stl", &text).unwrap());
    assert_eq!(read("a.stl", open.trim_end()).unwrap(), read("a.stl", &text).unwrap());
    for cut in [1, 4, 8, 12, 14, 25, 40, 90] {
        let error = message(read("a.stl", &open.trim_end()[..open.trim_end().len() - cut]));
        assert!(error.contains("copy or export"), "{cut}: {error}");
    }
}

#[test]
fn ply_faces_may_come_before_their_vertices() {
    let text = "ply\nformat ascii 1.0\nelement face 1\nproperty list char short vertex_indices\nelement vertex 3\n\
                property double z\nproperty list uchar int more\nproperty double y\nproperty double x\nend_header\n\
                3 2 1 0\n1 2 5 6 2 3\n4 0 5 6\n7 0 8 9\n";
    let model = read("a.ply", text).unwrap();
    assert_eq!(model.points, [[3.0, 2.0, 1.0], [6.0, 5.0, 4.0], [9.0, 8.0, 7.0]]);
    assert_eq!(model.faces, polygons(&[&[2, 1, 0]]));
}

#[test]
fn ply_elements_without_properties_take_no_time_whatever_they_promise() {
    let text = "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nelement vertex 1\nproperty int \
                x\nproperty int y\n\
                property int z\nend_header\n1 2 3";
    assert_eq!(read("a.ply", text).unwrap().points.len(), 1);
}

#[test]
fn stl_corners_are_shared_by_position_with_minus_zero_as_zero() {
    let text = "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
                FACET\nOUTER LOOP\nVERTEX -0 0 -0.0\nvertex 0 1 0\nvertex 0 1 1e-300\nendloop\nendfacet\nendsolid\n";
    let model = read("a.stl", text).unwrap();
    assert_eq!(model.points.len(), 4);
    assert_eq!(model.faces, polygons(&[&[0, 1, 2], &[0, 2, 3]]));
    assert!(model.points[0][0].is_sign_positive());
}

#[test]
fn glb_meshes_stand_where_their_nodes_put_them() {
    let nodes = r#","scene":1,"scenes":[{"nodes":[2]},{"nodes":[0]}],"nodes":[
        {"translation":[10,0,0],"children":[1,3]},
        {"mesh":0,"rotation":[0,0,0.70710678118,0.70710678118],"scale":[2,2,2]},
        {"mesh":0},
        {"mesh":0,"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,5,1]}]"#;
    let model = read("a.glb", glb_file(&glb_json(nodes), &glb_data())).unwrap();
    assert_eq!(model.points.len(), 8);
    let turned = POINTS.map(|[x, y, z]| [10.0 - 2.0 * y, 2.0 * x, 2.0 * z]);
    let mirrored = POINTS.map(|[x, y, z]| [10.0 - x, y, z + 5.0]);
    for (found, wanted) in model.points.iter().zip(turned.iter().chain(&mirrored)) {
        assert!((0..3).all(|k| (found[k] - wanted[k]).abs() < 1e-6), "{found:?} is not {wanted:?}");
    }
    assert_eq!(model.faces.indices()[..3], [0, 2, 1]);
    assert_eq!(model.faces.indices()[12..15], [4, 5, 6], "a mirrored mesh has its triangles turned back");
}

#[test]
fn glb_primitives_that_share_their_points_do_not_repeat_them() {
    let json = glb_json("").replace(r#""indices":1}"#, r#""indices":1},{"attributes":{"POSITION":0},"mode":5}"#);
    let model = read("a.glb", glb_file(&json, &glb_data())).unwrap();
    assert_eq!(model.points, POINTS);
    assert_eq!(model.faces.indices()[12..], [0, 1, 2, 1, 3, 2]);
}

#[test]
fn a_long_text_in_a_glb_is_not_repeated_in_full() {
    let text =
        message(read("a.glb", glb_file(&glb_json(&format!(",\"nodes\":[\"{}\"]", "b".repeat(5000))), &glb_data())));
    assert!(text.len() < 400 && text.contains("is not glTF 2.0") && text.contains('…'), "{text}");
}

#[test]
fn glb_references_to_nothing_are_named() {
    let with = |rest: &str| message(read("a.glb", glb_file(&glb_json(rest), &glb_data())));
    assert!(with(r#","nodes":[{"mesh":7}]"#).contains("mesh 7"));
    assert!(with(r#","nodes":[{"children":[3],"mesh":0}]"#).contains("node 3"));
    assert!(with(r#","scene":4,"nodes":[{"mesh":0}]"#).contains("scene 4"));
    assert!(
        with(r#","scenes":[{"nodes":[0]}],"nodes":[{"children":[0],"mesh":0}]"#).contains("node 0 is reached twice")
    );
    let view = glb_json("").replace(r#""bufferView":1"#, r#""bufferView":9"#);
    assert!(message(read("a.glb", glb_file(&view, &glb_data()))).contains("bufferView 9"));
    let accessor = glb_json("").replace(r#""POSITION":0"#, r#""POSITION":9"#);
    assert!(message(read("a.glb", glb_file(&accessor, &glb_data()))).contains("accessor 9"));
}

#[test]
fn a_glb_of_a_few_bytes_cannot_ask_for_endless_copies() {
    let nodes = vec![r#"{"mesh":0}"#; 30_000].join(",");
    let json = glb_json(&format!(r#","nodes":[{nodes}]"#));
    let json = json.replace(r#""byteLength":24"#, r#""byteLength":12000"#).replace(r#""count":12"#, r#""count":6000"#);
    let mut data = glb_data();
    data.resize(48 + 12_000, 0);
    let error = message(read("a.glb", glb_file(&json, &data)));
    assert!(error.contains("repeats its meshes too often"), "{error}");
}

#[test]
fn errors_name_the_file_the_place_and_what_to_do() {
    let ply = String::from_utf8(ply_ascii()).unwrap();
    let cases = [
        (
            "a.obj",
            "v 0 0 0\nv 1 0 0\n\nf 1 2 7\n".into(),
            "a.obj: line 4: the face names vertex 7, but there are 2 vertices; ",
        ),
        ("a.obj", "v 0 0 0\nf 1 2 0\n".into(), "a.obj: line 2: the face names vertex 0"),
        (
            "a.obj",
            "v 0 0 0\nf -1 -2 -1\n".into(),
            "a.obj: line 2: the face names vertex -2, but there are 1 vertices; ",
        ),
        ("a.obj", "v 0 0 0\nf 1 99999999999 1\n".into(), "a.obj: line 2: the face names vertex 99999999999"),
        ("a.obj", "v 0 0 0\nf 1 1".into(), "a.obj: line 2: the file ends within this line, \"f 1 1\", so it was cut; "),
        ("a.obj", "v 0 -0,5 1\n".into(), "a.obj: line 1: \"-0,5\" has a decimal comma; export it with decimal points"),
        ("a.off", "OFF 1 0 0\n1,5 0 0\n".into(), "a.off: line 2: \"1,5\" has a decimal comma; "),
        ("a.ply", ply.replace("0 1.5 0 255", "0 1,5 0 255"), "a.ply: line 18: \"1,5\" has a decimal comma; "),
        ("a.stl", "solid\nfacet\nouter loop\nvertex 0 1,5 0\n".into(), "a.stl: line 4: \"1,5\" has a decimal comma; "),
        ("a.obj", "v 0 0 0\nf a b c\n".into(), "a.obj: line 2: \"a\" is not a vertex number; "),
        ("a.obj", "v 0 0\n".into(), "a.obj: line 1: the vertex has 2 coordinates instead of 3; "),
        ("a.obj", "v 0 nan 0\n".into(), "a.obj: line 1: the vertex has a coordinate that is NaN or infinite; "),
        ("a.obj", "v 0 1e999 0\n".into(), "a.obj: line 1: the vertex has a coordinate that is NaN or infinite; "),
        ("a.obj", "# nothing\n".into(), "a.obj: has no points; "),
        ("a.obj", String::new(), "a.obj: is empty; "),
        (
            "a.off",
            "OFF\n2 1 0\n0 0 0\n1 1 1\n3 0 1 2\n".into(),
            "a.off: line 5: the face names vertex 2, but there are 2",
        ),
        ("a.off", "OFF\n3 0 0\n0 0 0\n".into(), "a.off: ends after 1 of 3 vertices; "),
        ("a.off", "OFF\n1 2 0\n0 0 0\n".into(), "a.off: ends after 0 of 2 faces; "),
        ("a.off", "4OFF\n1 0 0\n".into(), "a.off: line 1: \"4OFF\" has points that are not in three dimensions; "),
        ("a.off", "OFF BINARY\n".into(), "a.off: is a binary OFF file; "),
        (
            "a.off",
            "OFF\n1 1 0\n0 0 0\n9999999999 0 0\n".into(),
            "a.off: line 4: the face has 2 of the 9999999999 corners",
        ),
        ("a.ply", ply.replace("3 1 2 3 0.5", "3 1 2 4 0.5"), "a.ply: face 3: the face names vertex 4, but there are 4"),
        ("a.ply", ply.replace("3 1 2 3 0.5", "3 1 2 -1 0.5"), "a.ply: face 3: the face names vertex -1"),
        ("a.ply", ply.replace("3 1 2 3 0.5", ""), "a.ply: ends after 3 of 4 items of \"face\"; "),
        ("a.ply", ply.replace("0 1.5 0 255", "0 nan 0 255"), "a.ply: vertex 2 has a coordinate that is NaN"),
        ("a.ply", ply.replace("double z", "double w"), "a.ply: has vertices without z; "),
        (
            "a.ply",
            ply.replace("list uchar uint vertex_index", "uchar corners"),
            "a.ply: has faces without vertex_indices; ",
        ),
        ("a.ply", "ply\nelement vertex x\n".into(), "a.ply: line 2: \"element vertex x\" is not understood"),
        ("a.stl", "solid\nvertex 0 0 0\n".into(), "a.stl: ends within a facet; "),
        ("a.stl", "solid\nfacet\nouter loop\nvertex 0 0 0\nendloop\n".into(), "a.stl: line 5: the face has 1 corners"),
        ("a.stl", "solid\nhello\n".into(), "a.stl: line 2: \"hello\" is not a word of an STL file; "),
        ("a.stl", "short".into(), "a.stl: has 5 bytes, too few"),
    ];
    for (name, text, wanted) in cases {
        let error = message(read(name, &text));
        assert!(error.starts_with(wanted), "{error}\nfor {text}");
    }
}

#[test]
fn a_long_name_in_a_file_is_not_repeated_in_full() {
    let name = "\u{1b}[2J".to_owned() + &"x".repeat(10_000);
    let text = format!("ply\nformat ascii 1.0\nelement {name} 2\nproperty int a\nend_header\n1\n");
    let error = message(read("a.ply", text));
    assert!(error.starts_with(r#"a.ply: ends after 1 of 2 items of "\u{1b}[2Jxxx"#), "{error}");
    assert!(error.len() < 200 && !error.contains('\u{1b}'), "{error}");
}

#[test]
fn a_binary_stl_cut_short_says_how_much_is_there() {
    let mut bytes = stl_binary();
    bytes[..5].fill(0);
    let error = message(read("a.stl", &bytes[..200]));
    assert!(error.starts_with("a.stl: promises 4 triangles in 284 bytes but has 200; "), "{error}");
}

#[test]
fn unknown_formats_are_answered_with_the_known_ones() {
    let error = message(MeshFormat::from_path("scan.dae".as_ref()));
    assert_eq!(
        error,
        "scan.dae: .dae is not a mesh format that is read; convert it to one of .obj .ply .off .stl .glb .abc .usdc \
         .usdz .usda .usd .gltf .fbx"
    );
    assert!(message(MeshFormat::from_path("scan".as_ref())).contains("has no file name extension"));
    assert_eq!(MeshFormat::from_path("A.OBJ".as_ref()).unwrap(), MeshFormat::Obj);
}

#[test]
fn a_missing_file_is_named() {
    let error = read_model("no/such.obj".as_ref()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().starts_with("no/such.obj: cannot be read ("), "{error}");
    assert!(error.to_string().ends_with("); check the path"), "{error}");
}

#[test]
fn a_web_page_or_utf_16_given_as_a_mesh_is_called_that() {
    let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    for name in ["a.obj", "a.ply", "a.off", "a.stl", "a.glb"] {
        for page in ["<!DOCTYPE html>\n<html></html>", "\n  <HTML lang=en>"] {
            assert!(
                message(read(name, page)).contains("is a web page, not the file itself; download the file itself"),
                "{name}"
            );
        }
        for text in [utf16("\u{feff}v 0 0 0\nv 1 0 0\n"), utf16("v 0 0 0\nv 1 0 0\n")] {
            assert!(message(read(name, text)).contains("is text in UTF-16; save it as UTF-8"), "{name}");
        }
    }
}
