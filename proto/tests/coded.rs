//! Coded containers: what is written comes back, and damage behind right checksums is an error or harmless.

mod support;

use cager_codec::{
    AdjacentGroups, CageBasis, CodedMesh, Hierarchy, ResidualGroup, decode_cages, encode_cages, encode_residual,
};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::mesh::{Model, Polygons, TriMesh};
use cager_proto::container::{ContainerReader, ContainerWriter, Error, group_frames};
use std::io::Cursor;
use support::{frame, header, put_together, read_all, small_model, take_apart, tetrahedron};

const FRAMES: usize = 7;

/// Two groups, and the cages that they decode to.
fn coded() -> (Vec<u8>, Vec<Vec<f32>>) {
    let cage = tetrahedron();
    let mut faces = Polygons::new();
    cage.triangles.iter().for_each(|triangle| faces.push(triangle));
    let cage = CodedMesh::new(&Model { points: cage.vertices, faces, ..Model::default() }, 1e-3).unwrap();
    let rest = CodedMesh::new(&small_model(), 1e-3).unwrap();
    let mesh = TriMesh { vertices: cage.mesh.points.clone(), triangles: cage.mesh.faces.triangulated() };
    let checked = Cage::new(mesh.clone()).unwrap();
    let (basis, _) = CageBasis::of(&MeanValue, &checked, &rest.mesh.points, None, None).unwrap().unwrap();
    let hierarchy = Hierarchy::new(&rest.mesh.faces, rest.mesh.points.len());
    let meshes = ((&rest.mesh, Some(&rest)), (&mesh, Some(&cage)));
    let mut writer = ContainerWriter::with_meshes(Vec::new(), &header(4), meshes.0, meshes.1, &[]).unwrap();
    let cages: Vec<Vec<f32>> = (0..FRAMES).map(|k| frame(k, 4)).collect();
    let mut decoded = Vec::new();
    for group in cages.chunks(4) {
        let views: Vec<&[f32]> = group.iter().map(Vec::as_slice).collect();
        let bytes = encode_cages(&basis, &views, 1e-3, AdjacentGroups::default()).unwrap();
        decoded.extend(decode_cages(&basis, group.len(), &bytes).unwrap());
        let captured: Vec<Vec<f64>> = group.iter().map(|f| f.iter().map(|&x| f64::from(x) + 0.25).collect()).collect();
        let captured: Vec<&[f64]> = captured.iter().map(Vec::as_slice).collect();
        let residual =
            ResidualGroup { captured: &captured, of_cages: group, step: 0.02, bound: Some(0.01), most_numbers: 1000 };
        let (residual, _) = encode_residual(&hierarchy, &residual).unwrap();
        writer.write_group(&bytes, Some(&residual), &vec![(0.5, 1.5); group.len()]).unwrap();
    }
    (writer.finish(None).unwrap(), decoded)
}

#[test]
fn groups_come_back_in_any_order() {
    let (bytes, cages) = coded();
    let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
    reader.verify().unwrap();
    assert!(reader.has_residual());
    let mut found = Vec::new();
    for k in [6, 0, 3, 4, 5, 2, 1] {
        reader.read_frame(k, &mut found).unwrap();
        assert_eq!(found, cages[k]);
    }
    let which = [1, 2, 5, 0];
    let mut positions: Vec<Vec<f32>> = which.iter().map(|&k| frame(k, 4)).collect();
    reader.add_residual(&which, &mut positions).unwrap();
    for (k, found) in which.iter().zip(&positions) {
        let off = |(x, y): (&f32, f32)| (x - y - 0.25).abs();
        assert!(found.iter().zip(frame(*k, 4)).map(off).all(|off| off <= 0.0101), "frame {k}");
    }
    let rest = reader.rest().unwrap();
    assert_eq!(rest.points.len(), small_model().points.len());
    assert_eq!(group_frames(100_000_000, 4), 1);
}

#[test]
fn coordinates_that_take_more_than_they_may_are_refused_before_they_take_it() {
    let (bytes, cages) = coded();
    let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
    reader.limit_coordinates(1000);
    let mut found = Vec::new();
    let error = reader.read_frame(0, &mut found).unwrap_err();
    assert!(matches!(error, Error::Memory { needed, most: 1000 } if needed > 1000), "{error}");
    reader.limit_coordinates(1 << 20);
    reader.read_frame(0, &mut found).unwrap();
    assert_eq!(found, cages[0]);
}

#[test]
fn forms_that_were_never_released_are_refused_by_name() {
    let parts = take_apart(&coded().0);
    for tag in [b"RPTS", b"RFAC", b"CVTX", b"ERRS"] {
        let mut earlier = parts.clone();
        earlier.iter_mut().filter(|part| part.tag == *tag).for_each(|part| part.codec = 3);
        let error = read_all(&put_together(&earlier)).unwrap_err();
        assert!(matches!(&error, Error::UnknownSection(what) if what == "codec 3"), "{error}");
    }
    let mut earlier = parts;
    earlier[0].payload[0] = 2;
    let error = read_all(&put_together(&earlier)).unwrap_err();
    assert!(matches!(&error, Error::UnknownSection(what) if what == "coordinates of definition 2"), "{error}");
}

#[test]
fn damage_behind_right_checksums_is_an_error_or_harmless() {
    let (bytes, _) = coded();
    let parts = take_apart(&bytes);
    let mut refused = 0;
    for (k, part) in parts.iter().enumerate() {
        for at in 0..part.payload.len() {
            let mut damaged = parts.clone();
            damaged[k].payload[at] ^= 0x24;
            refused += usize::from(read_all(&put_together(&damaged)).is_err());
        }
        let mut cut = parts.clone();
        let half = cut[k].payload.len() / 2;
        cut[k].payload.truncate(half);
        assert!(read_all(&put_together(&cut)).is_err() || half == part.payload.len(), "section {k}");
    }
    assert!(refused > 50, "{refused}");
}
