//! Vertex pairs: where surfaces do not tell what corresponds to what.

use crate::common::{Caged, lumpy};
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_geometry::vector::distance;
use cager_shape::TransferError;
use cager_shape::transfer::fitted::FittedTransfer;
use cager_shape::transfer::{FittedOptions, Pose, VertexPair};
use glam::{DMat3, DVec3};

/// Rings of the source and of the target.
const RINGS: [u32; 2] = [14, 12];

fn egg(rings: u32) -> TriMesh {
    lumpy(rings, [1.0, 0.7, 0.5], 0.0)
}

/// A body that looks the same turned by half a turn, and a target that is turned so, and by a little more.
fn pair() -> (Caged, TriMesh, DMat3) {
    let turn = DMat3::from_rotation_x(0.2) * DMat3::from_rotation_z(std::f64::consts::PI);
    let target = egg(RINGS[1]);
    (Caged::new(egg(RINGS[0]), 40), TriMesh { vertices: turned(&target.vertices, turn), ..target }, turn)
}

fn turned(points: &[Point], turn: DMat3) -> Vec<Point> {
    points.iter().map(|&p| (turn * DVec3::from(p)).to_array()).collect()
}

/// One end is bent, the other is not.
fn bent(rest: &[Point]) -> Vec<Point> {
    rest.iter().map(|p| [p[0], p[1], p[2] + 0.3 * p[0].max(0.0).powi(2)]).collect()
}

/// The vertex at a quarter turn on the middle ring.
fn side(rings: u32, quarter: u32) -> u32 {
    1 + (rings / 2 - 1) * 2 * rings + quarter * rings / 2
}

fn options(pairs: Vec<VertexPair>) -> FittedOptions<'static> {
    FittedOptions { pose: Pose::Relative, pairs, ..FittedOptions::default() }
}

#[test]
fn pairs_tell_which_way_round_a_symmetrical_body_is() {
    let (source, target, turn) = pair();
    let found = FittedTransfer::new(&source.source(), &target, &options(Vec::new())).map(|_| ());
    assert!(matches!(found, Err(TransferError::Ambiguous(false))), "{found:?}");
    let wanted = turned(&bent(&egg(RINGS[1]).vertices), turn);
    let sides = [0, 1].map(|k| VertexPair { source: side(RINGS[0], k), target: side(RINGS[1], k) });
    let top = VertexPair { source: 0, target: 0 };
    // Three that determine the alignment, and two that only say which of those that the surfaces offer it is.
    for pairs in [vec![sides[0], sides[1], top], sides.to_vec()] {
        let count = pairs.len();
        let transfer = FittedTransfer::new(&source.source(), &target, &options(pairs)).unwrap();
        let pose = transfer.pose(0, &bent(&source.rest.vertices)).unwrap();
        let far = pose.iter().zip(&wanted).map(|(p, q)| distance(*p, *q)).fold(0.0, f64::max);
        assert!(far < 0.03 * diagonal(&wanted), "{count} pairs: {far}");
    }
}

#[test]
fn a_pair_of_vertices_that_there_are_not_is_named() {
    let (source, target, _) = pair();
    let pairs = [0, 100_000].map(|target| VertexPair { source: 0, target });
    let options = options(pairs.to_vec());
    let error = FittedTransfer::new(&source.source(), &target, &options).map(|_| ()).unwrap_err();
    assert!(error.to_string().starts_with("pair 1 names vertex 100000 of the target"), "{error}");
}
