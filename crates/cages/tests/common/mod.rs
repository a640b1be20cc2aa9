//! Models for tests, and a check of cages by another library than the one that made them.
#![allow(dead_code, unreachable_pub)]

use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{TriMesh as ParryMesh, TriMeshFlags};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The folder with captures, `CAGER_CAPTURES` or `shared/data` beside the repository.
pub fn data() -> PathBuf {
    std::env::var_os("CAGER_CAPTURES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from)
}

/// Every model of the data, by name.
pub fn models(data: &Path) -> Vec<(String, Model)> {
    let captures = ["horse-gallop", "samba", "chickenCrossing", "makehuman-cmu-walk", "supercages-arm"];
    let pairs = ["cagelabweb_armadillo", "pgc_hand", "pgc_octopus", "qmvc_beast", "qmvc_ogre"];
    let invalid = ["deepcage_tpose", "nested_gargo", "pgc_elephant"];
    let mut files: Vec<String> = captures.iter().map(|c| format!("{c}/rest.obj")).collect();
    files.extend(pairs.iter().map(|p| format!("pairs/{p}/mesh.obj")));
    files.push("deformed/armadillo/armadilloman.obj".to_owned());
    files.extend(invalid.iter().map(|p| format!("invalid/{p}/mesh.obj")));
    files.into_iter().map(|file| (file.clone(), read_obj(&data.join(&file)))).collect()
}

/// Points and faces of an OBJ file.
pub fn read_obj(path: &Path) -> Model {
    let mut model = Model::default();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let x: Vec<f64> = words.take(3).map(|w| w.parse().unwrap()).collect();
                model.points.push([x[0], x[1], x[2]]);
            }
            Some("f") => {
                let corner = |w: &str| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                model.faces.push(&words.map(corner).collect::<Vec<_>>());
            }
            _ => {}
        }
    }
    model
}

/// Frames of so many points each, from a NumPy file of single precision.
pub fn read_npy(path: &Path, points: usize) -> Vec<Vec<f64>> {
    let bytes = std::fs::read(path).unwrap();
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values: Vec<f64> =
        bytes[header..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()).into()).collect();
    values.chunks_exact(3 * points).map(<[f64]>::to_vec).collect()
}

/// What another library says about a cage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Edges without exactly one face on either side.
    pub bad_edges: usize,
    /// Vertices whose faces are not one fan.
    pub bad_vertices: usize,
    /// Connected parts.
    pub components: usize,
    /// Signed volume is positive.
    pub outwards: bool,
    /// Pairs of faces that intersect.
    pub cuts: usize,
    /// Points of the model outside.
    pub outside: usize,
    /// Least distance from a point to the cage, as a fraction of the model's diagonal.
    pub clearance: f64,
}

impl Verdict {
    /// Whether the cage is closed, outward, free of self-intersection and encloses, with so many components.
    pub fn is_valid(&self, components: usize) -> bool {
        self.bad_edges == 0
            && self.bad_vertices == 0
            && self.components == components
            && self.outwards
            && self.cuts == 0
            && self.outside == 0
    }
}

/// Checks a cage with parry3d.
pub fn verdict(cage: &TriMesh, model: &Model) -> Verdict {
    let vector = |p: &Point| Vector::new(p[0], p[1], p[2]);
    let vertices: Vec<Vector> = cage.vertices.iter().map(vector).collect();
    let mesh = ParryMesh::with_flags(
        vertices.clone(),
        cage.triangles.clone(),
        TriMeshFlags::ORIENTED | TriMeshFlags::HALF_EDGE_TOPOLOGY,
    );
    let topology = topology(cage);
    let Ok(mesh) = mesh else { return Verdict { bad_edges: usize::MAX, ..topology } };
    let extent = diagonal(&model.points);
    let mut clearance = f64::INFINITY;
    let mut outside = 0;
    for p in &model.points {
        let projection = mesh.project_local_point(vector(p), false);
        outside += usize::from(!projection.is_inside);
        clearance = clearance.min((projection.point - vector(p)).length() / extent);
    }
    Verdict { cuts: cuts(cage, &vertices), outside, clearance, ..topology }
}

fn topology(cage: &TriMesh) -> Verdict {
    let mut edges: HashMap<(u32, u32), usize> = HashMap::new();
    let mut fans: HashMap<u32, HashMap<u32, u32>> = HashMap::new();
    let mut volume = 0.0;
    for &[a, b, c] in &cage.triangles {
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            *edges.entry((p, q)).or_default() += 1;
            fans.entry(p).or_default().insert(q, r);
        }
        let [a, b, c] = [a, b, c].map(|v| cage.vertices[v as usize]);
        volume += a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    let bad_edges = edges.iter().filter(|(e, n)| **n != 1 || edges.get(&(e.1, e.0)) != Some(&1)).count();
    let one_fan = |fan: &HashMap<u32, u32>| {
        let first = *fan.keys().next().unwrap();
        let mut at = first;
        let mut steps = 0;
        while let Some(&next) = fan.get(&at) {
            (at, steps) = (next, steps + 1);
            if at == first || steps > fan.len() {
                break;
            }
        }
        steps == fan.len() && at == first
    };
    let bad_vertices = cage.vertices.len() - fans.values().filter(|f| one_fan(f)).count();
    let mut part: Vec<u32> = (0..cage.vertices.len() as u32).collect();
    fn find(part: &mut [u32], mut v: u32) -> u32 {
        while part[v as usize] != v {
            part[v as usize] = part[part[v as usize] as usize];
            v = part[v as usize];
        }
        v
    }
    for &[a, b, c] in &cage.triangles {
        for v in [b, c] {
            let (p, q) = (find(&mut part, a), find(&mut part, v));
            part[q as usize] = p;
        }
    }
    let components = (0..part.len()).filter(|&v| find(&mut part, v as u32) == v as u32).count();
    Verdict { bad_edges, bad_vertices, components, outwards: volume > 0.0, ..Verdict::default() }
}

/// Pairs of faces without a common vertex that intersect, by parry's intersection of triangles.
fn cuts(cage: &TriMesh, vertices: &[Vector]) -> usize {
    use parry3d_f64::math::Pose;
    use parry3d_f64::query::intersection_test;
    use parry3d_f64::shape::Triangle;
    let triangle =
        |t: &[u32; 3]| Triangle::new(vertices[t[0] as usize], vertices[t[1] as usize], vertices[t[2] as usize]);
    let triangles: Vec<Triangle> = cage.triangles.iter().map(triangle).collect();
    let boxes: Vec<_> = triangles.iter().map(Triangle::local_aabb).collect();
    let mut cuts = 0;
    for i in 0..triangles.len() {
        for j in 0..i {
            let shared = cage.triangles[i].iter().any(|v| cage.triangles[j].contains(v));
            let meet = || intersection_test(&Pose::IDENTITY, &triangles[i], &Pose::IDENTITY, &triangles[j]);
            if !shared && overlaps(&boxes[i], &boxes[j]) && meet().map_or(true, |m| m.intersecting) {
                cuts += 1;
            }
        }
    }
    cuts
}

fn overlaps(a: &parry3d_f64::bounding_volume::Aabb, b: &parry3d_f64::bounding_volume::Aabb) -> bool {
    (0..3).all(|k| a.mins[k] <= b.maxs[k] && b.mins[k] <= a.maxs[k])
}

/// Appends a mesh to a model.
pub fn append(model: &mut Model, mesh: &TriMesh) {
    let shift = model.points.len() as u32;
    model.points.extend(&mesh.vertices);
    mesh.triangles.iter().for_each(|t| model.faces.push(&t.map(|v| v + shift)));
}

/// A model of one mesh.
pub fn model(mesh: &TriMesh) -> Model {
    let mut model = Model::default();
    append(&mut model, mesh);
    model
}

/// A sphere of latitudes and longitudes.
pub fn sphere(center: Point, radius: f64, rows: u32) -> TriMesh {
    revolved(
        rows,
        |s| {
            let angle = s * std::f64::consts::PI;
            [radius * angle.sin(), radius * angle.cos()]
        },
        center,
    )
}

/// A closed surface swept around z by a profile `s` in 0..=1 → radius and height that begins and ends on the axis.
pub fn revolved(rows: u32, profile: impl Fn(f64) -> [f64; 2], center: Point) -> TriMesh {
    let columns = 2 * rows;
    let at = |s: f64, angle: f64| {
        let [r, z] = profile(s);
        [center[0] + r * angle.cos(), center[1] + r * angle.sin(), center[2] + z]
    };
    let mut mesh = TriMesh { vertices: vec![at(0.0, 0.0)], triangles: Vec::new() };
    for i in 1..rows {
        let turns = (0..columns).map(|j| std::f64::consts::TAU * f64::from(j) / f64::from(columns));
        mesh.vertices.extend(turns.map(|angle| at(f64::from(i) / f64::from(rows), angle)));
    }
    mesh.vertices.push(at(1.0, 0.0));
    let last = mesh.vertices.len() as u32 - 1;
    let index = |i: u32, j: u32| 1 + (i - 1) * columns + j % columns;
    for j in 0..columns {
        mesh.triangles.push([0, index(1, j), index(1, j + 1)]);
        mesh.triangles.push([last, index(rows - 1, j + 1), index(rows - 1, j)]);
        for i in 1..rows - 1 {
            mesh.triangles.push([index(i, j), index(i + 1, j), index(i + 1, j + 1)]);
            mesh.triangles.push([index(i, j), index(i + 1, j + 1), index(i, j + 1)]);
        }
    }
    mesh
}

/// A torus around an axis of space.
pub fn torus(center: Point, radius: f64, tube: f64, axis: usize) -> TriMesh {
    torus_of([40, 16], center, radius, tube, axis)
}

/// The same of so many points along it and around it.
pub fn torus_of([n, m]: [u32; 2], center: Point, radius: f64, tube: f64, axis: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = [(i, n), (j, m)].map(|(k, of)| std::f64::consts::TAU * f64::from(k) / f64::from(of)).into();
            let mut p = center;
            p[(axis + 1) % 3] += (radius + tube * b.cos()) * a.cos();
            p[(axis + 2) % 3] += (radius + tube * b.cos()) * a.sin();
            p[axis] += tube * b.sin();
            mesh.vertices.push(p);
        }
    }
    let index = |i: u32, j: u32| i % n * m + j % m;
    for i in 0..n {
        for j in 0..m {
            mesh.triangles.push([index(i, j), index(i + 1, j), index(i + 1, j + 1)]);
            mesh.triangles.push([index(i, j), index(i + 1, j + 1), index(i, j + 1)]);
        }
    }
    mesh
}
