//! Axes: which values they span, and where their ticks are.

/// Decades a logarithmic axis shows at most; below are rounding errors and zeros.
const DECADES: f64 = 15.0;

/// An axis of values.
pub(crate) struct Scale {
    /// Whether the axis is logarithmic.
    pub(crate) logarithmic: bool,
    /// Lower end.
    pub(crate) low: f64,
    /// Upper end.
    pub(crate) high: f64,
}

/// How an axis covers its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AxisRange {
    /// Linear from zero.
    FromZero,
    /// Linear around the values.
    Around,
    /// Linear from the least to the largest value exactly: frames, indices.
    Exactly,
    /// Logarithmic.
    Logarithmic,
}

impl Scale {
    /// The axis for these values; those that are not finite do not count.
    pub(crate) fn covering(cover: AxisRange, values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        match cover {
            _ if low > high => Self { logarithmic: false, low: 0.0, high: 1.0 },
            AxisRange::FromZero => {
                let top = if high > 0.0 { 1.04 * high } else { 1.0 };
                let step = nice_step(top, 4.0);
                Self { logarithmic: false, low: 0.0, high: (step * (top / step).ceil()).min(f64::MAX) }
            }
            AxisRange::Exactly if high > low => Self { logarithmic: false, low, high },
            AxisRange::Around | AxisRange::Exactly => {
                let span = if high > low { high - low } else { 0.1 * high.abs().max(1.0) };
                let step = nice_step(span, 4.0);
                let (low, high) = (step * (low / step).floor(), step * (high / step).ceil());
                Self { logarithmic: false, low, high: if high > low { high } else { low + step } }
            }
            AxisRange::Logarithmic => {
                let positive = || finite().filter(|value| *value >= f64::MIN_POSITIVE);
                let high = positive().fold(0.0, f64::max);
                if high == 0.0 {
                    return Self { logarithmic: true, low: 0.1, high: 1.0 };
                }
                let low = positive().fold(high, f64::min).max(high * 10_f64.powf(-DECADES));
                // Whole decades where there are several, halves of them where there is one.
                let (low, high) = (low.log10() - 0.02, high.log10() + 0.02);
                let part = if high - low > 2.5 { 1.0 } else { 0.25 };
                let (low, high) = (part * (low / part).floor(), part * (high / part).ceil());
                Self { logarithmic: true, low: 10_f64.powf(low), high: 10_f64.powf(high) }
            }
        }
    }

    /// Height of a value within the panel: 0 at the bottom, 1 at the top.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let position = if self.logarithmic {
            (value.max(self.low).log10() - self.low.log10()) / (self.high.log10() - self.low.log10())
        } else {
            (value - self.low) / (self.high - self.low)
        };
        position.clamp(0.0, 1.0)
    }

    /// Values to label.
    pub(crate) fn ticks(&self) -> Vec<f64> {
        if self.logarithmic {
            let (low, high) = (self.low.log10(), self.high.log10());
            if high - low < 2.5 {
                let first = low.floor() as i32;
                let all = (first..=high.ceil() as i32).flat_map(|d| [1.0, 2.0, 5.0].map(|m| m * 10_f64.powi(d)));
                let slack = 1.0 + 1e-9;
                return all.filter(|tick| *tick * slack >= self.low && *tick <= self.high * slack).collect();
            }
            let (low, high) = (low.round() as i32, high.round() as i32);
            let step = ((high - low) as usize).div_ceil(5);
            return (low..=high).step_by(step).map(|decade| 10_f64.powi(decade)).collect();
        }
        let step = nice_step(self.high - self.low, 4.0);
        let first = (self.low / step - 1e-9).ceil();
        let count = (self.high / step - first + 1e-9).floor() as usize;
        // Minus zero is written as such.
        (0..=count).map(|k| (first + k as f64) * step + 0.0).collect()
    }
}

/// The least of 1, 2 and 5 times a power of ten that divides `span` into no more than `parts`.
fn nice_step(span: f64, parts: f64) -> f64 {
    if span <= 0.0 {
        return 1.0;
    }
    let rough = span / parts;
    let decade = 10_f64.powf(rough.log10().floor());
    // The slack lets a span that is already a multiple of a step keep it.
    [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * decade).find(|step| *step >= rough * (1.0 - 1e-9)).unwrap_or(10.0 * decade)
}
