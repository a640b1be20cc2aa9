//! Quadrature on a triangle, with the polynomials at its nodes.

use super::basis::{Basis, MAX_FUNCTIONS};

/// Nodes `[α, β, weight]` in barycentric coordinates; the weights add up to one.
pub(super) struct Rule {
    pub(super) nodes: Vec<[f64; 3]>,
}

impl Rule {
    /// Sixteen points, exact to degree 8 (Dunavant 1985).
    pub(super) fn degree_8() -> Self {
        let mut nodes = vec![[1.0 / 3.0, 1.0 / 3.0, 0.144_315_607_677_787]];
        for (weight, a, b) in [
            (0.095_091_634_267_285, 0.081_414_823_414_554, 0.459_292_588_292_723),
            (0.103_217_370_534_718, 0.658_861_384_496_480, 0.170_569_307_751_760),
            (0.032_458_497_623_198, 0.898_905_543_365_938, 0.050_547_228_317_031),
        ] {
            nodes.extend([[a, b, weight], [b, a, weight], [b, b, weight]]);
        }
        let (weight, a, b, c) =
            (0.027_230_314_174_435, 0.008_394_777_409_958, 0.263_112_829_634_638, 0.728_492_392_955_404);
        nodes.extend([[a, b, weight], [a, c, weight], [b, a, weight], [b, c, weight], [c, a, weight], [c, b, weight]]);
        Self { nodes }
    }

    /// Seven points, exact to degree 5 (Radon 1948).
    pub(super) fn degree_5() -> Self {
        let root = 15f64.sqrt();
        let mut nodes = vec![[1.0 / 3.0, 1.0 / 3.0, 0.225]];
        for sign in [-1.0, 1.0] {
            let b = (6.0 + sign * root) / 21.0;
            let weight = (155.0 + sign * root) / 1200.0;
            nodes.extend([[1.0 - 2.0 * b, b, weight], [b, 1.0 - 2.0 * b, weight], [b, b, weight]]);
        }
        Self { nodes }
    }

    /// The same rule on each of the four triangles that halving the sides gives.
    pub(super) fn quartered(&self) -> Self {
        let corners = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]];
        let mut nodes: Vec<[f64; 3]> = Vec::new();
        for corner in corners {
            nodes.extend(self.nodes.iter().map(|n| [corner[0] + 0.5 * n[0], corner[1] + 0.5 * n[1], 0.25 * n[2]]));
        }
        nodes.extend(self.nodes.iter().map(|n| [0.5 - 0.5 * n[0], 0.5 - 0.5 * n[1], 0.25 * n[2]]));
        Self { nodes }
    }

    /// Values of the polynomials at the nodes, times their weights: a row per node.
    pub(super) fn weighted(&self, basis: &Basis) -> Vec<[f64; MAX_FUNCTIONS]> {
        let at = |node: &[f64; 3]| {
            let mut values = [0.0; MAX_FUNCTIONS];
            basis.values([node[0], node[1]], &mut values);
            values.map(|v| node[2] * v)
        };
        self.nodes.iter().map(at).collect()
    }
}

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
            let values = rule.weighted(&basis);
            (rule, values)
        };
        Self { fine: with(Rule::degree_8()), coarse: with(Rule::degree_5()), basis }
    }
}

/// Nodes and weights of Gauss's rule with six points on [0, 1], exact to degree 11.
pub(super) const GAUSS_6: [[f64; 2]; 6] = [
    [0.033_765_242_898_423_975, 0.085_662_246_189_585_18],
    [0.169_395_306_766_867_74, 0.180_380_786_524_069_3],
    [0.380_690_406_958_401_55, 0.233_956_967_286_345_52],
    [0.619_309_593_041_598_5, 0.233_956_967_286_345_52],
    [0.830_604_693_233_132_3, 0.180_380_786_524_069_3],
    [0.966_234_757_101_576, 0.085_662_246_189_585_18],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_exact_to_their_degree() {
        let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
        for (rule, degree) in [(Rule::degree_8(), 8), (Rule::degree_5(), 5), (Rule::degree_8().quartered(), 8)] {
            for a in 0..=degree {
                for b in 0..=degree - a {
                    let found: f64 = rule.nodes.iter().map(|n| n[2] * n[0].powi(a as i32) * n[1].powi(b as i32)).sum();
                    let exact = 2.0 * factorial(a) * factorial(b) / factorial(a + b + 2);
                    assert!((found - exact).abs() < 1e-14, "α^{a} β^{b}: {found} {exact}");
                }
            }
        }
        for k in 0..=11 {
            let found: f64 = GAUSS_6.iter().map(|[t, w]| w * t.powi(k)).sum();
            assert!((found - 1.0 / f64::from(k + 1)).abs() < 1e-15, "{k} {found}");
        }
    }
}
