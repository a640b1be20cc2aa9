//! Weighted standard deviations, and means of many.

/// `sqrt(Σ w (x − x̄)² / Σ w)` of pairs (w, x), with `x̄` the weighted mean; none where nothing has a weight.
pub(super) fn deviation(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<f64> {
    let (sum, total) = pairs.clone().fold((0.0, 0.0), |(sum, total), (w, x)| (sum + w * x, total + w));
    if total == 0.0 {
        return None;
    }
    let mean = sum / total;
    Some((pairs.map(|(w, x)| w * (x - mean).powi(2)).sum::<f64>() / total).sqrt())
}

/// A relative difference of two lengths with the first one, which is its weight; nothing where that is 0.
pub(super) fn weighted_difference(captured: f64, decoded: f64) -> (f64, f64) {
    (captured, if captured == 0.0 { 0.0 } else { (captured - decoded) / captured })
}

/// A running mean.
#[derive(Clone, Copy, Default)]
pub(super) struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    /// Adds those that exist, in their order.
    pub(super) fn extend(&mut self, values: &[Option<f64>]) {
        for value in values.iter().flatten() {
            self.sum += value;
            self.count += 1;
        }
    }

    /// NaN where nothing was added.
    pub(super) fn value(self) -> f64 {
        self.sum / self.count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_count_as_repetitions() {
        let weighted = deviation([(2.0, 1.0), (1.0, 4.0)].into_iter());
        // Of 1, 1, 4: mean 2, variance (1 + 1 + 4) / 3.
        assert_eq!(weighted, Some(2f64.sqrt()));
        assert_eq!(deviation([(0.0, 1.0), (0.0, 4.0)].into_iter()), None);
        assert!(deviation([(1.0, f64::NAN), (1.0, 4.0)].into_iter()).is_some_and(f64::is_nan));
    }
}
