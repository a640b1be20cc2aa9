//! Colours of values.

/// Red, green and blue, each 0–1, as displayed.
pub(crate) type Rgb = [f32; 3];

/// A sequential colour map: pale grey through yellow and orange to dark red; lightness falls throughout, so that it reads in
/// grey and for every kind of colour vision.
const HEAT: [Rgb; 6] = [
    [0.855, 0.866, 0.882],
    [0.965, 0.878, 0.604],
    [0.973, 0.698, 0.353],
    [0.906, 0.451, 0.208],
    [0.722, 0.180, 0.157],
    [0.416, 0.012, 0.118],
];

/// A diverging one: blue, pale grey, vermilion, equally dark at both ends.
const SIGNED: [Rgb; 5] =
    [[0.020, 0.278, 0.541], [0.384, 0.612, 0.812], [0.886, 0.890, 0.894], [0.929, 0.565, 0.376], [0.655, 0.196, 0.043]];

/// A sequential scale from 0 to `top`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp {
    /// Value of the last colour; larger ones have it too.
    pub(crate) top: f64,
}

impl Ramp {
    /// Up to the value that all but a hundredth of the given ones stay below, so that one spike does not blacken the rest.
    pub(crate) fn over<'a>(values: impl Iterator<Item = &'a f64>) -> Self {
        let mut all: Vec<f64> = values.copied().filter(|x| x.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        let top = all.get(all.len().saturating_sub(1) * 99 / 100).copied().unwrap_or(0.0);
        Self { top: if top > 0.0 { top } else { 1.0 } }
    }

    /// Colour of a value.
    pub(crate) fn colour(self, value: f64) -> Rgb {
        between(&HEAT, value / self.top)
    }

    /// The same as stops of a CSS gradient.
    pub(crate) fn css() -> String {
        css(&HEAT)
    }
}

/// Colour of a value between −1 and 1.
pub(crate) fn diverging(value: f64) -> Rgb {
    between(&SIGNED, 0.5 + 0.5 * value)
}

/// [`diverging`] as stops of a CSS gradient.
pub(crate) fn diverging_css() -> String {
    css(&SIGNED)
}

fn css(stops: &[Rgb]) -> String {
    let stop = |c: &Rgb| format!("rgb({})", c.map(|x| format!("{:.0}", 255.0 * x)).join(","));
    stops.iter().map(stop).collect::<Vec<_>>().join(",")
}

/// Linear between the stops; what is not a number has the first colour.
fn between(stops: &[Rgb], position: f64) -> Rgb {
    let last = stops.len() - 1;
    let at = if position.is_nan() { 0.0 } else { position.clamp(0.0, 1.0) * last as f64 };
    let k = (at.floor() as usize).min(last - 1);
    let t = (at - k as f64) as f32;
    [0, 1, 2].map(|i| (1.0 - t) * stops[k][i] + t * stops[k + 1][i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_beyond_a_scale_have_the_colours_of_its_ends() {
        let ramp = Ramp { top: 2.0 };
        assert_eq!((ramp.colour(-1.0), ramp.colour(5.0)), (HEAT[0], HEAT[5]));
        assert_eq!((ramp.colour(f64::NAN), ramp.colour(2.0)), (HEAT[0], HEAT[5]));
        assert_eq!((diverging(-3.0), diverging(0.0), diverging(3.0)), (SIGNED[0], SIGNED[2], SIGNED[4]));
    }

    #[test]
    fn the_sequential_map_darkens_throughout() {
        let light = |c: Rgb| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        let ramp = Ramp { top: 1.0 };
        let steps: Vec<f32> = (0..=50).map(|i| light(ramp.colour(f64::from(i) / 50.0))).collect();
        assert!(steps.windows(2).all(|w| w[1] < w[0] + 0.012), "{steps:?}");
        assert!(steps[0] - steps[50] > 0.7);
    }

    #[test]
    fn one_spike_does_not_set_the_scale() {
        let mut values = vec![1.0; 1000];
        values[3] = 1e6;
        assert_eq!(Ramp::over(values.iter()).top, 1.0);
        assert_eq!(Ramp::over([].iter()).top, 1.0);
    }
}
