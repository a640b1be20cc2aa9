//! Positions as they are stored: floats, or whole numbers of 16 bits that the node scales.

const LARGEST: f64 = 32767.0;

/// The base and what targets add to it: positions are `centre + step × (base + Σ weight × target)`.
pub(super) struct Stored {
    /// The base and the targets, one after another.
    pub(super) values: Vec<f32>,
    /// Whether these are not whole numbers of 16 bits.
    pub(super) is_float: bool,
    pub(super) centre: [f32; 3],
    /// The distance of two whole numbers; 1 for floats.
    pub(super) step: f32,
    /// Numbers of the base and of each target.
    length: usize,
}

impl Stored {
    /// A base, with room for so many targets, which move by `reach` at the most.
    pub(super) fn base(base: &[f64], reach: f64, targets: usize, is_float: bool) -> Self {
        let (length, mut centre, mut step) = (base.len(), [0.0; 3], 1.0);
        if !is_float {
            let [low, high] = bounds(base.iter().copied());
            centre = std::array::from_fn(|k| (0.5 * (low[k] + high[k])) as f32);
            let half = (0..length).map(|k| (base[k] - f64::from(centre[k % 3])).abs()).fold(0.0, f64::max);
            // Motions larger than the model need larger steps, as weights are 1 at the most.
            step = rounded_up(half.max(reach) / LARGEST);
        }
        let mut stored = Self { values: vec![0.0; (targets + 1) * length], is_float, centre, step, length };
        for (k, x) in base.iter().enumerate() {
            stored.values[k] = stored.rounded((x - f64::from(centre[k % 3])) / f64::from(step));
        }
        stored
    }

    fn rounded(&self, x: f64) -> f32 {
        if self.is_float { x as f32 } else { (x.round() as i16).into() }
    }

    /// Coordinates of the base as they are read.
    pub(super) fn base_values(&self) -> Vec<f64> {
        let step = f64::from(self.step);
        (0..self.length).map(|k| f64::from(self.centre[k % 3]) + step * f64::from(self.values[k])).collect()
    }

    /// By the largest number of a target and of its weights: what it is multiplied with to use all
    /// bits, and what its weights are then.
    pub(super) fn scales(&self, largest: f64, heaviest: f64) -> [f64; 2] {
        if largest <= 0.0 || heaviest <= 0.0 {
            return [0.0, 0.0];
        }
        if self.is_float {
            return [heaviest, 1.0 / heaviest];
        }
        [LARGEST / largest, largest / LARGEST / f64::from(self.step)]
    }

    /// Stores numbers of a target from `first` on, and gives what they move by as they are read.
    pub(super) fn put(&mut self, target: usize, first: usize, numbers: &mut [f64]) {
        let start = (target + 1) * self.length + first;
        for (k, x) in (start..).zip(numbers) {
            self.values[k] = self.rounded(*x);
            *x = f64::from(self.step) * f64::from(self.values[k]);
        }
    }

    pub(super) fn parts(&self) -> usize {
        self.values.len() / self.length
    }

    pub(super) fn points(&self) -> usize {
        self.length / 3
    }

    /// The numbers of a point of the base (0) or a target.
    pub(super) fn at(&self, part: usize, point: u32) -> [f32; 3] {
        let first = part * self.length + 3 * point as usize;
        [self.values[first], self.values[first + 1], self.values[first + 2]]
    }

    /// The smallest and the largest numbers of points of the base or a target.
    pub(super) fn bounds(&self, part: usize, points: &[u32]) -> [[f64; 3]; 2] {
        bounds(points.iter().flat_map(|&point| self.at(part, point)).map(f64::from))
    }
}

fn bounds(numbers: impl Iterator<Item = f64>) -> [[f64; 3]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (k, x) in numbers.enumerate() {
        (low[k % 3], high[k % 3]) = (low[k % 3].min(x), high[k % 3].max(x));
    }
    [low, high]
}

/// The next single-precision number that is not smaller; 1 where there is nothing to divide.
fn rounded_up(x: f64) -> f32 {
    if x == 0.0 {
        return 1.0;
    }
    let near = (x as f32).max(f32::MIN_POSITIVE);
    if f64::from(near) < x { near.next_up() } else { near }
}
