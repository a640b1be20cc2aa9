//! Captures for tests.
#![allow(dead_code, unreachable_pub)]

use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::topology::UnionFind;
use std::path::{Path, PathBuf};

/// The folder with captures, `CAGER_CAPTURES` or `shared/data` beside the repository.
pub fn data() -> PathBuf {
    std::env::var_os("CAGER_CAPTURES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from)
}

/// Whether a file of the captures is there; says so where it is not.
pub fn there(name: &str) -> bool {
    let path = data().join(name);
    let there = path.exists();
    if !there {
        eprintln!("skipped: there is no {}", path.display());
    }
    there
}

/// A captured person: the rest pose and frames, of its largest connected part alone.
pub struct Capture {
    pub rest: TriMesh,
    pub frames: Vec<Vec<Point>>,
    pub height: f64,
}

pub fn capture(name: &str, up: usize) -> Capture {
    let folder = data().join(name);
    let rest = TriMesh::from(&cager_formats::read_model(&folder.join("rest.obj")).unwrap());
    let mut parts = UnionFind::new(rest.vertices.len());
    for &[a, b, c] in &rest.triangles {
        parts.join(a, b);
        parts.join(b, c);
    }
    let (part, count) = parts.numbered();
    let mut sizes = vec![0; count as usize];
    part.iter().for_each(|&p| sizes[p as usize] += 1);
    let largest = (0..sizes.len()).max_by_key(|&p| sizes[p]).unwrap() as u32;
    let kept: Vec<usize> = (0..part.len()).filter(|&v| part[v] == largest).collect();
    let mut names = vec![u32::MAX; part.len()];
    kept.iter().enumerate().for_each(|(k, &v)| names[v] = k as u32);
    let vertices: Vec<Point> = kept.iter().map(|&v| rest.vertices[v]).collect();
    let triangles = rest.triangles.iter().map(|t| t.map(|v| names[v as usize])).filter(|t| t[0] != u32::MAX).collect();
    let (shape, values) = npy(&folder.join("frames.npy"));
    let at = |f: usize, v: usize| [0, 1, 2].map(|k| f64::from(values[(f * shape[1] + v) * 3 + k]));
    let frames = (0..shape[0]).map(|f| kept.iter().map(|&v| at(f, v)).collect()).collect();
    let heights: Vec<f64> = vertices.iter().map(|p| p[up]).collect();
    let height = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max)
        - heights.iter().copied().fold(f64::INFINITY, f64::min);
    Capture { rest: TriMesh { vertices, triangles }, frames, height }
}

/// Shape and values of an array of 32-bit numbers.
pub fn npy(path: &Path) -> (Vec<usize>, Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..10 + length]).into_owned();
    assert!(header.contains("'<f4'"), "{header}");
    let shape = header.split('(').nth(1).unwrap().split(')').next().unwrap();
    let shape = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let values = bytes[10 + length..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    (shape, values)
}
