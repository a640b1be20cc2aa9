//! What people should know of a prepared solver.

use cager_core::inversion::{Handles, Solver, SolverOptions};
use cager_core::regularize::Regularizer;

/// Warnings that follow from the preparation.
pub fn preparation_warnings(options: SolverOptions, solver: &Solver) -> Vec<String> {
    let found = solver.preparation();
    let unknowns = solver.decoder().unknowns();
    let mut warnings = Vec::new();
    if !found.outside.is_empty() {
        let (outside, points) = (found.outside.len(), solver.decoder().points());
        let what = if 2 * outside > points {
            "check the cage (cager cage --check), above all its units and axes"
        } else {
            "points outside follow the cage too, but an enlarged cage usually gives lower errors"
        };
        warnings.push(format!(
            "{outside} of {points} points lie outside the cage, by up to {:.2} % of the rest diagonal; {what}",
            100.0 * found.outside_distance
        ));
    }
    if let Some(refined) = found.refinement.filter(|refined| !refined.reached()) {
        warnings.push(format!(
            "the coordinates may be off by {:.1e} after {} refinements to {} boundary elements, more than the {:.0e} aimed at, as happens in cages much thinner than wide and where points are very near to a cage's long edges; make the cage roomier, or use mean value coordinates (mvc)",
            refined.change,
            refined.refinements,
            refined.elements,
            cager_core::coordinates::Refinement::TOLERANCE
        ));
    }
    let (read, points) = (solver.handles().len(), solver.decoder().points());
    if options.handles == Handles::All && read > unknowns && read < points {
        warnings.push(format!("of so many points a sample is analysed: {read} of {points} are read"));
    }
    let weak = found.weak;
    let strong = unknowns - weak;
    if weak > 0 {
        let consequence = match options.regularizer {
            Regularizer::Laplacian => "it is smoothed there".to_owned(),
            Regularizer::Global if options.lambda > 0.0 => "it is smoothed there".to_owned(),
            Regularizer::Differential => "it keeps the shape of the rest cage there".to_owned(),
            Regularizer::Temporal => "it keeps the previous frame's shape there".to_owned(),
            Regularizer::Matrix => "it follows the matrix there".to_owned(),
            Regularizer::Tikhonov => "what they leave open is damped".to_owned(),
            Regularizer::TruncatedSvd if options.spectrum >= weak => "what they leave open is dropped".to_owned(),
            _ => format!(
                "it follows the rounding of the data there, so expect spikes, or use the differential regularizer (regularizer differential, spectrum {weak})"
            ),
        };
        warnings.push(format!(
            "the points determine only {strong} of the cage's {unknowns} unknowns, as where parts of it are far from all of them; {consequence}"
        ));
    }
    if found.affine_reproduction_error > 1e-10 {
        warnings.push(format!(
            "the coordinates reproduce the rest pose to {:.1e} of its diagonal only, as happens far outside a cage, above all a very thin one; check that both files belong together",
            found.affine_reproduction_error
        ));
    }
    warnings
}

/// What to tell where the cages of some frames would have left them, and what helps.
pub(crate) fn held_frames(held: &[usize], frames: usize, handles: Handles, is_coded: bool) -> Option<String> {
    let first = held.first()?;
    let closer = match (is_coded, handles) {
        (true, _) => "",
        (false, Handles::All) => "an error bound (max_error) stores what it leaves, and ",
        (false, _) => {
            "handles at all points (handles all) follow more closely, an error bound (max_error) stores what the cage leaves, and "
        }
    };
    Some(format!(
        "in {} of {frames} frames, the first is {first}, the cage would have run away from the model: it cannot follow these frames, and the points determine some of its vertices too weakly; it was held to the shape of the rest cage there; {closer}a cage made from the rest pose alone (cager cage --rest) usually stays near by itself",
        held.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::cage::Cage;
    use cager_core::coordinates::MeanValue;
    use cager_core::inversion::PrepareContext;
    use cager_demo::{Capture, Options};

    #[test]
    fn all_points_of_a_sampled_model_are_those_of_the_sample() {
        let capture = Capture::new(&Options { points: 3_000, frames: 1, cage_vertices: 40 });
        let cage = Cage::new(capture.cage.clone()).unwrap();
        let warnings = |handles, analysed_entries| {
            let options = SolverOptions { handles, ..SolverOptions::default() };
            let context = PrepareContext { analysed_entries, ..PrepareContext::default() };
            let solver = Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, options, &context).unwrap();
            preparation_warnings(options, &solver).concat()
        };
        let sampled = warnings(Handles::All, 40_000);
        assert!(sampled.contains("are read"), "{sampled}");
        assert!(!warnings(Handles::All, 1 << 25).contains("are read"));
        assert!(!warnings(Handles::default(), 40_000).contains("are read"));
    }
}
