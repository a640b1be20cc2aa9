//! Positions as they are stored: floats, or whole numbers of 16 bits that the node scales.

/// The largest whole number that is stored.
const LARGEST: f64 = 32767.0;

/// The base and what targets add to it. A position is `centre + step × (base + Σ weight × target)`.
pub(super) struct Stored {
    pub(super) values: Values,
    pub(super) centre: [f32; 3],
    /// The distance of two whole numbers; 1 for floats.
    pub(super) step: f32,
    /// Numbers of the base and of each target.
    length: usize,
}

/// The base and the targets, one after another.
pub(super) enum Values {
    Floats(Vec<f32>),
    Shorts(Vec<i16>),
}

impl Stored {
    /// A base, with room for so many targets, which move by `reach` at the most.
    pub(super) fn base(base: &[f64], reach: f64, targets: usize, floats: bool) -> Self {
        let length = base.len();
        if floats {
            let mut values: Vec<f32> = base.iter().map(|&x| x as f32).collect();
            values.resize((targets + 1) * length, 0.0);
            return Self { values: Values::Floats(values), centre: [0.0; 3], step: 1.0, length };
        }
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for (k, &x) in base.iter().enumerate() {
            (low[k % 3], high[k % 3]) = (low[k % 3].min(x), high[k % 3].max(x));
        }
        let centre: [f32; 3] = std::array::from_fn(|k| (0.5 * (low[k] + high[k])) as f32);
        let half = (0..length).map(|k| (base[k] - f64::from(centre[k % 3])).abs()).fold(0.0, f64::max);
        // Motions larger than the model need larger steps, as weights are 1 at the most.
        let step = rounded_up(half.max(reach) / LARGEST);
        let whole = |(k, x): (usize, &f64)| ((x - f64::from(centre[k % 3])) / f64::from(step)).round() as i16;
        let mut values: Vec<i16> = base.iter().enumerate().map(whole).collect();
        values.resize((targets + 1) * length, 0);
        Self { values: Values::Shorts(values), centre, step, length }
    }

    /// Coordinates of the base as they are read.
    pub(super) fn base_values(&self) -> Vec<f64> {
        let step = f64::from(self.step);
        (0..self.length).map(|k| f64::from(self.centre[k % 3]) + step * self.number(k)).collect()
    }

    /// What a target is multiplied with to use all bits, and what its weights are then, by the largest number of it and of its weights.
    pub(super) fn scales(&self, largest: f64, heaviest: f64) -> [f64; 2] {
        if largest <= 0.0 || heaviest <= 0.0 {
            return [0.0, 0.0];
        }
        match self.values {
            Values::Floats(_) => [heaviest, 1.0 / heaviest],
            Values::Shorts(_) => [LARGEST / largest, largest / LARGEST / f64::from(self.step)],
        }
    }

    /// Stores numbers of a target from `first` on, and gives what they move by as they are read.
    pub(super) fn put(&mut self, target: usize, first: usize, numbers: &mut [f64]) {
        let step = f64::from(self.step);
        let start = (target + 1) * self.length + first;
        match &mut self.values {
            Values::Floats(values) => {
                for (value, x) in values[start..].iter_mut().zip(numbers) {
                    *value = *x as f32;
                    *x = f64::from(*value);
                }
            }
            Values::Shorts(values) => {
                for (value, x) in values[start..].iter_mut().zip(numbers) {
                    *value = x.round() as i16;
                    *x = step * f64::from(*value);
                }
            }
        }
    }

    fn number(&self, k: usize) -> f64 {
        match &self.values {
            Values::Floats(values) => values[k].into(),
            Values::Shorts(values) => values[k].into(),
        }
    }

    /// The base and the targets.
    pub(super) fn parts(&self) -> usize {
        let all = match &self.values {
            Values::Floats(values) => values.len(),
            Values::Shorts(values) => values.len(),
        };
        all / self.length
    }

    pub(super) fn points(&self) -> usize {
        self.length / 3
    }

    /// The smallest and the largest numbers of the base (0) or a target.
    pub(super) fn bounds(&self, part: usize) -> [[f64; 3]; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for k in 0..self.length {
            let x = self.number(part * self.length + k);
            (low[k % 3], high[k % 3]) = (low[k % 3].min(x), high[k % 3].max(x));
        }
        [low, high]
    }
}

/// The next single-precision number that is not smaller; 1 where there is nothing to divide.
fn rounded_up(x: f64) -> f32 {
    if x == 0.0 {
        return 1.0;
    }
    let near = (x as f32).max(f32::MIN_POSITIVE);
    if f64::from(near) < x { near.next_up() } else { near }
}
