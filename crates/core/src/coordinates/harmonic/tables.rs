//! Polynomials and rules that all elements share.

use super::basis::{Basis, MAX_FUNCTIONS};
use super::quadrature::Rule;

/// What the potentials of all triangles need.
pub(super) struct Tables {
    pub(super) basis: Basis,
    /// Rules with the polynomials at their nodes, times the weights.
    pub(super) fine: (Rule, Vec<[f64; MAX_FUNCTIONS]>),
    pub(super) coarse: (Rule, Vec<[f64; MAX_FUNCTIONS]>),
}

impl Tables {
    pub(super) fn new() -> Self {
        let basis = Basis::new();
        let with = |rule: Rule| {
            let values = basis.weighted(&rule);
            (rule, values)
        };
        Self { fine: with(Rule::degree_8()), coarse: with(Rule::degree_5()), basis }
    }
}
