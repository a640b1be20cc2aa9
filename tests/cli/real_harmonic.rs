//! Harmonic coordinates on the captures of `CAGER_CAPTURES`, see `real_data`.

use crate::real_data::{cage_of, data, run_with};
use crate::support::Dir;
use cager_core::coordinates::{Harmonic, MeanValue};
use cager_core::inversion::SolverOptions;
use cager_formats::read_model;

/// Inverts as well as with mean value coordinates, from coordinates that are refined as far as promised.
fn is_refined_and_inverts(capture: &str) {
    let root = data();
    let folder = root.join(capture);
    let rest = read_model(&folder.join("rest.obj")).expect("a rest pose");
    let cage = cage_of(&folder.join("cage350.obj"));
    let dir = Dir::new();
    let options = SolverOptions::PAPER;
    let found = run_with(&dir, &Harmonic, &folder, &rest, &cage, options);
    let usual = run_with(&dir, &MeanValue, &folder, &rest, &cage, options);
    eprintln!(
        "{capture}: {:.2} s, {:?}, affine {:.1e}, mean L2 {:.4}e-2 (mvc {:.4}e-2), condition {:.1} (mvc {:.1}), {:?}",
        found.seconds.coordinates,
        found.refinement,
        found.affine_reproduction_error,
        100.0 * found.error.l2_mean,
        100.0 * usual.error.l2_mean,
        found.condition_number.handles,
        usual.condition_number.handles,
        found.warnings
    );
    let refined = found.refinement.expect("a numerical solution");
    assert!(refined.change <= 1e-3, "{refined:?}");
    assert!(found.affine_reproduction_error <= 1e-12, "{:e}", found.affine_reproduction_error);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    assert!(found.error.l2_mean < 1.25 * usual.error.l2_mean);
}

#[test]
#[ignore = "needs the captures: make captures"]
fn harmonic_coordinates_of_the_horse_are_refined_and_invert() {
    is_refined_and_inverts("horse-gallop");
}

#[test]
#[ignore = "needs the captures: make captures"]
fn harmonic_coordinates_of_the_arm_are_refined_and_invert() {
    is_refined_and_inverts("supercages-arm");
}
