//! What lies on the faces of a capture goes through its container.

use crate::support::{Dir, ENCODE};
use cager_formats::read_mesh;
use cager_geometry::mesh::Model;

/// The rest pose of the small capture in a texture, with two materials and a hard edge at each face.
fn dressed() -> (Dir, Model) {
    let (dir, small) = Dir::with_capture();
    let mut text = String::from("mtllib rest.mtl\n");
    for [x, y, z] in &small.rest.points {
        text += &format!("v {x:?} {y:?} {z:?}\nvt {} {}\n", 0.37 * x, 0.41 * y - 0.1 * z);
    }
    for (k, face) in small.rest.faces.iter().enumerate() {
        text += &format!("vn 0 {k} 1\nusemtl {}\nf", if k % 7 < 3 { "skin" } else { "cloth" });
        face.iter().for_each(|&v| text += &format!(" {0}/{0}/{1}", v + 1, k + 1));
        text += "\n";
    }
    dir.write("dressed.obj", text);
    dir.write("rest.mtl", "newmtl skin\nKd 0.5 0.25 0.25\nmap_Kd skin.png\n");
    let model = read_mesh(&dir.path("dressed.obj"), &[]).expect("a mesh").model;
    (dir, model)
}

#[test]
fn texture_coordinates_materials_and_the_order_of_faces_come_back() {
    let (dir, model) = dressed();
    let line = ENCODE.replace("rest.obj", "dressed.obj");
    for options in ["", " --max-error 0.001", " --max-error 0.001 --exact-rest", " --coordinates green"] {
        assert_eq!(dir.cager(&format!("{line}{options}")).succeeds().stderr, "", "{options}");
        assert_eq!(dir.cager("decode out.cager -o back.obj --frame 3 --overwrite").succeeds().stderr, "");
        let back = read_mesh(&dir.path("back.obj"), &[]).expect("a mesh").model;
        assert_eq!(back.faces, model.faces, "{options}");
        let (found, given) = (&back.surface.parts[0], &model.surface.parts[0]);
        assert_eq!((&found.materials, &back.surface.materials), (&given.materials, &model.surface.materials));
        assert_eq!(found.uv_sets[0].corners.len(), given.uv_sets[0].corners.len());
        for (a, b) in found.uv_sets[0].corners.iter().zip(&given.uv_sets[0].corners) {
            let (a, b) = (found.uv_sets[0].values[*a as usize], given.uv_sets[0].values[*b as usize]);
            // A quarter of a texel of a picture of 8,192.
            assert!((0..2).all(|k| (a[k] - b[k]).abs() <= 0.25 / 8192.0 + 1e-6), "{a:?} {b:?}");
        }
        assert!(found.has_hard_edges(back.faces.indices()));
    }
    let said = dir.cager("decode out.cager -o flat.npy").succeeds().stdout;
    assert!(said.contains("flat.npy: has no place for texture coordinates, 2 materials and normals"), "{said}");
    // The model is enough to dress another one's motion.
    assert_eq!(dir.cager("decode out.cager --model dressed.obj -o moved/ --range 0-2").succeeds().stderr, "");
    assert!(dir.path("moved/frame.mtl").exists());
}

#[test]
fn captures_without_anything_on_their_faces_take_not_a_byte_more() {
    let (dir, _) = dressed();
    dir.cager(&format!("{ENCODE} --max-error 0.001")).succeeds();
    let plain: serde_json::Value =
        serde_json::from_str(&dir.cager("inspect out.cager --json").succeeds().stdout).expect("JSON");
    let tags: Vec<&str> =
        plain["sections"].as_array().expect("sections").iter().filter_map(|s| s["tag"].as_str()).collect();
    assert!(!tags.contains(&"surf"), "{tags:?}");
}
