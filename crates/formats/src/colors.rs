//! Colours of vertices, from what files say of them.

/// What the values of colours are.
#[derive(Clone, Copy)]
pub(crate) enum Scale {
    /// Fractions of full light.
    Fractions,
    /// Fractions, or of 255: the file does not say.
    Unsaid,
}

/// The colours of vertices; none at all where one vertex has none, or one that is no colour.
#[derive(Default)]
pub(crate) struct Colors {
    found: Vec<[f32; 3]>,
}

impl Colors {
    pub(crate) fn push(&mut self, color: [f32; 3]) {
        self.found.push(color);
    }

    /// In sRGB for so many points. Values of a scale that is not said are of 255 if one is above 2,
    /// or if all are whole and one is above 1; fractions a little above 1 are full light.
    pub(crate) fn finish(self, points: usize, scale: Scale) -> Vec<[u8; 3]> {
        let all = || self.found.iter().flatten().copied();
        let largest = all().fold(0.0, f32::max);
        let of_bytes = largest > 2.0 || largest > 1.0 && all().all(|x| x.fract() == 0.0);
        let (most, full) = match scale {
            Scale::Fractions => (1.0, 1.0),
            Scale::Unsaid if of_bytes => (255.0, 255.0),
            Scale::Unsaid => (2.0, 1.0),
        };
        if self.found.len() != points || !all().all(|x| (0.0..=most).contains(&x)) {
            return Vec::new();
        }
        self.found.iter().map(|color| color.map(|x| (255.0 / full * x).round() as u8)).collect()
    }
}

/// A fraction of linear light in sRGB (IEC 61966-2-1).
pub(crate) fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear light of a fraction in sRGB.
#[cfg(feature = "fbx")]
pub(crate) fn linear(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finished(colors: &[[f32; 3]], points: usize, scale: Scale) -> Vec<[u8; 3]> {
        let mut found = Colors::default();
        colors.iter().for_each(|&color| found.push(color));
        found.finish(points, scale)
    }

    #[test]
    fn fractions_and_bytes_are_told_apart() {
        let unsaid = |colors: &[[f32; 3]]| finished(colors, colors.len(), Scale::Unsaid);
        assert_eq!(unsaid(&[[0.0, 0.5, 1.0], [1.0; 3]]), [[0, 128, 255], [255; 3]]);
        assert_eq!(unsaid(&[[0.0, 1.0, 200.0], [255.0; 3]]), [[0, 1, 200], [255; 3]]);
        assert_eq!(unsaid(&[[0.0, 1.0, 2.0]]), [[0, 1, 2]]);
        assert_eq!(unsaid(&[[0.0, 0.5, 1.000_001]]), [[0, 128, 255]]);
    }

    #[test]
    fn what_is_no_colour_or_not_there_for_every_point_is_left_out() {
        assert!(finished(&[[0.5; 3]], 2, Scale::Unsaid).is_empty());
        for bad in [f32::NAN, -0.1, 256.0, f32::INFINITY] {
            for scale in [Scale::Unsaid, Scale::Fractions] {
                assert!(finished(&[[0.5; 3], [0.5, bad, 0.5]], 2, scale).is_empty(), "{bad}");
            }
        }
        assert!(finished(&[[0.5, 1.18, 0.5]], 1, Scale::Fractions).is_empty());
    }

    #[test]
    fn light_is_turned_to_srgb() {
        for (linear, wanted) in [(0.0, 0.0), (0.002, 0.025_84), (0.214_041_14, 0.5), (1.0, 1.0)] {
            assert!((srgb(linear) - wanted).abs() < 1e-5, "{linear}: {}", srgb(linear));
        }
    }
}
