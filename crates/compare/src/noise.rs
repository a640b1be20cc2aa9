//! Random numbers that depend on nothing but a seed: draws of rows, and noise on frames.

/// Radius of the paper's noise over the rest diagonal (Fig. 16).
pub(crate) const RADIUS: f64 = 0.3e-2;

/// A sequence of random numbers (SplitMix64: Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly distributed in −1…1.
    fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// `count` different numbers below `end`, in random order.
    ///
    /// # Panics
    /// Where there are not that many.
    pub(crate) fn choose(&mut self, count: usize, end: usize) -> Vec<u32> {
        assert!(count <= end, "{count} of {end}");
        let mut all: Vec<u32> = (0..end as u32).collect();
        for i in 0..count {
            let j = i + (self.next() % (end - i) as u64) as usize;
            all.swap(i, j);
        }
        all.truncate(count);
        all
    }

    /// Evenly distributed in the ball of radius one.
    fn in_ball(&mut self) -> [f64; 3] {
        loop {
            let p = [self.signed(), self.signed(), self.signed()];
            if p.iter().map(|x| x * x).sum::<f64>() <= 1.0 {
                return p;
            }
        }
    }
}

/// The frame with every point displaced at random within `radius`, by the frame's number.
pub(crate) fn noisy(points: &[f64], number: usize, radius: f64) -> Vec<f64> {
    let mut random = Random::new(number as u64);
    let mut out = points.to_vec();
    for point in out.chunks_exact_mut(3) {
        let shift = random.in_ball();
        for k in 0..3 {
            point[k] += radius * shift[k];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_stays_within_its_radius_and_fills_it() {
        let moved = noisy(&vec![0.0; 30_000], 7, 2.0);
        let lengths: Vec<f64> = moved.chunks_exact(3).map(|p| p.iter().map(|x| x * x).sum::<f64>().sqrt()).collect();
        let largest = lengths.iter().copied().fold(0.0, f64::max);
        let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
        // In a ball the mean distance from the centre is three quarters of the radius.
        assert!(largest <= 2.0 && largest > 1.99 && (mean - 1.5).abs() < 0.01, "{largest} {mean}");
        for k in 0..3 {
            let drift = moved.iter().skip(k).step_by(3).sum::<f64>() / 10_000.0;
            assert!(drift.abs() < 0.05, "{drift}");
        }
    }

    #[test]
    fn noise_is_that_of_its_frame() {
        let frame: Vec<f64> = (0..300).map(f64::from).collect();
        assert_eq!(noisy(&frame, 3, 0.1), noisy(&frame, 3, 0.1));
        assert_ne!(noisy(&frame, 3, 0.1), noisy(&frame, 4, 0.1));
    }

    #[test]
    fn chosen_numbers_differ_and_cover_the_range() {
        let mut chosen = Random::new(1).choose(100, 100);
        chosen.sort_unstable();
        assert_eq!(chosen, (0..100).collect::<Vec<u32>>());
        let some = Random::new(2).choose(10, 1_000_000);
        assert!(some.iter().any(|&x| x > 500_000) && some.iter().any(|&x| x < 500_000));
    }
}
