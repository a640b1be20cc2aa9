//! Shapes between poses: `explore`.

use crate::refused::refused;
use crate::support::{Dir, ENCODE, Small, as_model, measure, polygons, read_frames};
use cager_formats::{FrameOptions, Units, Up, create_frames, open_frames};
use cager_geometry::mesh::{Model, Point};

const EXPLORE: &str = "explore stand.obj sit.obj";

/// Three poses of the small capture, its cage, and all of it as `out.cager`.
fn with_poses() -> (Dir, Small) {
    let (dir, small) = Dir::with_encoded();
    for (name, frame) in [("stand.obj", 0), ("sit.obj", 7), ("turn.obj", 13)] {
        dir.model(name, &small.posed(frame));
    }
    (dir, small)
}

/// How far two frames are apart at most, as a share of the diagonal.
fn apart(small: &Small, a: &[f64], b: &[f64]) -> f64 {
    measure(&small.rest.points, &[a.to_vec()], &[b.to_vec()]).linf[0]
}

fn shape(dir: &Dir, name: &str) -> Vec<f64> {
    cager_formats::read_model(&dir.path(name)).expect("a shape").points.as_flattened().to_vec()
}

#[test]
fn a_path_leads_from_pose_to_pose_and_its_middle_has_even_weights() {
    let (dir, small) = with_poses();
    let n = small.rest.points.len();
    let said = dir.cager("explore stand.obj sit.obj turn.obj --steps 5 -o between.npy").succeeds();
    assert_eq!((said.stdout, said.stderr.as_str()), (format!("between.npy: 9 shapes of {n} points\n"), ""));
    let shapes = read_frames(&dir.path("between.npy"), n);
    for (shape, frame) in [(0, 0), (4, 7), (8, 13)] {
        let far = apart(&small, &small.frames[frame], &shapes[shape]);
        assert!(far < 1e-4, "shape {shape} is {far} from its pose");
    }
    // Between, but at neither end.
    assert!(
        (1..4).all(|k| apart(&small, &shapes[0], &shapes[k]) > 1e-3 && apart(&small, &shapes[4], &shapes[k]) > 1e-3)
    );
    let said = dir.cager(&format!("{EXPLORE} --weights 0.5,0.5 -o half.obj")).succeeds();
    assert_eq!(said.stdout, format!("half.obj: 1 shape of {n} points\n"));
    let half = cager_formats::read_model(&dir.path("half.obj")).expect("a shape");
    assert!(apart(&small, half.points.as_flattened(), &shapes[2]) < 1e-5);
    assert_eq!(half.faces, small.rest.faces);
    // Beyond the poses.
    dir.cager(&format!("{EXPLORE} --weights -0.2,1.2 -o beyond.obj")).succeeds();
    let [to, from] = [7, 0].map(|frame: usize| apart(&small, &small.frames[frame], &shape(&dir, "beyond.obj")));
    assert!(to < from, "{to} from the second pose, {from} from the first");
}

#[test]
fn each_leg_of_a_path_is_that_of_its_two_poses_alone() {
    let (dir, small) = with_poses();
    let n = small.rest.points.len();
    dir.cager("explore stand.obj sit.obj turn.obj --steps 4 -o path.npy").succeeds();
    dir.cager("explore sit.obj turn.obj --steps 4 -o second.npy").succeeds();
    let [path, second] = ["path.npy", "second.npy"].map(|name| read_frames(&dir.path(name), n));
    assert_eq!(path[3..].len(), second.len());
    for (k, (a, b)) in path[3..].iter().zip(&second).enumerate() {
        let far = apart(&small, a, b);
        assert!(far < 1e-5, "shape {k} of the second leg is {far} apart");
    }
}

#[test]
fn weights_of_several_poses_name_a_shape_among_them() {
    let (dir, small) = with_poses();
    let line = "explore stand.obj sit.obj turn.obj --overwrite -o shape.obj --weights";
    for (weights, frame) in [("1,0,0", 0), ("0,1,0", 7), ("0,0,1", 13)] {
        dir.cager(&format!("{line} {weights}")).succeeds();
        let far = apart(&small, &small.frames[frame], &shape(&dir, "shape.obj"));
        assert!(far < 1e-4, "{weights}: {far} from its pose");
    }
    dir.cager(&format!("{line} 0.4,0.3,0.3")).succeeds();
    let far = [0, 7, 13].map(|frame: usize| apart(&small, &small.frames[frame], &shape(&dir, "shape.obj")));
    let poses = apart(&small, &small.frames[0], &small.frames[7]);
    assert!(far.iter().all(|&far| 1e-3 < far && far < 2.0 * poses), "{far:?}");
}

#[test]
fn frames_of_a_container_are_poses_too() {
    let (dir, small) = with_poses();
    let n = small.rest.points.len();
    for on in ["mesh", "cage"] {
        let line = format!("explore out.cager@0 out.cager@7 --on {on} --steps 3 --overwrite -o between.npy");
        let said = dir.cager(&line).succeeds();
        assert_eq!(said.stdout, format!("between.npy: 3 shapes of {n} points\n"));
        dir.cager(&format!("{EXPLORE} --steps 3 --overwrite -o meshes.npy")).succeeds();
        let [frames, meshes] = ["between.npy", "meshes.npy"].map(|name| read_frames(&dir.path(name), n));
        let far = measure(&small.rest.points, &meshes, &frames).l2;
        assert!(far.iter().all(|&far| far < 0.01), "{on}: {far:?}");
    }
    dir.cager("explore stand.obj out.cager@7 --steps 3 -o mixed.npy").succeeds();
    refused(&dir, "explore out.cager out.cager@7 -o x.npy", &["out.cager", "holds many poses", "@12"]);
    refused(&dir, "explore out.cager@0 out.cager@20 -o x.npy", &["out.cager", "frames 0 to 19", "frame 20"]);
    refused(&dir, "explore out.cager@0 out.cager@last -o x.npy", &["out.cager@last"]);
    refused(&dir, "explore out.cager@0 none.cager@3 -o x.npy", &["none.cager"]);
    refused(&dir, "explore out.cager@0 out.cager@7 -o out.cager --overwrite", &["out.cager", "input"]);
}

#[test]
fn shapes_on_a_cage_are_near_those_on_the_mesh() {
    let (dir, small) = with_poses();
    dir.model("around.obj", &as_model(&small.cage));
    dir.cager(&format!("{EXPLORE} --steps 3 -o mesh.npy")).succeeds();
    let mesh = read_frames(&dir.path("mesh.npy"), small.rest.points.len());
    for cage in ["", " --cage around.obj"] {
        dir.cager(&format!("{EXPLORE} --steps 3 --on cage{cage} -o cage.npy --overwrite")).succeeds();
        let found = read_frames(&dir.path("cage.npy"), small.rest.points.len());
        let far = measure(&small.rest.points, &mesh, &found).l2;
        assert!(far.iter().all(|&far| far < 0.02), "{cage}: {far:?}");
    }
}

#[test]
fn shapes_have_the_unit_and_axis_of_the_first_pose_and_others_are_brought_to_it() {
    let (dir, small) = with_poses();
    let n = small.rest.points.len();
    let centimetres = Units::new(Up::Z, 0.01);
    dir.cager(&format!("{ENCODE} --unit m")).succeeds();
    let change = Units::METRES.change_to(centimetres);
    let pose: Vec<f32> = small.posed(7).points.iter().flat_map(|&p| change.apply(p)).map(|x| x as f32).collect();
    let options = FrameOptions { units: centimetres, ..FrameOptions::default() };
    let mut file = create_frames(dir.path("sit.usdc"), n, 1, &small.rest.faces, &options).expect("a pose");
    file.write_frame(&pose).expect("a pose");
    file.finish().expect("a pose");
    dir.cager(&format!("{EXPLORE} --steps 3 -o metres.npy")).succeeds();
    let metres = read_frames(&dir.path("metres.npy"), n);
    let ends = |name: &str| -> (Units, Vec<f64>) {
        let mut reader = open_frames(dir.path(name), n).expect("shapes");
        let (units, mut frame) = (reader.units(), Vec::new());
        for _ in 0..reader.frames() {
            assert!(reader.read_next(&mut frame).expect("a shape"));
        }
        (units, frame)
    };

    let line = "explore sit.usdc out.cager@0 --steps 3 --overwrite";
    for on in ["mesh", "cage --cage out.cager"] {
        let said = dir.cager(&format!("{line} --on {on} -o shapes.usdc")).succeeds();
        assert!(said.stderr.contains("out.cager@0: the pose is scaled by 100,"), "{}", said.stderr);
        assert!(said.stderr.contains("those of sit.usdc"), "{}", said.stderr);
        let (units, end) = ends("shapes.usdc");
        assert_eq!(units, centimetres);
        let long = |frame: &[f64]| cager_geometry::mesh::diagonal(frame.as_chunks::<3>().0);
        assert!((long(&end) / long(&metres[0]) / 100.0 - 1.0).abs() < 0.05, "{on}");
    }
    dir.cager("explore out.cager@0 out.cager@7 -o container.usdc").succeeds();
    assert_eq!(ends("container.usdc").0.metres_per_unit, Some(1.0));
    dir.cager("explore sit.usdc sit.usdc -o same.usdc").succeeds();
    assert_eq!(ends("same.usdc").0, centimetres);
}

#[test]
fn poses_whose_points_come_in_another_order_are_refused() {
    let (dir, small) = with_poses();
    let n = small.rest.points.len();
    let pose = small.posed(7);
    let shuffled: Vec<Point> = (0..n).map(|k| pose.points[(k * 7919 + 13) % n]).collect();
    dir.model("shuffled.obj", &Model { points: shuffled, ..pose });
    for first in ["stand.obj", "out.cager@3"] {
        let words = ["shuffled.obj", first, "points come in another order", "times longer", "export both"];
        refused(&dir, &format!("explore {first} shuffled.obj -o out.npy"), &words);
    }
}

#[test]
fn a_dry_run_writes_nothing() {
    let (dir, small) = with_poses();
    let before = dir.contents();
    for poses in ["stand.obj sit.obj", "out.cager@0 out.cager@19"] {
        let said = dir.cager(&format!("explore {poses} -o between.npy --dry-run")).succeeds();
        let n = small.rest.points.len();
        assert_eq!(said.stdout, format!("between.npy: would be written: 10 shapes of {n} points\n"));
        assert!(dir.contents() == before);
    }
}

#[test]
fn poses_and_weights_that_cannot_be_used_are_refused_by_their_names() {
    let (dir, small) = with_poses();
    refused(&dir, "explore stand.obj none.obj -o out.npy", &["none.obj"]);
    refused(&dir, &format!("{EXPLORE} -o sit.obj --overwrite"), &["sit.obj", "input"]);
    refused(&dir, &format!("{EXPLORE} --weights 0.5,0.6 -o out.obj"), &["--weights", "sum to 1.1", "not to 1"]);
    refused(&dir, &format!("{EXPLORE} --weights 0.5,0.2,0.3 -o out.obj"), &["--weights", "3 weights for 2 poses"]);
    refused(&dir, &format!("{EXPLORE} --weights 1 -o out.obj"), &["--weights", "1 weight for 2 poses"]);
    let n = small.rest.points.len();
    dir.model("few.obj", &Model { points: small.posed(1).points[1..].to_vec(), ..Model::default() });
    let counts = [format!("{} points", n - 1), n.to_string()];
    refused(&dir, "explore stand.obj few.obj -o out.npy", &["few.obj", &counts[0], &counts[1]]);
    dir.model("cloud.obj", &Model { points: small.rest.points.clone(), ..Model::default() });
    refused(&dir, "explore cloud.obj stand.obj -o out.npy", &["cloud.obj", "faces"]);
    // Faces in another order, and one face less.
    let pose = small.posed(7);
    let mut faces: Vec<Vec<u32>> = pose.faces.iter().map(<[u32]>::to_vec).collect();
    faces.swap(5, 6);
    dir.model("other.obj", &Model { faces: polygons(faces.clone()), ..pose.clone() });
    refused(&dir, "explore stand.obj other.obj -o out.npy", &["other.obj", "face 5", "stand.obj"]);
    faces.swap(5, 6);
    faces.pop();
    dir.model("open.obj", &Model { faces: polygons(faces.clone()), ..pose });
    refused(&dir, "explore stand.obj open.obj -o out.npy", &["open.obj", &format!("face {}", faces.len()), "missing"]);
    // What one mesh cannot hold.
    refused(&dir, &format!("{EXPLORE} -o out.obj"), &["out.obj", "10 shapes", "--weights", "out/"]);
    let mut cage = as_model(&small.cage);
    cage.faces = polygons(small.cage.triangles[1..].iter().map(|t| t.to_vec()));
    dir.model("open_cage.obj", &cage);
    refused(&dir, &format!("{EXPLORE} --on cage --cage open_cage.obj -o out.npy"), &["open_cage.obj", "edge"]);
    refused(&dir, &format!("{EXPLORE} --cage open_cage.obj -o out.npy"), &["--cage", "--on cage"]);
    for usage in [
        "explore stand.obj -o out.npy",
        &format!("{EXPLORE} --steps 1 -o out.npy"),
        &format!("{EXPLORE} --weights nan,1 -o o.obj"),
    ] {
        let done = dir.cager(usage).run();
        assert_eq!(done.status, Some(2), "{usage}: {}", done.stderr);
    }
}
