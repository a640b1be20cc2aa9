//! What reading takes of memory on all threads together, of the files that take the most for their length. One test, as everything in the process counts.

#[path = "support/memory.rs"]
mod memory;
mod support;

use cager_codec::{AdjacentGroups, CageBasis, CodedMesh, encode_cages};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::mesh::{Model, Polygons};
use cager_proto::container::{ContainerReader, ContainerWriter};
use memory::peak_of_all_threads;
use std::io::Cursor;
use support::{frame, header, tetrahedron};

/// Vertices along each side of a grid: as many as so small a file may have.
const SIDE: u32 = 320;
/// Frames of a group, and components of its residual: as many numbers as it may have.
const FRAMES: usize = 220;
const COMPONENTS: u16 = 218;

/// A flat grid of many points, coded in a few bytes each thousand, with two groups whose residuals have as many numbers as they may in a few bytes.
fn small_file_of_large_sections() -> Vec<u8> {
    let mut rest = Model::default();
    for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
        rest.points.push([i, j, 0].map(|k| 0.1 + 0.1 * f64::from(k) / f64::from(SIDE)));
        if i + 1 < SIDE && j + 1 < SIDE {
            rest.faces.push(&[(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| (i + di) * SIDE + j + dj));
        }
    }
    let rest = CodedMesh::new(&rest, 0.1 / f64::from(SIDE)).unwrap();
    let cage = tetrahedron();
    let mut faces = Polygons::new();
    cage.triangles.iter().for_each(|triangle| faces.push(triangle));
    let checked = Cage::new(cage.clone()).unwrap();
    let (basis, _) = CageBasis::of(&MeanValue, &checked, &rest.mesh.points, None, None).unwrap().unwrap();
    let frames: Vec<Vec<f32>> = (0..FRAMES).map(|k| frame(k, 4)).collect();
    let views: Vec<&[f32]> = frames.iter().map(Vec::as_slice).collect();
    let cages = encode_cages(&basis, &views, 1e-3, AdjacentGroups::default()).unwrap();
    // Step, number of components, step of corrections, bytes of the components; zeros stand for as many numbers as there are.
    let mut residual = 0.01_f64.to_le_bytes().to_vec();
    residual.extend(COMPONENTS.to_le_bytes());
    residual.extend(0.01_f64.to_le_bytes());
    residual.extend(64_u32.to_le_bytes());
    residual.extend([0; 64]);
    let mut writer =
        ContainerWriter::with_meshes(Vec::new(), &header(4), (&rest.mesh, Some(&rest)), (&cage, None), &[]).unwrap();
    for _ in 0..2 {
        writer.write_group(&cages, Some(&residual), &[(0.5, 1.5); FRAMES]).unwrap();
    }
    writer.finish(None).unwrap()
}

#[test]
fn reading_takes_no_more_than_the_format_says() {
    let bytes = small_file_of_large_sections();
    let most = (512 << 20) + 512 * bytes.len();
    let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
    let (_, peak) = peak_of_all_threads(|| reader.verify());
    eprintln!("{} bytes, {} MiB to verify", bytes.len(), peak >> 20);
    assert!(peak > 200 << 20, "the counter has not seen the threads: {peak}");
    assert!(peak < most, "{peak} bytes of memory for {} bytes", bytes.len());
    // Two residuals at once, where one group is read after the other.
    let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
    let mut positions = vec![vec![0.0; 3 * (SIDE * SIDE) as usize]];
    let (_, peak) = peak_of_all_threads(|| {
        [0, FRAMES].map(|k| reader.read_ahead(k).is_ok() && reader.add_residual(&[k], &mut positions).is_ok())
    });
    eprintln!("{} MiB for one group after the other", peak >> 20);
    assert!(peak < most, "{peak} bytes of memory for {} bytes", bytes.len());
}
