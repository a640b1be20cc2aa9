//! What `transfer` cannot use: one sentence each, and nothing left behind.

use super::{TRANSFER, with_copy};
use crate::refused::{assert_sentence, refused};
use crate::support::{Dir, as_model, npy_f64, polygons, quad_box};
use cager_geometry::mesh::{Model, Point};

fn with(from: &str, to: &str) -> String {
    TRANSFER.replace(from, to)
}

#[test]
fn files_that_are_missing_or_named_twice() {
    let (dir, ..) = with_copy();
    refused(&dir, &with("copy.obj", "none.obj"), &["none.obj"]);
    refused(&dir, &with("frames.npy", "none.npy"), &["none.npy"]);
    refused(&dir, "transfer --source none.cager --target copy.obj -o moved.cager", &["none.cager"]);
    refused(&dir, &format!("{} --overwrite", with("moved.cager", "copy.obj")), &["copy.obj", "input"]);
    refused(&dir, &format!("{TRANSFER} --report moved.cager"), &["moved.cager", "two outputs"]);
    let unsaid = dir.cager("transfer --target copy.obj -o moved.cager").run();
    assert_eq!(unsaid.status, Some(2), "{}", unsaid.stderr);
}

#[test]
fn frames_of_another_model_and_frames_that_are_broken() {
    let (dir, small, _) = with_copy();
    let few: Vec<Vec<f64>> = small.frames.iter().map(|frame| frame[3..].to_vec()).collect();
    dir.write("few.npy", npy_f64(&few));
    refused(&dir, &with("frames.npy", "few.npy"), &["few.npy", "points"]);
    let mut broken = small.frames.clone();
    broken[4][10] = f64::NAN;
    dir.write("broken.npy", npy_f64(&broken));
    refused(&dir, &with("frames.npy", "broken.npy"), &["broken.npy", "frame 4", "NaN"]);
    dir.model("walk/0001.obj", &small.posed(0));
    dir.model("walk/0002.obj", &Model { points: few[1].as_chunks().0.to_vec(), ..Model::default() });
    let n = small.rest.points.len();
    let counts = [format!("{} points", n - 1), n.to_string()];
    refused(&dir, &with("frames.npy", "walk"), &["0002.obj", &counts[0], &counts[1]]);
    let larger: Vec<Vec<f64>> = small.frames.iter().map(|f| f.iter().map(|x| 1000.0 * x).collect()).collect();
    dir.write("mm.npy", npy_f64(&larger));
    refused(&dir, &with("frames.npy", "mm.npy"), &["mm.npy", "1000", "--force"]);
    dir.model("cloud.obj", &Model { points: small.rest.points.clone(), ..Model::default() });
    refused(&dir, &with("rest.obj", "cloud.obj"), &["cloud.obj", "faces"]);
}

#[test]
fn cages_that_are_open_lie_elsewhere_or_leave_points_outside() {
    let (dir, small, copy) = with_copy();
    let mut open = as_model(&small.cage);
    open.faces = polygons(small.cage.triangles[1..].iter().map(|t| t.to_vec()));
    dir.model("open.obj", &open);
    for method in ["fitted", "public", "rigid"] {
        refused(&dir, &format!("{TRANSFER} --method {method} --cage open.obj"), &["open.obj", "edge"]);
    }
    let apart = |p: &Point| p.map(|x| x + 500.0);
    dir.model("apart.obj", &Model { points: small.cage.vertices.iter().map(apart).collect(), ..as_model(&small.cage) });
    refused(&dir, &format!("{TRANSFER} --cage apart.obj"), &["apart.obj", "outside"]);

    let shrunk = small.shrunk_cage();
    dir.model("small.obj", &as_model(&shrunk));
    let outside = cager_geometry::spatial::outside(&shrunk, &small.rest.points);
    let (count, first) = (format!("{} points", outside.len()), outside[0].0.to_string());
    for system in ["green", "harmonic"] {
        let line = format!("{TRANSFER} --method public --cage small.obj --coordinates {system}");
        refused(&dir, &line, &["rest.obj", &count, &first, "outside", system]);
    }
    // The source inside, and the target not.
    let mut lone = copy.clone();
    lone.points[700] = lone.points[700].map(|x| x + 50.0);
    dir.model("copy.obj", &lone);
    for system in ["green", "harmonic"] {
        let line = format!("{TRANSFER} --method public --cage cage.obj --coordinates {system}");
        refused(&dir, &line, &["copy.obj", "1 point", "700", "outside", system]);
    }
}

#[test]
fn a_cage_that_the_source_does_not_determine() {
    let dir = Dir::new();
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|k: u32| [k & 1, k >> 1 & 1, k >> 2 & 1].map(f64::from));
    dir.model("box.obj", &quad_box(&corners));
    let pose = quad_box(&corners).points.as_flattened().to_vec();
    dir.write("frames.npy", npy_f64(&[pose.clone(), pose]));
    let line = "transfer --source-rest box.obj --source-frames frames.npy --target box.obj -o moved.cager --align none";
    for method in ["public", "rigid"] {
        refused(&dir, &format!("{line} --method {method}"), &["box.obj", "8 of the 162", "coarser"]);
    }
}

#[test]
fn a_target_that_cannot_be_reached() {
    let (dir, _, copy) = with_copy();
    let place = |p: &Point| p.map(|x| 0.02 * x + 9.0);
    dir.model("far.obj", &Model { points: copy.points.iter().map(place).collect(), ..copy.clone() });
    refused(&dir, &with("copy.obj", "far.obj"), &["far.obj", "cannot be laid onto", "%"]);
}

#[test]
fn points_in_one_place_and_edges_without_length_are_moved_or_refused_by_the_file() {
    let (dir, small, copy) = with_copy();
    let spoilt = |model: &Model| {
        let mut points = model.points.clone();
        points[11] = points[10];
        let mut faces = polygons(model.faces.iter().map(<[u32]>::to_vec));
        faces.push(&[10, 11, 12]);
        points.push(points[20]);
        Model { points, faces, ..Model::default() }
    };
    dir.model("target.obj", &spoilt(&copy));
    dir.cager(&with("copy.obj", "target.obj")).succeeds();
    dir.model("source.obj", &spoilt(&small.rest));
    let double = |f: &Vec<f64>| [&f[..33], &f[30..33], &f[36..], &f[60..63]].concat();
    dir.write("source.npy", npy_f64(&small.frames.iter().map(double).collect::<Vec<_>>()));
    dir.cager(&format!("{} --overwrite", with("rest.obj", "source.obj").replace("frames.npy", "source.npy")))
        .succeeds();
    let flat = Model { points: vec![[0.0, 0.0, 1.0]; copy.points.len()], ..copy };
    dir.model("point.obj", &flat);
    refused(&dir, &format!("{} --overwrite", with("copy.obj", "point.obj")), &["point.obj"]);
}

#[test]
fn pairs_that_are_none() {
    let (dir, small, copy) = with_copy();
    let line = format!("{TRANSFER} --pairs pairs.txt");
    refused(&dir, &line, &["pairs.txt"]);
    let n = small.rest.points.len();
    for (text, words) in [
        ("0 1\n# a comment\n2\n".to_owned(), ["line 3", "a vertex of the source and one of the target"]),
        ("0 1 2\n".to_owned(), ["line 1", "a vertex of the source and one of the target"]),
        ("0 nose\n".to_owned(), ["line 1", "\"nose\""]),
        ("0 -1\n".to_owned(), ["line 1", "\"-1\""]),
        (format!("1 1\n{n} 0\n"), ["line 2", "no vertex 600 in the source"]),
        (format!("1 {}\n", copy.points.len()), ["line 1", "no vertex 1221 in the target"]),
        ("# nothing\n".to_owned(), ["no pairs", "leave the pairs out"]),
    ] {
        dir.write("pairs.txt", &text);
        let words = words.map(|word| word.replace("600", &n.to_string()));
        refused(&dir, &line, &["pairs.txt", &words[0], &words[1]]);
    }
}

#[test]
fn options_of_another_method() {
    let (dir, ..) = with_copy();
    for option in ["--public ico", "--coordinates mvc", "--detail", "--rigidity 0.1"] {
        let name = option.split(' ').next().expect("a name");
        refused(&dir, &format!("{TRANSFER} {option}"), &[name, "--method"]);
    }
    refused(&dir, &format!("{TRANSFER} --method public --pose relative"), &["--pose", "--method fitted"]);
    dir.write("pairs.txt", "1 1\n");
    refused(&dir, &format!("{TRANSFER} --method rigid --pairs pairs.txt"), &["--pairs", "--method fitted"]);
    refused(&dir, &format!("{TRANSFER} --method public --rigidity 1"), &["--rigidity", "--method rigid"]);
    refused(&dir, &format!("{TRANSFER} --method rigid --coordinates green"), &["--coordinates", "green"]);
    for usage in ["--method best", "--rigidity -1", "--public cube", "--up w"] {
        let done = dir.cager(&format!("{TRANSFER} {usage}")).run();
        assert_eq!(done.status, Some(2), "{usage}: {}", done.stderr);
    }
    let small = dir.cager(&TRANSFER.replace("--cage-vertices 60", "--mean-error 2")).run();
    assert_sentence("--mean-error 2", &small.stderr, &["--mean-error"]);
}
