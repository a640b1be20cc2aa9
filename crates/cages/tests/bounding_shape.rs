//! Bounding shapes as cages around one model and around several.

mod common;

use cager_cages::{BoundingShape, EncloseError, bounding_shape};
use cager_geometry::mesh::Model;
use common::{append, model, sphere, torus, verdict};

const SHAPES: [(BoundingShape, usize); 3] =
    [(BoundingShape::Box, 8), (BoundingShape::Sphere, 12), (BoundingShape::Hull, 4)];

#[test]
fn every_shape_encloses_every_model() {
    let flat =
        Model { points: (0..100).map(|i| [f64::from(i % 10), f64::from(i / 10), 3.0]).collect(), ..Model::default() };
    let line = Model { points: vec![[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], ..Model::default() };
    let mut cube =
        Model { points: (0..8).map(|i| [0, 1, 2].map(|k| f64::from(i >> k & 1))).collect(), ..Model::default() };
    append(&mut cube, &torus([5.0, 0.0, 0.0], 1.0, 0.2, 1));
    for model in [flat, line, cube, model(&sphere([1e3, 0.0, -1e3], 1e-2, 20))] {
        for (shape, least) in SHAPES {
            for vertices in [least, 20, 100, 500] {
                let cage = bounding_shape(&[&model], shape, vertices).unwrap();
                assert!(cage.vertices.len() <= vertices);
                let verdict = verdict(&cage, &model);
                assert!(verdict.is_valid(1) && verdict.clearance > 5e-3, "{shape:?} {vertices}: {verdict:?}");
            }
        }
    }
}

#[test]
fn a_public_cage_encloses_all_models() {
    let (a, b) = (model(&sphere([0.0; 3], 1.0, 12)), model(&torus([3.0, 1.0, 0.0], 2.0, 0.4, 0)));
    for (shape, _) in SHAPES {
        let cage = bounding_shape(&[&a, &b], shape, 80).unwrap();
        assert!(verdict(&cage, &a).is_valid(1) && verdict(&cage, &b).is_valid(1), "{shape:?}");
    }
}

#[test]
fn what_no_shape_can_enclose_is_named() {
    let empty = Model::default();
    let nan = Model { points: vec![[f64::NAN; 3]], ..Model::default() };
    let point = Model { points: vec![[1.0; 3]; 2], ..Model::default() };
    for (shape, least) in SHAPES {
        assert_eq!(bounding_shape(&[&empty], shape, 100), Err(EncloseError::Empty));
        assert_eq!(bounding_shape(&[&nan], shape, 100), Err(EncloseError::NotFinite(0)));
        assert_eq!(bounding_shape(&[&point], shape, 100), Err(EncloseError::NoExtent));
        let ball = model(&sphere([0.0; 3], 1.0, 8));
        let few = EncloseError::TooFewVertices { vertices: least - 1, least };
        assert_eq!(bounding_shape(&[&ball], shape, least - 1), Err(few));
    }
}
