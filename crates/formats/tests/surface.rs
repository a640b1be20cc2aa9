//! What lies on the faces comes back from the formats that have a place for it.

mod support;

use std::fs;
use std::path::Path;

use cager_formats::{FrameOptions, create_frames, read_mesh};
use cager_geometry::mesh::Model;
use cager_geometry::surface::{Channel, NO_MATERIAL};
use tempfile::tempdir;

/// A roof of two quads with a hard ridge and a seam of its texture along it, and a triangle beside it without material.
const OBJ: &str = "mtllib house.mtl
o roof
v 0 0 0
v 1 0 0
v 1 1 1
v 0 1 1
v 1 2 0
v 0 2 0
vt 0 0
vt 1 0
vt 1 0.5
vt 0 0.5
vt 0.25 0.75
vn 0 -0.7071 0.7071
vn 0 0.7071 0.7071
usemtl tiles
g left
f 1/1/1 2/2/1 3/3/1 4/4/1
g right windows
usemtl glass
f 4/1/2 3/2/2 5/3/2 6/5/2
o flag
v 5 0 0
v 6 0 0
v 5 1 0
f 7 8 9
";

const MTL: &str = "newmtl tiles\nKd 0.5 0.25 0.125\nPr 0.75\nmap_Kd tiles.png\nnewmtl glass\nd 0.5\nKd 1 1 1\n";

fn house(folder: &Path) -> Model {
    fs::write(folder.join("house.obj"), OBJ).unwrap();
    fs::write(folder.join("house.mtl"), MTL).unwrap();
    read_mesh(&folder.join("house.obj"), &[]).unwrap().model
}

#[test]
fn objects_texture_coordinates_materials_groups_and_hard_edges_of_an_obj_are_read() {
    let folder = tempdir().unwrap();
    let model = house(folder.path());
    model.surface.check(9, &model.faces).unwrap();
    let [roof, flag] = &model.surface.parts[..] else { panic!("{:?}", model.surface.parts) };
    assert_eq!((roof.path.as_str(), roof.points, roof.faces), ("/roof", 6, 2));
    assert_eq!((flag.path.as_str(), flag.points, flag.faces), ("/flag", 3, 1));
    let uvs = &roof.uv_sets[0];
    let at = |corner: usize| uvs.values[uvs.corners[corner] as usize];
    assert_eq!([at(0), at(3), at(4), at(7)], [[0.0, 0.0], [0.0, 0.5], [0.0, 0.0], [0.25, 0.75]]);
    assert!(flag.uv_sets.is_empty() && flag.normals.is_empty());
    assert_eq!((&roof.materials[..], &flag.materials[..]), (&[0, 1][..], &[1][..]));
    let tiles = &model.surface.materials[0];
    assert_eq!((tiles.base_color, tiles.roughness), ([0.5, 0.25, 0.125], 0.75));
    assert_eq!((tiles.textures[0].channel, tiles.textures[0].path.as_str()), (Channel::BaseColor, "tiles.png"));
    let groups: Vec<_> = roof.groups.iter().map(|group| (group.name.as_str(), &group.faces[..])).collect();
    assert_eq!(groups, [("left", &[0][..]), ("right", &[1][..]), ("windows", &[1][..])]);
    assert_ne!(roof.normals[2], roof.normals[5]);
    assert!(!roof.materials.contains(&NO_MATERIAL));
}

#[test]
fn an_obj_that_is_written_has_what_was_read() {
    let folder = tempdir().unwrap();
    let model = house(folder.path());
    let options = FrameOptions { surface: model.surface.clone(), ..FrameOptions::default() };
    let positions: Vec<f32> = model.points.as_flattened().iter().map(|&x| x as f32).collect();
    for (name, file) in [("one.obj", "one.obj"), ("walk.####.obj", "walk.0000.obj"), ("all/", "all/frame_0000.obj")] {
        let path = folder.path().join(name);
        let mut writer = create_frames(&path, 9, 1, &model.faces, &options).unwrap();
        writer.write_frame(&positions).unwrap();
        assert_eq!(writer.notes(), Vec::<String>::new());
        writer.finish().unwrap();
        let back = read_mesh(&folder.path().join(file), &[]).unwrap();
        assert_eq!(back.dropped, Default::default());
        assert_eq!(back.model, model, "{name}");
        // A second time in place of the first.
        let target = cager_formats::Target::Replacing(path);
        let mut writer = create_frames(target, 9, 1, &model.faces, &options).unwrap();
        writer.write_frame(&positions).unwrap();
        writer.finish().unwrap();
    }
    // Normals follow the points.
    let moved: Vec<f32> = positions.as_chunks::<3>().0.iter().flat_map(|&[x, y, z]| [x, y, -z]).collect();
    let path = folder.path().join("moved.obj");
    let mut writer = create_frames(&path, 9, 1, &model.faces, &options).unwrap();
    writer.write_frame(&moved).unwrap();
    writer.finish().unwrap();
    assert!(fs::read_to_string(&path).unwrap().contains("vn 0.00000 0.70711 0.70711"));
}

#[test]
fn other_formats_say_what_they_have_no_place_for() {
    let folder = tempdir().unwrap();
    let model = house(folder.path());
    let options = FrameOptions { surface: model.surface.clone(), ..FrameOptions::default() };
    let positions: Vec<f32> = model.points.as_flattened().iter().map(|&x| x as f32).collect();
    for (name, first) in [("a.ply", ""), ("a.npy", "texture coordinates, ")] {
        let mut writer = create_frames(folder.path().join(name), 9, 1, &model.faces, &options).unwrap();
        writer.write_frame(&positions).unwrap();
        let notes = writer.notes().join("\n");
        let all = "2 parts (roof and flag), 2 materials, normals and 3 groups (left, right and windows)";
        assert!(notes.contains(&format!("has no place for {first}{all}")), "{notes}");
    }
}

#[test]
fn a_ply_has_texture_coordinates_of_corners_or_vertices_and_names_its_pictures() {
    let folder = tempdir().unwrap();
    let model = house(folder.path());
    let options = FrameOptions { surface: model.surface.clone(), ..FrameOptions::default() };
    let path = folder.path().join("house.ply");
    let mut writer = create_frames(&path, 9, 1, &model.faces, &options).unwrap();
    writer.write_frame(&model.points.as_flattened().iter().map(|&x| x as f32).collect::<Vec<_>>()).unwrap();
    writer.finish().unwrap();
    let back = read_mesh(&path, &[]).unwrap();
    assert_eq!((back.dropped, &back.model.faces), (Default::default(), &model.faces));
    let (found, given) = (&back.model.surface, &model.surface.parts[0].uv_sets[0]);
    let set = &found.parts[0].uv_sets[0];
    for corner in 0..8 {
        assert_eq!(set.values[set.corners[corner] as usize], given.values[given.corners[corner] as usize]);
    }
    let material = &found.materials[0];
    assert_eq!((material.name.as_str(), material.textures[0].path.as_str()), ("tiles.png", "tiles.png"));
    // Of vertices, with two pictures.
    let head = "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b c.png\nelement vertex 4\n";
    let vertex = "property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\n";
    let faces = "element face 2\nproperty list uchar int vertex_indices\nproperty int texnumber\nend_header\n";
    let body = "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n1 1 0 1 1\n3 0 1 2 1\n3 1 3 2 0\n";
    fs::write(&path, [head, vertex, faces, body].concat()).unwrap();
    let model = read_mesh(&path, &[]).unwrap().model;
    let part = &model.surface.parts[0];
    assert_eq!((&part.materials[..], &part.uv_sets[0].corners[..]), (&[1, 0][..], model.faces.indices()));
    assert_eq!(part.uv_sets[0].values[3], [1.0, 1.0]);
    assert_eq!(model.surface.materials[1].textures[0].path, "b c.png");
    // Corners without coordinates of their own are none.
    let list = faces.replace("property int texnumber", "property list uchar float texcoord");
    let body = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2 6 0 0 1 0 0 1\n3 1 3 2 0\n";
    fs::write(&path, [head, &vertex.replace("property float u\nproperty float v\n", ""), &list, body].concat())
        .unwrap();
    let read = read_mesh(&path, &[]).unwrap();
    assert!(read.model.surface.is_empty());
    assert!(read.dropped.sentence(&path, false).unwrap().contains("texcoord"));
}

#[test]
fn what_does_not_fit_the_faces_is_left_out() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("odd.obj");
    // Texture coordinates that are not there, a normal without a corner, an object that shares its
    // points, an empty group.
    let text = "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 1\ng\nf 1/9/1 2/-1 3/1/\no b\nusemtl\nf 2 3 4\nf 1 2\n";
    fs::write(&path, text).unwrap();
    let read = read_mesh(&path, &[]).unwrap();
    let surface = read.model.surface;
    surface.check(4, &read.model.faces).unwrap();
    assert_eq!(surface.parts.len(), 1);
    assert_eq!(surface.parts[0].uv_sets[0].values, [[0.0, 0.0], [1.0, 0.0]]);
    assert!(surface.parts[0].normals.is_empty());
    // Nothing but names is nothing.
    fs::write(&path, "mtllib no.mtl\no a\ns 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n").unwrap();
    assert!(read_mesh(&path, &[]).unwrap().model.surface.is_empty());
}
