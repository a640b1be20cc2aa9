//! What users rely on when scenes of FBX are read.

#![cfg(feature = "fbx")]

mod support;

use std::fs;
use std::io::Write;
use std::path::Path;

use cager_formats::{
    CacheFormat, FrameSelection, MeshFormat, ReadModel, Up, create_frames, open_frames, open_frames_bytes,
    open_selected_frames, read_mesh, read_mesh_bytes,
};
use cager_geometry::surface::{Channel, Part, Subdivision};
use support::{arrays, character, message};
use tempfile::tempdir;

const CUBE: &str = include_str!("fbx/cube.fbx");

fn read(text: &str) -> Result<ReadModel, cager_formats::Error> {
    read_mesh_bytes(MeshFormat::Fbx, Path::new("a.fbx"), text.as_bytes())
}

fn frames(text: &str, points: usize, selection: &FrameSelection) -> (Vec<Vec<f64>>, Vec<f64>, Vec<String>) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.fbx");
    fs::write(&path, text).unwrap();
    let mut reader = open_selected_frames(&path, points, selection).unwrap();
    let (mut all, mut frame) = (Vec::new(), Vec::new());
    while reader.read_next(&mut frame).unwrap() {
        all.push(frame.clone());
    }
    let numbers = (0..all.len()).map(|k| reader.number(k)).collect();
    (all, numbers, reader.notes())
}

fn cube_alone() -> FrameSelection {
    FrameSelection { prims: vec!["cube".to_owned()], ..FrameSelection::default() }
}

#[test]
fn all_meshes_of_a_scene_are_parts_with_what_lies_on_their_faces() {
    let found = read(CUBE).unwrap();
    let model = &found.model;
    model.surface.check(13, &model.faces).unwrap();
    assert_eq!((found.units.up, found.units.metres_per_unit), (Some(Up::Z), Some(0.1)));
    assert!(found.note.unwrap().contains("left out 1 face of fewer than three corners"));
    let [cube, flag] = &model.surface.parts[..] else { panic!("{:?}", model.surface.parts) };
    assert_eq!((cube.path.as_str(), cube.points, cube.faces), ("/walker/cube", 8, 6));
    assert_eq!((flag.path.as_str(), flag.points, flag.faces), ("/walker/flag", 5, 2));
    assert_eq!((&cube.materials[..], &flag.materials[..]), (&[0, 0, 0, 1, 1, 1][..], &[][..]));
    let [red, glass] = &model.surface.materials[..] else { panic!("{:?}", model.surface.materials) };
    assert_eq!((red.name.as_str(), red.base_color, glass.base_color), ("red", [0.5, 0.25, 0.125], [1.0; 3]));
    assert_eq!((red.textures[0].channel, red.textures[0].path.as_str()), (Channel::BaseColor, "pictures/tiles.png"));
    let uvs = &cube.uv_sets[0];
    assert_eq!((uvs.name.as_str(), uvs.values[uvs.corners[6] as usize]), ("map", [1.0, 0.75]));
    // 0.5 in sRGB is 0.2140 of full light.
    let colors = &cube.color_sets[0];
    let of_corner = |corner: usize| colors.values[colors.corners[corner] as usize];
    assert_eq!(of_corner(0), [0.0, 0.0, 0.0, 1.0]);
    let [red, green, blue, alpha] = of_corner(4);
    assert!(red == 1.0 && (green - 0.2140).abs() < 1e-4 && blue == 0.0 && alpha == 0.25);
    let creases: Vec<_> = cube.creases.iter().map(|crease| (crease.edge, crease.sharpness)).collect();
    assert_eq!(creases, [([2, 3], 2.5), ([1, 2], 10.0)]);
    assert!(cube.has_hard_edges(&model.faces.indices()[..24]) && flag.normals.is_empty());
    assert_eq!(cube.subdivision, Subdivision::None);
    // The flag is mirrored: its faces are turned, and half of its shape is added.
    assert_eq!(model.faces.iter().last().unwrap(), [10, 9, 8]);
    assert_eq!((model.points[7], model.points[9]), ([0.0, 6.0, 1.0], [-2.0, 0.5, 0.0]));
}

#[test]
fn pictures_in_the_file_are_taken_out_of_it() {
    let video = "Video: 303, \"Video::tiles\", \"Clip\" {\nType: \"Clip\"\nRelativeFilename: \"pictures\\tiles.png\"\n\
                 Content: ,\n\"iVBORw0KGgo=\"\n}\nTexture: 302,";
    let text = CUBE.replacen("Texture: 302,", video, 1).replacen(
        "C: \"OP\",302,300",
        "C: \"OO\",303,302\nC: \"OP\",302,300",
        1,
    );
    let surface = read(&text).unwrap().model.surface;
    let [picture] = &surface.pictures[..] else { panic!("{:?}", surface.pictures) };
    assert_eq!((picture.path.as_str(), &picture.bytes[..]), ("pictures/tiles.png", &b"\x89PNG\r\n\x1a\n"[..]));
    assert!(read(CUBE).unwrap().model.surface.pictures.is_empty());
}

#[test]
fn frames_are_those_of_the_animation_at_its_rate_or_another() {
    let (all, numbers, notes) = frames(CUBE, 13, &FrameSelection::default());
    assert_eq!((all.len(), numbers[0], numbers[24]), (25, 0.0, 24.0));
    assert!(notes.is_empty());
    for (k, frame) in all.iter().enumerate() {
        let x = 0.5 * k as f64;
        assert!((frame[0] - x).abs() < 1e-6 && frame[1] == 5.0, "frame {k}: {:?}", &frame[..3]);
        assert_eq!(frame[27..30], [-2.0, 0.5, 0.0]);
    }
    let selection = FrameSelection { rate: Some(48.0), ..cube_alone() };
    let (all, numbers, _) = frames(CUBE, 8, &selection);
    assert_eq!((all.len(), numbers[48]), (49, 48.0));
    assert!((all[1][0] - 0.25).abs() < 1e-6);
}

#[test]
fn a_part_is_shown_in_the_frames_before_it_is_switched_off() {
    let reader = open_frames_bytes(CacheFormat::Fbx, Path::new("a.fbx"), CUBE.as_bytes(), 13).unwrap();
    let until_6: Vec<_> = std::iter::once(0..6).collect();
    assert_eq!(reader.shown(), [None, Some(until_6)]);
    // What hides it always leaves it out, unless it is named.
    let hidden = CUBE.replace("\"Visibility\", \"\", \"A\",1\n", "\"Visibility\", \"\", \"A\",0\n");
    let hidden = hidden.replace("\tC: \"OP\",404,202,\"Visibility\"\n", "");
    let (_, _, notes) = frames(&hidden, 8, &FrameSelection::default());
    assert!(notes[0].contains("left out what is hidden: /walker/flag (5 points); --prim reads it too"), "{notes:?}");
    let selection = FrameSelection { prims: vec!["/walker/*".to_owned()], ..FrameSelection::default() };
    assert_eq!(frames(&hidden, 13, &selection).0.len(), 25);
}

#[test]
fn one_of_several_animations_is_chosen_by_name_or_number() {
    let second = "\tAnimationStack: 500, \"AnimStack::run\", \"\" {
		Properties70:  {
			P: \"LocalStart\", \"KTime\", \"Time\", \"\",46186158000
			P: \"LocalStop\", \"KTime\", \"Time\", \"\",92372316000
		}
	}
	AnimationLayer: 501, \"AnimLayer::run\", \"\" {
	}
	AnimationStack: 600, \"AnimStack::still\", \"\" {
	}
}
Connections:  {
	C: \"OO\",501,500
	C: \"OO\",402,501
";
    let text = CUBE.replace("}\nConnections:  {\n", second);
    let with = |animation: &str| FrameSelection { animation: Some(animation.to_owned()), ..cube_alone() };
    let (first, _, notes) = frames(&text, 8, &cube_alone());
    assert_eq!((first.len(), notes.len()), (25, 1));
    assert!(
        notes[0].contains("of its 2 animations walk is read, run left out; choose one with --animation"),
        "{notes:?}"
    );
    for wanted in ["run", "1"] {
        let (_, numbers, notes) = frames(&text, 8, &with(wanted));
        assert_eq!((numbers.len(), numbers[0], notes.len()), (25, 24.0, 0));
    }
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.fbx");
    fs::write(&path, &text).unwrap();
    let error = message(open_selected_frames(&path, 8, &with("jump")));
    assert!(error.ends_with("has no animation jump, but walk and run"), "{error}");
    // The only one is taken whatever it is called.
    assert_eq!(frames(CUBE, 8, &with("jump")).0.len(), 25);
}

#[test]
fn a_geometry_cache_beside_the_scene_moves_its_mesh() {
    let cache = "\tDeformer: 120, \"Deformer::cache\", \"VertexCacheDeformer\" {
		Version: 100
		Properties70:  {
			P: \"Active\", \"bool\", \"\", \"\",1
		}
	}
	Cache: 121, \"Cache::walk\", \"\" {
		Version: 100
		Properties70:  {
			P: \"CacheFileName\", \"KString\", \"XRefUrl\", \"\", \"caches\\walk.xml\"
			P: \"CacheFileType\", \"enum\", \"\", \"\",2
		}
	}
}
Connections:  {
	C: \"OO\",120,100
	C: \"OO\",121,120
";
    let text = CUBE.replace("}\nConnections:  {\n", cache);
    let (still, _, notes) = frames(&text, 8, &cube_alone());
    assert!(notes[0].contains("/walker/cube is moved by a geometry cache that is not there"), "{notes:?}");
    assert_eq!(still[3][21..24], [1.5, 6.0, 1.0]);
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.fbx");
    fs::write(&path, &text).unwrap();
    let mut writer =
        create_frames(folder.path().join("walk.mcx"), 8, 25, &Default::default(), &Default::default()).unwrap();
    for k in 0..25_u8 {
        writer.write_frame(&[f32::from(k); 24]).unwrap();
    }
    writer.finish().unwrap();
    let mut reader = open_selected_frames(&path, 8, &cube_alone()).unwrap();
    assert!(reader.notes().is_empty());
    let mut frame = Vec::new();
    for k in 0..25 {
        assert!(reader.read_next(&mut frame).unwrap());
        let k = f64::from(k);
        assert!((frame[21] - 1.5 * k).abs() < 1e-5 && (frame[22] - 5.0 - k).abs() < 1e-5, "{:?}", &frame[21..]);
    }
}

#[test]
fn other_axes_are_turned_and_said() {
    // The first axis towards the left.
    let mirrored = CUBE
        .replace("\"CoordAxisSign\", \"int\", \"Integer\", \"\",1", "\"CoordAxisSign\", \"int\", \"Integer\", \"\",-1");
    let found = read(&mirrored).unwrap();
    assert_eq!((found.units.up, found.units.metres_per_unit), (Some(Up::Y), Some(0.1)));
    let (_, _, notes) = frames(&mirrored, 8, &cube_alone());
    assert!(notes[0].contains("is turned to Y up"), "{notes:?}");
    // Seen from outside, its faces are still counterclockwise.
    let faces: Vec<_> = found.model.faces.iter().take(6).collect();
    let volume: f64 = faces.iter().map(|face| signed_volume(face, &found.model.points)).sum();
    assert!((volume - 1.0).abs() < 1e-9, "{volume}");
}

/// Of the pyramid below a face, positive where it is counterclockwise from above.
fn signed_volume(face: &[u32], points: &[[f64; 3]]) -> f64 {
    let at = |k: usize| points[face[k] as usize];
    let tetrahedron = |k: usize| {
        let ([a, b, c], [d, e, f], [g, h, i]) = (at(0), at(k), at(k + 1));
        (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / 6.0
    };
    (1..face.len() - 1).map(tetrahedron).sum()
}

#[test]
fn what_is_wrong_with_a_file_is_said() {
    let error = |text: &str| message(read(text));
    assert!(error("; FBX 7.4.0\n").contains("export it again"), "{}", error("; FBX 7.4.0\n"));
    assert!(error("v 0 0 0\nv 1 0 0\n").contains("is not a .fbx file but a file of the kind .obj"));
    let bare = error(&CUBE.replace("C: \"OO\",100,201", "").replace("C: \"OO\",110,202", ""));
    assert!(bare.contains("holds no polygon mesh; export the mesh itself as FBX"), "{bare}");
    let cut = error(&CUBE[..CUBE.find("UVIndex").unwrap()]);
    assert!(cut.contains("is not whole") && cut.contains("copy or export it again"), "{cut}");
    let far = error(&CUBE.replace("a: 0,3,2,-2,", "a: 0,3,20,-2,"));
    assert!(far.contains("is not whole") && far.contains("a number in it"), "{far}");
    let long = CUBE.replace(
        "\"LocalStop\", \"KTime\", \"Time\", \"\",46186158000",
        "\"LocalStop\", \"KTime\", \"Time\", \"\",461861580000000",
    );
    let error = message(open_frames_bytes(CacheFormat::Fbx, Path::new("a.fbx"), long.as_bytes(), 13));
    assert!(error.contains("promises 240001 frames"), "{error}");
    let error = message(open_frames_bytes(CacheFormat::Fbx, Path::new("a.fbx"), CUBE.as_bytes(), 9));
    assert!(error.contains("holds 2 meshes, /walker/cube (8 points) and /walker/flag (5 points)"), "{error}");
    let folder = tempdir().unwrap();
    let path = folder.path().join("new.fbx");
    let error = message(create_frames(&path, 1, 1, &Default::default(), &Default::default()));
    assert!(error.contains("is not a format of frames that is written"), "{error}");
}

#[test]
fn copies_of_a_mesh_are_parts_of_their_own() {
    let copy = "}
Connections:  {
	C: \"OO\",203,200
	C: \"OO\",100,203
	C: \"OO\",301,203
	C: \"OO\",300,203
";
    let node = "\tModel: 203, \"Model::copy\", \"Mesh\" {
		Version: 232
		Properties70:  {
			P: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\",0,0,7
		}
	}
";
    let text = CUBE.replace("}\nConnections:  {\n", &(node.to_owned() + copy));
    let model = read(&text).unwrap().model;
    let names: Vec<_> = model.surface.parts.iter().map(|part| part.path.as_str()).collect();
    assert_eq!(names, ["/walker/cube", "/walker/flag", "/walker/copy"]);
    assert_eq!((model.points.len(), model.points[13 + 7]), (21, [0.0, 1.0, 8.0]));
    // With materials of its own.
    assert_eq!(model.surface.parts[2].materials, [1, 1, 1, 0, 0, 0]);
}

/// A record of a binary file: its name, its properties and the records in it.
fn record(start: usize, name: &str, properties: &[&[u8]], inner: &dyn Fn(usize) -> Vec<u8>) -> Vec<u8> {
    let all = properties.concat();
    let head = 13 + name.len();
    let mut within = inner(start + head + all.len());
    if !within.is_empty() {
        within.extend([0; 13]);
    }
    let end = (start + head + all.len() + within.len()) as u32;
    let sizes = [end, properties.len() as u32, all.len() as u32].map(u32::to_le_bytes).concat();
    [sizes, vec![name.len() as u8], name.as_bytes().to_vec(), all, within].concat()
}

/// A mesh of so many zeros, packed.
fn binary(zeros: usize) -> Vec<u8> {
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(&vec![0; 8 * zeros]).unwrap();
    let packed = packer.finish().unwrap();
    let sizes = [zeros as u32, 1, packed.len() as u32].map(u32::to_le_bytes).concat();
    let vertices = [b"d".to_vec(), sizes, packed].concat();
    let corners = [b"i".to_vec(), [3, 0, 12, 0, 1, (-3_i32) as u32].map(u32::to_le_bytes).concat()].concat();
    let string = |text: &str| [b"S".to_vec(), (text.len() as u32).to_le_bytes().to_vec(), text.into()].concat();
    let number = |number: i64| [b"L".to_vec(), number.to_le_bytes().to_vec()].concat();
    let nothing = |_| Vec::new();
    let mesh = |start| {
        let mut all = record(start, "Vertices", &[&vertices], &nothing);
        all.extend(record(start + all.len(), "PolygonVertexIndex", &[&corners], &nothing));
        all
    };
    let objects = |start| {
        let kind = |name: &str, class: &str| string(&format!("{name}\0\u{1}{class}"));
        let geometry = [number(100), kind("m", "Geometry"), string("Mesh")];
        let mut all = record(start, "Geometry", &geometry.each_ref().map(Vec::as_slice), &mesh);
        let model = [number(200), kind("m", "Model"), string("Mesh")];
        all.extend(record(start + all.len(), "Model", &model.each_ref().map(Vec::as_slice), &nothing));
        all
    };
    let connections = |start| {
        let mut all = Vec::new();
        for [from, to] in [[200, 0], [100, 200]] {
            let ends = [string("OO"), number(from), number(to)];
            all.extend(record(start + all.len(), "C", &ends.each_ref().map(Vec::as_slice), &nothing));
        }
        all
    };
    let mut file = [b"Kaydara FBX Binary  \0\x1a\0".to_vec(), 7400_u32.to_le_bytes().to_vec()].concat();
    file.extend(record(file.len(), "Objects", &[], &objects));
    file.extend(record(file.len(), "Connections", &[], &connections));
    file.extend([0; 13]);
    file
}

#[test]
fn a_file_that_unpacks_to_far_more_than_its_size_is_refused() {
    let read = |zeros| read_mesh_bytes(MeshFormat::Fbx, Path::new("a.fbx"), &binary(zeros));
    assert_eq!(read(9).unwrap().model.points, [[0.0; 3]; 3]);
    assert_eq!(read(300_000).unwrap().model.points.len(), 100_000);
    let error = message(read(9_000_000));
    assert!(error.contains("takes more than 33 MiB, far more than its size"), "{error}");
}

#[test]
fn a_character_of_blender_comes_whole() {
    let Some(folder) = character("robin.fbx") else { return };
    let truth = arrays(&folder.join("truth.npz"));
    let told: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("truth.json")).unwrap()).unwrap();
    let path = folder.join("robin.fbx");
    let ReadModel { model, units, note, dropped } = read_mesh(&path, &[]).unwrap();
    assert_eq!((note, dropped), (None, Default::default()));
    model.surface.check(model.points.len(), &model.faces).unwrap();
    let parts: Vec<_> = model.surface.ranges(&model.faces).collect();
    assert_eq!(parts.len(), 8);
    let of = |part: &Part, what: &str| &truth[&format!("{}|{what}", part.path.rsplit('/').next().unwrap())];
    for (part, range) in &parts {
        let faces = range.local(&model.faces);
        let arities: Vec<f64> = faces.arities().iter().map(|&arity| arity.into()).collect();
        assert_eq!(arities, *of(part, "counts"), "{}", part.path);
        let indices: Vec<f64> = faces.indices().iter().map(|&index| index.into()).collect();
        assert_eq!(indices, *of(part, "indices"), "{}", part.path);
        for set in &part.uv_sets {
            let expected = of(part, &format!("uv|{}", set.name)).as_chunks::<2>().0;
            assert_eq!(expected.len(), set.corners.len());
            let apart = |(&corner, [u, v]): (&u32, &[f64; 2])| {
                let found = set.values[corner as usize];
                (f64::from(found[0]) - u).abs().max((f64::from(found[1]) - v).abs())
            };
            assert!(
                set.corners.iter().zip(expected).map(apart).fold(0.0, f64::max) < 1e-6,
                "{} {}",
                part.path,
                set.name
            );
        }
        for set in &part.color_sets {
            let expected = of(part, &format!("colour|{}", set.name)).as_chunks::<4>().0;
            for (&corner, expected) in set.corners.iter().zip(expected) {
                let found = set.values[corner as usize];
                assert!((0..4).all(|k| (f64::from(found[k]) - expected[k]).abs() < 1e-4), "{found:?} {expected:?}");
            }
        }
        let info =
            told["parts"].as_array().unwrap().iter().find(|info| part.path.ends_with(info["name"].as_str().unwrap()));
        let info = info.unwrap();
        assert_eq!(part.uv_sets.len(), info["uv_sets"].as_array().unwrap().len());
        assert_eq!(part.color_sets.len(), info["colours"].as_array().unwrap().len());
        for (&found, &expected) in part.materials.iter().zip(of(part, "material")) {
            let name = &model.surface.materials[found as usize].name;
            assert_eq!(info["materials"][expected as usize], name.as_str());
        }
        // Blender writes the squares of its creases.
        let mut creases: Vec<_> = part.creases.iter().map(|crease| (crease.edge, crease.sharpness)).collect();
        let expected = of(part, "crease").as_chunks::<3>().0;
        let mut expected: Vec<_> =
            expected.iter().map(|[a, b, c]| ([*a as u32, *b as u32], (10.0 * c * c) as f32)).collect();
        creases.sort_by_key(|crease| crease.0);
        expected.sort_by_key(|crease| crease.0);
        assert_eq!(creases, expected, "{}", part.path);
    }
    let hair = model.surface.materials.iter().find(|material| material.name == "hair").unwrap();
    let pictures: Vec<_> = hair.textures.iter().map(|texture| (texture.channel, texture.path.as_str())).collect();
    let [base, rough] = ["textures/hair_base.png", "textures/hair_rough.png"];
    assert_eq!(pictures, [(Channel::BaseColor, base), (Channel::Opacity, base), (Channel::Roughness, rough)]);

    let mut reader = open_frames(&path, model.points.len()).unwrap();
    assert_eq!((reader.frames(), reader.number(0), reader.frame_rate()), (24, 1001.0, Some(24.0)));
    let (scale, mut frame, mut worst) = (units.metres_per_unit.unwrap(), Vec::new(), 0.0_f64);
    let ends = [f64::min, f64::max]
        .map(|pick| [0, 1, 2].map(|axis| model.points.iter().map(|point| point[axis]).reduce(pick).unwrap()));
    let diagonal = (0..3).map(|axis| (ends[1][axis] - ends[0][axis]).powi(2)).sum::<f64>().sqrt() * scale;
    for k in 0..24 {
        assert!(reader.read_next(&mut frame).unwrap());
        for (part, range) in &parts {
            let all = of(part, "positions_m_yup");
            let count = 3 * part.points;
            let expected = &all[k * count..(k + 1) * count];
            let found = &frame[3 * range.points.start..3 * range.points.end];
            worst = found
                .iter()
                .zip(expected)
                .map(|(found, expected)| (scale * found - expected).abs())
                .fold(worst, f64::max);
        }
    }
    assert!(worst < 1e-6 * diagonal, "{worst} of {diagonal}");
}
