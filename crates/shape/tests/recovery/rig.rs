//! Rigs: placed in templates, enclosing them, to files and back.

use crate::common::{capture, there};
use cager_core::cage::Cage;
use cager_geometry::mesh::{Point, TriMesh};
use cager_shape::people::rig::{PlacedRig, PlacementOptions, Rig, RigError, place};

const PEOPLE: [(&str, usize, Point); 3] = [
    ("makehuman-cmu-walk", 1, [0.0, 1.0, 0.0]),
    ("anny-man-02_02", 2, [0.0, 0.0, 1.0]),
    ("anny-heavywoman-02_02", 2, [0.0, 0.0, 1.0]),
];

#[test]
#[ignore = "needs the captures: make captures"]
fn a_rig_is_placed_in_people_of_any_size_and_encloses_them() {
    for (name, axis, up) in PEOPLE {
        if !there(&format!("{name}/rest.obj")) {
            continue;
        }
        let rest = capture(name, axis).rest;
        for scale in [1.0, 100.0] {
            let vertices = rest.vertices.iter().map(|p| p.map(|x| x * scale)).collect();
            let template = TriMesh { vertices, triangles: rest.triangles.clone() };
            let PlacedRig { rig, enclosure } =
                place(&template, &PlacementOptions { up, ..Default::default() }).unwrap();
            eprintln!(
                "{name}: {} of {} points outside, at most {:.2} % of the height; corners moved {:.1} %; looks along {:?}",
                enclosure.outside.len(),
                template.vertices.len(),
                100.0 * enclosure.farthest,
                100.0 * enclosure.moved,
                rig.forward
            );
            let cage = Cage::new(rig.cage()).unwrap();
            assert_eq!((cage.vertices().len(), cage.faces().len()), (86, 168));
            assert!(enclosure.outside.is_empty(), "{name}: {enclosure:?}");
            let forward = if axis == 1 { [0.0, 0.0, 1.0] } else { [0.0, -1.0, 0.0] };
            assert!((0..3).all(|k| (rig.forward[k] - forward[k]).abs() < 1e-9));
            let again = Rig::from_json(rig.to_json().as_bytes()).unwrap();
            assert_eq!(again, rig);
        }
    }
}

#[test]
fn what_is_wrong_with_a_rig_file_is_named() {
    let quad = r#"{"name":"tail","joint":[0,0,0],"corners":[[0,0,0],[0,0,0],[0,0,0],[0,0,0]]}"#;
    let file =
        |quads: &str| format!(r#"{{"up":[0,1,0],"forward":[0,0,1],"crotch":[[0,0,0],[0,0,0]],"quads":[{quads}]}}"#);
    let read = |text: &str| Rig::from_json(text.as_bytes()).unwrap_err();
    assert_eq!(read(&file(quad)), RigError::UnknownQuad("tail".to_owned()));
    let waist = quad.replace("tail", "waist");
    assert_eq!(read(&file(&format!("{waist},{waist}"))), RigError::RepeatedQuad("waist".to_owned()));
    assert_eq!(read(&file(&waist)), RigError::MissingQuad("pelvis"));
    assert!(matches!(read("{}"), RigError::Syntax(_)));
    let ball = TriMesh { vertices: vec![[0.0; 3]; 4], triangles: vec![[0, 1, 2]] };
    assert!(matches!(
        place(&ball, &PlacementOptions::default()).unwrap_err(),
        RigError::NoSurface { points: 4, faces: 1 }
    ));
    let ball = TriMesh { vertices: vec![[0.0; 3]; 100], triangles: vec![[0, 1, 2]; 100] };
    let upwards = PlacementOptions { forward: Some([0.0, -1.0, 0.0]), ..Default::default() };
    assert!(matches!(place(&ball, &upwards).unwrap_err(), RigError::ForwardIsUp));
}
