//! What lies on the faces of glTF: read, with points merged along seams, and written.

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use cager_formats::{
    CacheFormat, FrameOptions, MorphOptions, create_frames, open_frames, open_frames_bytes, read_mesh, read_split_mesh,
};
use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::surface::{
    Channel, Component, Crease, FaceGroup, Material, NO_MATERIAL, Part, Subdivision, Surface, Texture, Weights,
};
use gltf::json::Value;
use support::document::Built;
use support::{all, by_corner, glb_file, polygons, read, set, texture};
use tempfile::tempdir;

/// A square folded along its diagonal, a primitive for each half: A B C, and A C D.
const HALVES: [[[f32; 3]; 3]; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[-0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]]];
const LOOKS: &str = r#""materials":[{"name":"unused"},
    {"name":"skin","pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0.25,0.5],"metallicFactor":0,"roughnessFactor":0.75,
        "baseColorTexture":{"index":0}},"alphaMode":"BLEND"},
    {"pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":1}},"normalTexture":{"index":1}}],
    "textures":[{"source":1},{"source":0}],
    "images":[{"name":"rough.v2","mimeType":"image/jpeg","bufferView":0},{"uri":"tex/my%20skin.png"}]"#;

/// With texture coordinates, normals, colours of the first half, and what else primitives and
/// documents have.
fn folded(built: &mut Built, of_half: [&str; 2], rest: &str) -> Vec<u8> {
    let uvs = [[[0.0, 1.0], [1.0, 1.0], [1.0, 0.25]], [[0.0, 1.0], [0.5, 0.5], [0.0, 0.0]]];
    let normals = [[[0.0, 0.0, 1.0]; 3], [[0.0, -0.707, 0.707]; 3]];
    let mut primitives = Vec::new();
    for half in 0..2 {
        let [points, uvs, normals] =
            [built.vectors(&HALVES[half]), built.vectors(&uvs[half]), built.vectors(&normals[half])];
        let color =
            if half == 0 { format!(r#","COLOR_0":{}"#, built.vectors(&[[0.25, 0.5, 1.0]; 3])) } else { String::new() };
        primitives.push(format!(
            r#"{{"attributes":{{"POSITION":{points},"TEXCOORD_0":{uvs},"NORMAL":{normals}{color}{}}},"material":{}}}"#,
            of_half[half],
            half + 1
        ));
    }
    built.file(&format!(r#""meshes":[{{"primitives":[{}]}}],{LOOKS}{rest}"#, primitives.join(",")))
}

const NODES: &str = r#","nodes":[{"name":"rig","children":[1]},{"name":"a/b","mesh":0}]"#;

#[test]
fn primitives_of_a_mesh_are_a_part_whose_seams_are_closed() {
    let model = read("a.glb", folded(&mut Built::default(), [""; 2], NODES)).unwrap();
    model.surface.check(4, &model.faces).unwrap();
    assert_eq!(model.points, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]]);
    assert_eq!(model.faces, polygons(&[&[0, 1, 2], &[0, 2, 3]]));
    let [part] = &model.surface.parts[..] else { panic!("{:?}", model.surface.parts) };
    assert_eq!((part.path.as_str(), part.points, part.faces), ("/rig/a_b", 4, 2));
    let uvs = &part.uv_sets[0];
    assert_eq!(uvs.name, "TEXCOORD_0");
    // Upwards here, downwards there.
    let wanted = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.75], [0.0, 0.0], [0.5, 0.5], [0.0, 1.0]];
    assert_eq!(by_corner(uvs), wanted);
    // A has one value in both halves, C two.
    assert_eq!((uvs.values.len(), uvs.corners[0], uvs.corners[3]), (5, 0, 0));
    let colors = &part.color_sets[0];
    assert_eq!([0, 5].map(|k| colors.values[colors.corners[k] as usize]), [[0.25, 0.5, 1.0, 1.0], [1.0; 4]]);
    assert_eq!(part.normals, [0, 0, 0, 1, 1, 1]);
    assert_eq!(part.materials, [0, 1]);
    let [skin, other] = &model.surface.materials[..] else { panic!() };
    assert_eq!((skin.name.as_str(), skin.base_color, skin.opacity), ("skin", [1.0, 0.5, 0.25], 0.5));
    assert_eq!((skin.roughness, skin.metalness, other.metalness), (0.75, 0.0, 1.0));
    let textures = |material: &Material| -> Vec<(Channel, String)> {
        material.textures.iter().map(|texture| (texture.channel, texture.path.clone())).collect()
    };
    let path = || "tex/my skin.png".to_owned();
    assert_eq!(textures(skin), [(Channel::BaseColor, path()), (Channel::Opacity, path())]);
    let path = || "rough.v2.jpg".to_owned();
    assert_eq!(other.name, "material_2");
    assert_eq!(
        textures(other),
        [(Channel::Roughness, path()), (Channel::Metalness, path()), (Channel::Normal, path())]
    );
}

#[test]
fn points_that_move_apart_are_not_merged() {
    let points = |file: Vec<u8>| read("a.glb", file).unwrap().points.len();
    // The targets of both halves by what they do to A, C.
    for (moved, wanted) in [([[1.0, 2.0], [1.0, 2.0]], 4), ([[1.0, 2.0], [1.0, 3.0]], 5), ([[1.0, 0.0], [0.0, 0.0]], 5)]
    {
        let mut built = Built::default();
        let [[a, c], [other_a, other_c]] = moved.map(|moved| moved.map(|z: f32| [0.0, 0.0, z]));
        let targets = [built.vectors(&[a, [0.0; 3], c]), built.vectors(&[other_a, other_c, [0.0; 3]])];
        let file = folded(&mut built, [""; 2], NODES);
        let (json, _) = split(&file);
        let mut text = json.to_string();
        for (half, target) in targets.iter().enumerate() {
            let with = format!(r#""targets":[{{"POSITION":{target}}}],"material":{}"#, half + 1);
            text = text.replace(&format!(r#""material":{}"#, half + 1), &with);
        }
        assert_eq!(points(glb_file(&text, &built.data)), wanted, "{moved:?}");
    }
    let nodes = r#","nodes":[{"mesh":0,"skin":0},{},{}],"skins":[{"joints":[1,2]}]"#;
    for (joints, wanted) in [([0, 0], 4), ([0, 1], 6)] {
        let mut built = Built::default();
        let of_half = joints.map(|joint: u8| {
            let joints = built.add(5121, 3, "VEC4", &[joint, 0, 0, 0].repeat(3));
            let weights = built.vectors(&[[1.0, 0.0, 0.0, 0.0]; 3]);
            format!(r#","JOINTS_0":{joints},"WEIGHTS_0":{weights}"#)
        });
        assert_eq!(points(folded(&mut built, of_half.each_ref().map(String::as_str), nodes)), wanted, "{joints:?}");
    }
}

#[test]
fn frames_have_the_points_of_their_rest_pose_merged_or_as_stored() {
    let mut built = Built::default();
    let times = built.vectors(&[[0.0], [1.0]]);
    let places = built.vectors(&[[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]]);
    let animation = format!(
        r#"{NODES},"animations":[{{"channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}],"samplers":[{{"input":{times},"output":{places}}}]}}]"#
    );
    let file = folded(&mut built, [""; 2], &animation);
    let moved = |points: &[[f64; 3]]| -> Vec<f64> { points.iter().flat_map(|&[x, y, z]| [x, y, z + 5.0]).collect() };
    let open = |points| open_frames_bytes(CacheFormat::Glb, Path::new("a.glb"), &file, points);
    let rest = read("a.glb", &file).unwrap();
    assert_eq!(all(open(4).unwrap().as_mut())[1], moved(&rest.points));
    let stored: Vec<[f64; 3]> = HALVES.as_flattened().iter().map(|p| p.map(f64::from)).collect();
    assert_eq!(all(open(6).unwrap().as_mut())[1], moved(&stored));
    assert!(open(5).is_err());
    // Files of a frame each have all that are stored, and a rest pose has them too where it is asked.
    let folder = tempdir().unwrap();
    for name in ["a.0001.glb", "a.0002.glb"] {
        fs::write(folder.path().join(name), &file).unwrap();
    }
    let mut frames = open_frames(folder.path(), 6).unwrap();
    assert_eq!((frames.frames(), all(frames.as_mut())[1].len()), (2, 18));
    let split = read_split_mesh(&folder.path().join("a.0001.glb"), &[]).unwrap().unwrap().model;
    assert_eq!(split.points, stored);
    split.surface.check(6, &split.faces).unwrap();
}

#[test]
fn points_without_anything_on_their_faces_stay_as_they_are() {
    let mut built = Built::default();
    let points = built.vectors(HALVES.as_flattened());
    let of = |attributes: &str, mode: u8| {
        let primitive = format!(r#"{{"attributes":{{"POSITION":{points}{attributes}}},"mode":{mode}}}"#);
        read("a.glb", built.file(&format!(r#""meshes":[{{"primitives":[{primitive}]}}]"#))).unwrap()
    };
    assert_eq!((of("", 4).points.len(), of("", 4).surface), (6, Surface::default()));
    // A cloud has as many points as it has, whatever else these have.
    assert_eq!(of(&format!(r#","NORMAL":{points}"#), 0).points.len(), 6);
    assert_eq!(of(&format!(r#","NORMAL":{points}"#), 4).points.len(), 4);
}

#[test]
fn pictures_that_are_placed_alike_place_the_texture_coordinates() {
    let place =
        r#""extensions":{"KHR_texture_transform":{"offset":[0.5,0],"scale":[2,1],"rotation":1.5707963267948966}}"#;
    let uvs = |looks: &str| {
        let file = folded(&mut Built::default(), [""; 2], NODES);
        let (json, data) = split(&file);
        let file = glb_file(&json.to_string().replace(r#""baseColorTexture":{"index":0}"#, looks), &data);
        let folder = tempdir().unwrap();
        let path = folder.path().join("a.glb");
        fs::write(&path, file).unwrap();
        let read = read_mesh(&path, &[]).unwrap();
        let set = &read.model.surface.parts[0].uv_sets[0];
        (by_corner(set), read.dropped.sentence(&path, false).unwrap_or_default())
    };
    let (values, told) = uvs(&format!(r#""baseColorTexture":{{"index":0,{place}}}"#));
    // The corner at 1, 1 of the file is at 2, 1, then at 1, −2, then at 1.5, −2, which is 3 upwards.
    assert!((values[1][0] - 1.5).abs() < 1e-6 && (values[1][1] - 3.0).abs() < 1e-6, "{values:?}");
    assert_eq!(values[4], [0.5, 0.5]);
    assert!(!told.contains("KHR_texture_transform"), "{told}");
    let both = format!(r#""baseColorTexture":{{"index":0,{place}}},"metallicRoughnessTexture":{{"index":0}}"#);
    let (values, told) = uvs(&both);
    assert_eq!(values[1], [1.0, 0.0]);
    assert!(told.contains("places of textures that differ in one material (KHR_texture_transform)"), "{told}");
}

/// A strip of two squares with a seam, a hard edge and two materials, and a triangle without
/// anything below it.
fn scene() -> (Model, Surface) {
    let points =
        [[0, 0, 0], [1, 0, 0], [2, 0, 1], [0, 1, 0], [1, 1, 0], [2, 1, 1], [5, 5, 5], [0, 0, 3], [1, 0, 3], [0, 1, 3]];
    let faces = polygons(&[&[0, 1, 4, 3], &[1, 2, 5, 4], &[7, 9, 8]]);
    let strip = Part {
        path: "/rig/strip".to_owned(),
        points: 7,
        faces: 2,
        uv_sets: vec![
            set("UVMap", &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.75], [0.0, 1.0], [0.25, 0.5]], &[0, 1, 2, 3, 4, 1, 2, 3]),
            set("detail", &[[0.5, 0.5]], &[0; 8]),
        ],
        color_sets: vec![set("Col", &[[0.25, 0.5, 1.0, 1.0], [0.0, 0.0, 0.0, 0.5]], &[0, 0, 0, 0, 1, 0, 0, 0])],
        normals: vec![0, 0, 0, 0, 1, 1, 1, 1],
        tilts: None,
        weights: Weights::default(),
        subdivision: Subdivision::CatmullClark,
        creases: vec![Crease { edge: [0, 1], sharpness: 2.0 }],
        materials: vec![1, NO_MATERIAL],
        groups: vec![FaceGroup { name: "left".to_owned(), faces: vec![0] }],
        shown: None,
    };
    let flag = Part {
        path: "/rig/strip/flag".to_owned(),
        points: 3,
        faces: 1,
        materials: vec![0],
        shown: Some(vec![1..2, 3..4]),
        ..Part::default()
    };
    let gold = Material {
        name: "gold".to_owned(),
        base_color: [1.0; 3],
        opacity: 0.5,
        roughness: 1.0,
        metalness: 1.0,
        textures: vec![
            texture(Channel::BaseColor, "tex/gold base.png"),
            texture(Channel::Opacity, "tex/gold base.png"),
            texture(Channel::Roughness, "orm.png"),
            texture(Channel::Metalness, "orm.png"),
            texture(Channel::Normal, "n.png"),
            texture(Channel::Emission, "n.png"),
        ],
    };
    let plain = Material { name: "plain".to_owned(), base_color: [0.5, 0.25, 0.125], ..Material::default() };
    let surface = Surface { parts: vec![strip, flag], materials: vec![plain, gold], ..Surface::default() };
    let points = points.map(|p| p.map(f64::from)).to_vec();
    surface.check(points.len(), &faces).unwrap();
    (Model { points, faces, ..Model::default() }, surface)
}

/// Writes frames in which the model rises; gives the file and the notes.
fn written(folder: &Path, morphs: MorphOptions, frames: usize) -> (PathBuf, Vec<String>) {
    let (model, surface) = scene();
    let options = FrameOptions { morphs, surface, ..FrameOptions::default() };
    let path = folder.join("a.glb");
    let mut writer = create_frames(&path, model.points.len(), frames, &model.faces, &options).unwrap();
    for frame in 0..frames {
        let frame: Vec<f32> = model
            .points
            .iter()
            .flat_map(|&[x, y, z]| [x as f32, y as f32, z as f32 + frame as f32 * x as f32])
            .collect();
        writer.write_frame(&frame).unwrap();
    }
    let notes = writer.notes();
    writer.finish().unwrap();
    (path, notes)
}

/// The document of a file, and its other bytes.
fn split(bytes: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (gltf::json::deserialize::from_slice(&bytes[20..20 + length]).unwrap(), bytes[28 + length..].to_vec())
}

/// The floats of an accessor, one after another.
fn numbers(json: &Value, data: &[u8], accessor: &Value) -> Vec<f32> {
    let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    assert_eq!(accessor["componentType"], 5126);
    let start = (view["byteOffset"].as_u64().unwrap() + accessor["byteOffset"].as_u64().unwrap()) as usize;
    let width = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|shape| accessor["type"] == *shape).unwrap();
    let length = 4 * width * accessor["count"].as_u64().unwrap() as usize;
    data[start..start + length].as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}

#[test]
fn what_is_written_is_read_again() {
    let folder = tempdir().unwrap();
    let floats = MorphOptions { floats: true, ..MorphOptions::default() };
    let (path, notes) = written(folder.path(), floats, 4);
    let lost = "a.glb: has no place for subdivision, creases, 1 group (left) and faces of more than three corners of \
                the model";
    assert!(notes.iter().any(|note| note.ends_with(lost)), "{notes:?}");
    let (model, surface) = scene();
    let back = read_mesh(&path, &[]).unwrap().model;
    back.surface.check(10, &back.faces).unwrap();
    assert_eq!(back.faces, Polygons::of_triangles(&model.faces.triangulated()));
    let [strip, flag] = &back.surface.parts[..] else { panic!() };
    assert_eq!((strip.path.as_str(), flag.path.as_str()), ("/rig/strip", "/rig/strip/flag"));
    assert_eq!((strip.points, strip.faces, flag.points, flag.faces), (7, 4, 3, 1));
    // Of fans, the corners 0 1 2 and 0 2 3 of each face.
    let fan = |k: usize| [0, 1, 2, 0, 2, 3].map(|corner| 4 * k + corner);
    let corners: Vec<usize> = fan(0).into_iter().chain(fan(1)).collect();
    for (set, source) in strip.uv_sets.iter().zip(&surface.parts[0].uv_sets) {
        let found = by_corner(set);
        let wanted: Vec<[f32; 2]> = corners.iter().map(|&k| source.values[source.corners[k] as usize]).collect();
        assert_eq!(found, wanted, "{}", source.name);
    }
    assert_eq!(strip.uv_sets.len(), 2);
    let (set, source) = (&strip.color_sets[0], &surface.parts[0].color_sets[0]);
    let found = by_corner(set);
    assert_eq!(found, corners.iter().map(|&k| source.values[source.corners[k] as usize]).collect::<Vec<_>>());
    let hard = |corner: usize, other: usize| strip.normals[corner] != strip.normals[other];
    // The edge between both squares is hard, the diagonals are not.
    assert!(hard(1, 6) && hard(2, 8) && !hard(0, 3) && !hard(2, 4));
    let name = |part: &Part, face: usize| {
        back.surface.materials.get(part.materials[face] as usize).map(|material| material.name.as_str())
    };
    assert_eq!([0, 1, 2, 3].map(|face| name(strip, face)), [Some("gold"), Some("gold"), None, None]);
    assert_eq!(name(flag, 0), Some("plain"));
    let material = |wanted: &str| back.surface.materials.iter().find(|material| material.name == wanted).unwrap();
    assert_eq!((material("gold"), material("plain")), (&surface.materials[1], &surface.materials[0]));
    assert!(flag.normals.is_empty());
}

#[test]
fn textures_keep_their_coordinates_and_components() {
    let (model, mut surface) = scene();
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let mut write = |textures: Vec<Texture>| {
        surface.materials[1].textures = textures;
        let morphs = MorphOptions { floats: true, ..MorphOptions::default() };
        let options = FrameOptions { morphs, surface: surface.clone(), ..FrameOptions::default() };
        let _ = fs::remove_file(&path);
        let mut writer = create_frames(&path, model.points.len(), 1, &model.faces, &options).unwrap();
        writer.write_frame(&model.points.iter().flatten().map(|&x| x as f32).collect::<Vec<_>>()).unwrap();
        let notes = writer.notes().concat();
        writer.finish().unwrap();
        let back = read_mesh(&path, &[]).unwrap().model.surface;
        (back.materials.into_iter().find(|material| material.name == "gold").unwrap().textures, notes)
    };
    let on_detail = |texture: Texture| Texture { uv_set: "detail".to_owned(), ..texture };
    let (base, rough) = (texture(Channel::BaseColor, "a.png"), texture(Channel::Roughness, "r.png"));
    let metal = texture(Channel::Metalness, "r.png");
    let (back, notes) = write(vec![on_detail(base.clone()), rough.clone(), metal.clone()]);
    // Sets have their numbers as names there.
    let base_there = Texture { uv_set: "TEXCOORD_1".to_owned(), ..base.clone() };
    assert_eq!(back[0], base_there);
    assert!(back.contains(&rough) && back.contains(&metal) && !notes.contains("roughness"), "{back:?} {notes}");
    // The flag is hidden in the only frame.
    assert!(notes.contains("has no place for") && notes.contains("what is hidden (/rig/strip/flag)"), "{notes}");
    let red = Texture { component: Some(Component::Red), ..rough.clone() };
    for textures in [vec![red, metal.clone()], vec![on_detail(rough), metal]] {
        let (back, notes) = write(textures);
        assert!(back.is_empty() && notes.contains("not the green and the blue of one picture"), "{back:?} {notes}");
    }
    let json = split(&fs::read(&path).unwrap()).0;
    // The flag is at no node that is shown.
    let text = json["nodes"].to_string();
    assert_eq!((json["nodes"].as_array().unwrap().len(), text.matches("children").count()), (3, 1), "{text}");
}

#[test]
fn parts_move_together_and_are_where_they_are_though_hidden() {
    let folder = tempdir().unwrap();
    for (floats, tolerance) in [(true, 1e-5), (false, 1e-3)] {
        let (path, _) = written(folder.path(), MorphOptions { floats, ..MorphOptions::default() }, 4);
        let model = scene().0;
        let frames = all(open_frames(&path, 10).unwrap().as_mut());
        assert_eq!(frames.len(), 4);
        for (frame, positions) in frames.iter().enumerate() {
            for (k, (found, &[x, y, z])) in positions.as_chunks::<3>().0.iter().zip(&model.points).enumerate() {
                let wanted = [x, y, z + frame as f64 * x];
                let distance = (0..3).map(|k| (found[k] - wanted[k]).abs()).fold(0.0, f64::max);
                assert!(distance < tolerance, "frame {frame}, point {k}: {found:?}");
            }
        }
        assert_eq!(open_frames(&path, 10).unwrap().shown(), [None, Some(vec![1..2, 3..4])]);
        // Other programs see scales of nothing.
        let (json, data) = split(&fs::read(&path).unwrap());
        let animation = &json["animations"][0];
        let scales =
            animation["channels"].as_array().unwrap().iter().find(|channel| channel["target"]["path"] == "scale");
        let sampler = &animation["samplers"][scales.unwrap()["sampler"].as_u64().unwrap() as usize];
        assert_eq!((&scales.unwrap()["target"]["node"], &sampler["interpolation"]), (&1.into(), &"STEP".into()));
        let values: Vec<f32> = numbers(&json, &data, &sampler["output"]);
        let scale = json["nodes"][1]["scale"][0].as_f64().unwrap() as f32;
        assert_eq!(values, [0.0, scale, 0.0, scale].map(|x| [x; 3]).concat());
        fs::remove_file(&path).unwrap();
    }
}

#[test]
fn normals_follow_the_frames() {
    let folder = tempdir().unwrap();
    let (path, _) = written(folder.path(), MorphOptions { floats: true, ..MorphOptions::default() }, 2);
    let (json, data) = split(&fs::read(&path).unwrap());
    let floats = |accessor| numbers(&json, &data, accessor).as_chunks::<3>().0.to_vec();
    let primitive = &json["meshes"][0]["primitives"][0];
    let (base, target) = (floats(&primitive["attributes"]["NORMAL"]), floats(&primitive["targets"][0]["NORMAL"]));
    let positions = floats(&primitive["attributes"]["POSITION"]);
    // Three points with a vertex for each side or colour, and one without a face.
    assert_eq!(positions.len(), 9);
    let weights = numbers(&json, &data, &json["animations"][0]["samplers"][0]["output"]);
    for (frame, weight) in weights.into_iter().enumerate() {
        // The left square is z = frame · x, the right one z = (frame + 1) x − 1.
        let of_slope = |slope: f32| [-slope / slope.hypot(1.0), 0.0, 1.0 / slope.hypot(1.0)];
        let wanted = [of_slope(frame as f32), of_slope(frame as f32 + 1.0)];
        let mut seen = [0; 2];
        for vertex in (0..base.len()).filter(|&vertex| positions[vertex][1] < 4.0) {
            let sum: [f32; 3] = std::array::from_fn(|k| base[vertex][k] + weight * target[vertex][k]);
            let length = sum.iter().map(|x| x * x).sum::<f32>().sqrt();
            let near = |wanted: &[f32; 3]| (0..3).all(|k| (sum[k] / length - wanted[k]).abs() < 0.02);
            let side = wanted.iter().position(near).unwrap_or_else(|| panic!("frame {frame}: {sum:?}"));
            seen[side] += 1;
        }
        assert_eq!(seen, [4, 4], "frame {frame}");
    }
}
