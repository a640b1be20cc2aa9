//! Cages that cannot be used.

use super::refused;
use crate::support::{Dir, ENCODE, as_model};
use cager_geometry::mesh::{Model, TriMesh};

/// Writes a changed cage and expects its refusal.
#[track_caller]
fn refused_cage(change: impl FnOnce(&mut TriMesh) -> Vec<String>) {
    let (dir, mut small) = Dir::with_capture();
    let words = change(&mut small.cage);
    dir.model("cage.obj", &as_model(&small.cage));
    let words: Vec<&str> = std::iter::once("cage.obj").chain(words.iter().map(String::as_str)).collect();
    refused(&dir, &format!("{ENCODE} --report report.json"), &words);
}

fn edge(a: u32, b: u32) -> String {
    format!("{}–{}", a.min(b), a.max(b))
}

#[test]
fn open_cage_is_refused_with_its_boundary_edges() {
    refused_cage(|cage| {
        let [a, b, c] = cage.triangles.remove(7);
        vec!["open".into(), "3 edges".into(), edge(a, b), edge(b, c), edge(c, a)]
    });
}

#[test]
fn inward_cage_is_refused_with_the_offer_to_flip_it_which_works() {
    let (dir, small) = Dir::with_capture();
    dir.cager(ENCODE).succeeds();
    let good = dir.read("out.cager");
    std::fs::remove_file(dir.path("out.cager")).expect("removed");
    dir.model("cage.obj", &as_model(&small.cage.clone().flipped()));
    refused(&dir, ENCODE, &["cage.obj", "inwards", "--flip-cage"]);
    dir.cager(&format!("{ENCODE} --flip-cage")).succeeds();
    assert!(dir.read("out.cager") == good, "a cage flipped back is another cage");
    dir.model("cage.obj", &as_model(&small.cage));
    std::fs::remove_file(dir.path("out.cager")).expect("removed");
    refused(&dir, &format!("{ENCODE} --flip-cage"), &["cage.obj", "inwards", "leave out --flip-cage"]);
}

#[test]
fn inconsistently_oriented_cage_is_refused_with_the_faces_and_their_edge() {
    refused_cage(|cage| {
        cage.triangles[5].swap(1, 2);
        vec!["face".into(), " 5 ".into(), "edge".into(), "same direction".into()]
    });
}

#[test]
fn one_inward_part_of_a_cage_is_refused_with_a_vertex_of_it() {
    refused_cage(|cage| {
        let n = cage.vertices.len() as u32;
        let far: Vec<_> = cage.vertices.iter().map(|v| [v[0] + 10.0, v[1], v[2]]).collect();
        let inward: Vec<_> = cage.triangles.iter().map(|t| [t[0] + n, t[2] + n, t[1] + n]).collect();
        cage.vertices.extend(far);
        cage.triangles.extend(inward);
        vec!["vertex".into(), "inwards".into()]
    });
}

#[test]
fn non_manifold_edge_is_refused_with_its_faces() {
    refused_cage(|cage| {
        let [a, b, _] = cage.triangles[3];
        let tip = cage.vertices.len() as u32;
        cage.vertices.push([9.0, 9.0, 9.0]);
        cage.triangles.push([a, b, tip]);
        vec![edge(a, b), "3 faces".into(), cage.triangles.len().saturating_sub(1).to_string()]
    });
}

#[test]
fn duplicate_faces_are_refused_with_both() {
    refused_cage(|cage| {
        cage.triangles.push(cage.triangles[4]);
        vec![format!("faces 4 and {}", cage.triangles.len() - 1)]
    });
}

#[test]
fn degenerate_triangle_is_refused_with_its_face_and_vertices() {
    refused_cage(|cage| {
        let [a, _, c] = cage.triangles[9];
        cage.vertices[c as usize] = cage.vertices[a as usize];
        let first = cage.triangles.iter().position(|t| t.contains(&a) && t.contains(&c)).expect("a face");
        vec![format!("face {first} "), "no area".into(), a.to_string(), c.to_string()]
    });
    refused_cage(|cage| {
        let [a, b, _] = cage.triangles[9];
        cage.triangles[9] = [a, b, b];
        vec!["face 9".into(), "no area".into()]
    });
}

#[test]
fn loose_vertex_and_too_small_cages_are_refused() {
    refused_cage(|cage| {
        cage.vertices.push([0.0; 3]);
        vec![format!("vertex {}", cage.vertices.len() - 1)]
    });
    refused_cage(|cage| {
        cage.triangles.truncate(1);
        vec!["1 faces".into(), "at least 4".into()]
    });
}

#[test]
fn cage_without_faces_is_refused() {
    let (dir, small) = Dir::with_capture();
    dir.model("cage.ply", &Model { points: small.cage.vertices, ..Model::default() });
    refused(
        &dir,
        "encode --rest rest.obj --cage cage.ply --frames frames.npy -o out.cager --overwrite",
        &["cage.ply", "no faces"],
    );
}
