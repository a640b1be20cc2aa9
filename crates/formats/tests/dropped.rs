//! What files hold that models do not is told by name.

mod support;

use std::path::Path;

use cager_formats::{MeshFormat, read_mesh_bytes};
use support::*;

#[track_caller]
fn told(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let path = Path::new(name);
    let read = read_mesh_bytes(MeshFormat::from_path(path).unwrap(), path, bytes.as_ref()).unwrap();
    read.dropped.sentence(path, false).unwrap_or_default()
}

#[test]
fn a_plain_mesh_loses_nothing() {
    for (name, bytes) in
        [("a.obj", obj()), ("a.off", off()), ("a.stl", stl_ascii()), ("b.stl", stl_binary()), ("a.glb", glb())]
    {
        assert_eq!(told(name, bytes), "", "{name}");
    }
    let exported = b"mtllib a.mtl\no Cube\ng body\ns 1\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n";
    assert_eq!(told("a.obj", exported), "");
}

#[test]
fn what_is_not_kept_of_an_obj_is_told() {
    let text = "v 0 0 0 1 1 1\nv 1 0 0\nv 0 1 0\ns off\nf 1 2 3\ns 2\nf 1 3 2\nl 1 2\n#MRGB ff\n";
    assert_eq!(
        told("rest.obj", text),
        "rest.obj: vertex colours, which not all points have, smoothing groups (s), 1 line (l) and painted colours \
         (#MRGB) are not kept"
    );
    let path = Path::new("rest.obj");
    let read = read_mesh_bytes(MeshFormat::Obj, path, text.as_bytes()).unwrap();
    assert!(read.dropped.sentence(path, true).unwrap().contains("nor is the order of faces and of their corners"));
    let text = "o body\ng left\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl red\nf 1/1 2/1 3/1\ng right\nusemtl blue\nf \
                1/1 3/1 2/1\n";
    let read = read_mesh_bytes(MeshFormat::Obj, path, text.as_bytes()).unwrap();
    assert_eq!(read.dropped.sentence(path, false), None);
    assert_eq!(
        read.dropped_with_appearance().sentence(path, false).unwrap(),
        "rest.obj: texture coordinates, 2 materials and 2 groups (left and right) are not kept"
    );
}

#[test]
fn properties_of_a_splat_are_counted_and_the_first_ones_named() {
    let rest: String = (0..45).map(|k| format!("property float f_rest_{k}\n")).collect();
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty float \
         nx\nproperty float ny\nproperty float nz\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n{rest}property float opacity\nproperty float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n"
    );
    let line = vec!["0"; 62].join(" ");
    assert_eq!(
        told("splat.ply", header + &line + "\n"),
        "splat.ply: 59 of 62 properties (nx, ny, nz, f_dc_0 and 55 more) of its vertices are not kept"
    );
}

#[test]
fn other_properties_and_elements_of_a_ply_are_told() {
    assert_eq!(
        told("a.ply", ply_ascii()),
        "a.ply: 1 of 4 properties (red) of its vertices, 1 item of extra and 1 property (quality) of its faces are not \
         kept"
    );
    let text = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 1\nproperty float x\nproperty float \
                y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\nend_header\n0 0 0 1 2 3 4\n";
    assert_eq!(
        told("b.ply", text),
        "b.ply: 1 of 7 properties (alpha) of its vertices and its texture (TextureFile) are not kept"
    );
}

#[test]
fn colours_of_off_and_stl_files_are_told() {
    let body = "3 1 0\n0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2";
    assert_eq!(told("a.off", format!("COFF\n{body}\n")), "a.off: vertex colours (COFF) are not kept");
    let both = "a.off: numbers behind the positions of vertices and colours of faces are not kept";
    assert_eq!(told("a.off", format!("OFF\n{body} 255 0 0\n")), both);
    let mut colored = stl_binary();
    *colored.last_mut().unwrap() = 0x80;
    assert_eq!(told("a.stl", colored), "a.stl: colours of triangles (attribute bytes) are not kept");
}

#[test]
fn attributes_materials_and_skins_of_a_gltf_are_told() {
    let primitive = r#"{"attributes":{"POSITION":0},"indices":1}"#;
    let of = |attributes: &str, other: &str, rest: &str| {
        let changed = format!(r#"{{"attributes":{{"POSITION":0{attributes}}},"indices":1{other}}}"#);
        told("a.glb", glb_file(&glb_json(rest).replace(primitive, &changed), &glb_data()))
    };
    let uvs = of(r#","TEXCOORD_0":0,"TEXCOORD_1":0,"NORMAL":0"#, "", "");
    assert_eq!(uvs, "a.glb: texture coordinates (TEXCOORD_0 and TEXCOORD_1) are not kept");
    let look = of(r#","TANGENT":0,"_ID":0"#, r#","material":0"#, r#","materials":[{"occlusionTexture":{"index":0}}]"#);
    assert_eq!(look, "a.glb: textures of occlusion, tangents (TANGENT) and attributes of its own are not kept");
    let picture = r#","materials":[{"normalTexture":{"index":0}}],"textures":[{"source":0}],"images":[{"uri":"data:image/png;base64,AAAA"}]"#;
    assert_eq!(of("", r#","material":0"#, picture), "a.glb: 1 texture as text within the file is not kept");
    let skin = r#","nodes":[{"mesh":0,"skin":0},{}],"skins":[{"joints":[1]}]"#;
    assert_eq!(
        of("", r#","targets":[{"POSITION":0}]"#, skin),
        "a.glb: 1 morph target and its skin of 1 joint are not kept"
    );
    // Those that an animation drives are the motion that is read.
    let driven = r#","nodes":[{"mesh":0}],"animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}],"samplers":[{"input":0,"output":0}]}]"#;
    assert_eq!(of("", r#","targets":[{"POSITION":0}]"#, driven), "");
    // Of what is read alone.
    let two = glb_json(r#","nodes":[{"mesh":0}]"#).replace(
        &format!("[{primitive}]"),
        &format!(r#"[{primitive}]}},{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":0}}}}]"#),
    );
    assert_eq!(told("a.glb", glb_file(&two, &glb_data())), "");
}
