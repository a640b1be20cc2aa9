//! Colours of vertices, from what files say of them.

/// The colours of vertices as they are read; none at all where one vertex has none, or one that is no colour.
#[derive(Default)]
pub(super) struct Colors {
    found: Vec<[f32; 3]>,
}

impl Colors {
    pub(super) fn push(&mut self, color: [f32; 3]) {
        self.found.push(color);
    }

    /// In sRGB for so many points: values are fractions, or of 255 where one is larger than 1.
    pub(super) fn finish(self, points: usize) -> Vec<[u8; 3]> {
        let all = || self.found.iter().flatten().copied();
        let most = all().fold(0.0, f32::max);
        if self.found.len() != points || !all().all(|x| (0.0..=255.0).contains(&x)) {
            return Vec::new();
        }
        let scale = if most > 1.0 { 1.0 } else { 255.0 };
        self.found.iter().map(|color| color.map(|x| (scale * x).round() as u8)).collect()
    }
}

/// A fraction of linear light in sRGB (IEC 61966-2-1).
pub(super) fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finished(colors: &[[f32; 3]], points: usize) -> Vec<[u8; 3]> {
        let mut found = Colors::default();
        colors.iter().for_each(|&color| found.push(color));
        found.finish(points)
    }

    #[test]
    fn fractions_and_bytes_are_told_apart() {
        assert_eq!(finished(&[[0.0, 0.5, 1.0], [1.0; 3]], 2), [[0, 128, 255], [255; 3]]);
        assert_eq!(finished(&[[0.0, 1.0, 200.0], [255.0; 3]], 2), [[0, 1, 200], [255; 3]]);
    }

    #[test]
    fn what_is_no_colour_or_not_there_for_every_point_is_left_out() {
        assert!(finished(&[[0.5; 3]], 2).is_empty());
        for bad in [f32::NAN, -0.1, 256.0, f32::INFINITY] {
            assert!(finished(&[[0.5; 3], [0.5, bad, 0.5]], 2).is_empty(), "{bad}");
        }
    }

    #[test]
    fn light_is_turned_to_srgb() {
        for (linear, wanted) in [(0.0, 0.0), (0.002, 0.025_84), (0.214_041_14, 0.5), (1.0, 1.0)] {
            assert!((srgb(linear) - wanted).abs() < 1e-5, "{linear}: {}", srgb(linear));
        }
    }
}
