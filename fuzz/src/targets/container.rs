//! `.cager` files. Where the first byte says so, checksums are made right first: damage behind right checksums is what an
//! attacker sends.

use super::{byte, mend, u64_at};
use crate::Target;
use cager_codec::{AdjacentGroups, CageBasis, CodedMesh, Hierarchy, ResidualGroup, encode_cages, encode_residual};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::mesh::{Model, Polygons, TriMesh};
use cager_proto::container::{ContainerReader, ContainerWriter, EditLayer, Header, LayerSource};
use cager_proto::report::Report;
use std::io::Cursor;

pub(super) const CONTAINER: Target = Target {
    name: "container",
    run,
    seeds,
    words: &[
        "HEAD",
        "RPTS",
        "RFAC",
        "CVTX",
        "CTRI",
        "FRAM",
        "ERRS",
        "TOC_",
        "summ",
        "resi",
        "EDIT",
        "note",
        "CGRE",
        "mvc",
        "maxvol",
        "laplacian",
        "null",
    ],
    // What `docs/FORMAT.md` allows a reader, its coordinates, and 1 MiB for all that is not the file's.
    fixed: (512 << 20) + COORDINATES as usize + (1 << 20),
    per_byte: 512,
};

/// Bytes that the coordinates may take.
const COORDINATES: u64 = 16 << 20;

const PRELUDE: usize = 16;
const SECTION: usize = 40;
const LINE: usize = 40;
const FOOTER: usize = 24;

fn seeds() -> Vec<Vec<u8>> {
    let cage = TriMesh {
        vertices: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let mut faces = Polygons::new();
    faces.push(&[0, 1, 2, 3]);
    let points = cage.vertices.iter().map(|p| p.map(|x| 0.1 + x / 3.0)).collect();
    let rest = Model { points, faces, colors: vec![[200, 0, 7]; 4], ..Model::default() };
    let header = Header {
        coordinates_definition: 3,
        coordinates: "mvc".to_owned(),
        handles: "maxvol".to_owned(),
        regularizer: "laplacian".to_owned(),
        rows_per_frame: 4,
        frame_rate: Some(24.0),
        ..Header::default()
    };
    let file = |frames: u8, report: bool| {
        let mut writer = ContainerWriter::new(Vec::new(), &header, &rest, &cage).expect("a header");
        for k in 0..frames {
            let frame: Vec<f32> = (0..12_u8).map(|i| f32::from(i) * 0.25 + f32::from(k)).collect();
            writer.write_frame(&frame, 0.5, 1.5).expect("a frame");
        }
        let report =
            report.then(|| Report { generator: "test".to_owned(), singular_values: vec![1.0; 9], ..Report::default() });
        let mut file = writer.finish(report.as_ref()).expect("a container");
        file.insert(0, 1);
        file
    };
    let mut intact = file(3, true);
    intact[0] = 0;
    // Its residual is in two parts.
    let mut parted = include_bytes!("../../../tests/golden/coded-parted-mvc.cager").to_vec();
    parted.insert(0, 1);
    vec![intact, edited(&file(3, true)[1..]), file(3, true), file(0, false), coded(&header, &rest, &cage), parted]
}

/// A file with two layers of edits, one of them switched off.
fn edited(file: &[u8]) -> Vec<u8> {
    let layer = EditLayer {
        name: "smile".to_owned(),
        is_on: true,
        first: 1,
        vertices: vec![0, 3],
        changes: (0..12_u8).map(|i| f32::from(i) * 0.5).collect(),
    };
    let layers = [layer.clone(), EditLayer { is_on: false, ..layer }].map(LayerSource::New);
    let mut reader = ContainerReader::open(Cursor::new(file)).expect("a container");
    ContainerWriter::copy_with_layers(&mut reader, &layers, vec![1]).expect("a container")
}

/// A file of coded meshes, cages and residual.
fn coded(header: &Header, rest: &Model, cage: &TriMesh) -> Vec<u8> {
    let mut faces = Polygons::new();
    cage.triangles.iter().for_each(|triangle| faces.push(triangle));
    let coded_cage =
        CodedMesh::new(&Model { points: cage.vertices.clone(), faces, ..Model::default() }, 0.01).expect("a mesh");
    let coded_rest = CodedMesh::new(rest, 0.01).expect("a mesh");
    let mesh = TriMesh { vertices: coded_cage.mesh.points.clone(), triangles: coded_cage.mesh.faces.triangulated() };
    let checked = Cage::new(mesh.clone()).expect("a cage");
    let basis = CageBasis::of(&MeanValue, &checked, &coded_rest.mesh.points, None, None).expect("coordinates");
    let (basis, _) = basis.expect("a basis");
    let frames: Vec<Vec<f32>> =
        (0..5u8).map(|k| (0..12u8).map(|i| f32::from(i) * 0.1 + f32::from(k) * 0.05).collect()).collect();
    let views: Vec<&[f32]> = frames.iter().map(Vec::as_slice).collect();
    let cages = encode_cages(&basis, &views, 0.01, AdjacentGroups::default()).expect("cages");
    let captured: Vec<Vec<f64>> =
        frames.iter().map(|frame| frame.iter().map(|&x| f64::from(x) + 0.1).collect()).collect();
    let captured: Vec<&[f64]> = captured.iter().map(Vec::as_slice).collect();
    let group =
        ResidualGroup { captured: &captured, of_cages: &frames, step: 0.02, bound: Some(0.005), most_numbers: 1000 };
    let hierarchy = Hierarchy::new(&coded_rest.mesh.faces, coded_rest.mesh.points.len());
    let (residual, _) = encode_residual(&hierarchy, &group).expect("a residual");
    let mut writer = ContainerWriter::with_meshes(
        vec![1],
        header,
        (&coded_rest.mesh, Some(&coded_rest)),
        (&mesh, Some(&coded_cage)),
        &[],
    )
    .expect("a header");
    writer.write_group(&cages, Some(&residual), &[(0.5, 1.5); 5]).expect("a group");
    writer.finish(None).expect("a container")
}

fn run(mut bytes: &[u8]) {
    let mode = byte(&mut bytes);
    let mut file = bytes.to_vec();
    if mode & 1 != 0 {
        fix(&mut file, mode & 2 != 0);
    }
    let Ok(mut reader) = ContainerReader::open(Cursor::new(&file)) else { return };
    reader.limit_coordinates(COORDINATES);
    reader.sections();
    let frames = reader.frames();
    let rows = reader.header().rows_per_frame as usize;
    let verified = reader.verify();
    let mut cage = Vec::new();
    let last = (0..frames.min(64)).map(|k| reader.read_frame(k, &mut cage).map(|_| cage.len())).last();
    if verified.is_ok() {
        if let Some(last) = last {
            assert_eq!(last.expect("it was verified"), 3 * rows, "values of a cage");
        }
        let rest = reader.rest().expect("it was verified");
        assert!(rest.points.as_flattened().iter().all(|x| x.is_finite()), "a point is not finite");
        assert!(rest.faces.indices().iter().all(|&i| (i as usize) < rest.points.len()), "an index lies outside");
        let cage = reader.cage().expect("it was verified");
        assert!(
            cage.triangles.as_flattened().iter().all(|&i| (i as usize) < cage.vertices.len()),
            "an index lies outside"
        );
    }
}

/// Makes the checksums right, and with `contents` also the table of contents' copies of the section headers.
fn fix(file: &mut [u8], contents: bool) {
    let Some(end) = file.len().checked_sub(FOOTER) else { return };
    mend(file, 0, 12, 12);
    let table = u64_at(file, end).and_then(|at| usize::try_from(at).ok()).unwrap_or(usize::MAX);
    let mut at = PRELUDE;
    let mut line = table.saturating_add(SECTION);
    while at.saturating_add(SECTION) <= end {
        let length = u64_at(file, at + 16).and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX);
        let Some(next) =
            at.checked_add(SECTION).and_then(|start| start.checked_add(length)).filter(|&next| next <= end)
        else {
            break;
        };
        if contents && at != table && line.saturating_add(LINE) <= end {
            file.copy_within(at..at + 32, line + 8);
            line += LINE;
        }
        mend(file, at + SECTION, next, at + 32);
        mend(file, at, at + 36, at + 36);
        at = next;
    }
    // The table comes last, and its content may have changed since.
    if let Some(next) = table.checked_add(SECTION)
        && next <= end
    {
        mend(file, next, end, table + 32);
        mend(file, table, table + 36, table + 36);
    }
    mend(file, end, end + 20, end + 20);
}
