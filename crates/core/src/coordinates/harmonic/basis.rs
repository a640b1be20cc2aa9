//! Orthonormal polynomials on a triangle, sorted by degree.

/// Highest degree.
pub(super) const MAX_DEGREE: usize = 6;
/// Polynomials up to it.
pub(super) const MAX_FUNCTIONS: usize = functions(MAX_DEGREE);

/// Number of polynomials up to a degree.
pub(super) const fn functions(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Index of the monomial `αᵃ βᵇ` among all, by degree.
pub(super) const fn place(a: usize, b: usize) -> usize {
    let degree = a + b;
    degree * (degree + 1) / 2 + b
}

/// Orthonormal polynomials in barycentric coordinates `α, β`: each one's square has the mean one.
pub(super) struct Basis {
    /// Row k: the coefficients of polynomial k over the monomials, of which it has the first k + 1.
    pub(super) coefficients: [[f64; MAX_FUNCTIONS]; MAX_FUNCTIONS],
}

impl Basis {
    pub(super) fn new() -> Self {
        let mut coefficients = [[0.0; MAX_FUNCTIONS]; MAX_FUNCTIONS];
        for k in 0..MAX_FUNCTIONS {
            let mut row = [0.0; MAX_FUNCTIONS];
            row[k] = 1.0;
            // Twice, since monomials are nearly dependent.
            for _ in 0..2 {
                for lower in &coefficients[..k] {
                    let share = mean_product(&row, lower);
                    for (entry, l) in row.iter_mut().zip(lower) {
                        *entry -= share * l;
                    }
                }
            }
            let size = mean_product(&row, &row).sqrt();
            coefficients[k] = row.map(|c| c / size);
        }
        Self { coefficients }
    }

    /// Values at a point of the first polynomials.
    pub(super) fn values(&self, [alpha, beta]: [f64; 2], values: &mut [f64]) {
        let mut monomials = [0.0; MAX_FUNCTIONS];
        for degree in 0..=MAX_DEGREE {
            for b in 0..=degree {
                monomials[place(degree - b, b)] = alpha.powi((degree - b) as i32) * beta.powi(b as i32);
            }
        }
        for (k, value) in values.iter_mut().enumerate() {
            *value = (0..=k).map(|j| self.coefficients[k][j] * monomials[j]).sum();
        }
    }
}

/// Mean over the triangle of the product of two polynomials: `mean αᵃ βᵇ = 2 a! b! / (a + b + 2)!`.
fn mean_product(p: &[f64; MAX_FUNCTIONS], q: &[f64; MAX_FUNCTIONS]) -> f64 {
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let mut exponents = [(0, 0); MAX_FUNCTIONS];
    for degree in 0..=MAX_DEGREE {
        for b in 0..=degree {
            exponents[place(degree - b, b)] = (degree - b, b);
        }
    }
    let mut sum = 0.0;
    for (i, &(a, b)) in exponents.iter().enumerate() {
        for (j, &(c, d)) in exponents.iter().enumerate() {
            if p[i] != 0.0 && q[j] != 0.0 {
                sum += p[i] * q[j] * 2.0 * factorial(a + c) * factorial(b + d) / factorial(a + b + c + d + 2);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_orthonormal() {
        let basis = Basis::new();
        for i in 0..MAX_FUNCTIONS {
            for j in 0..=i {
                let expected = if i == j { 1.0 } else { 0.0 };
                let found = mean_product(&basis.coefficients[i], &basis.coefficients[j]);
                assert!((found - expected).abs() < 1e-8, "{i} {j} {found}");
            }
        }
    }
}
