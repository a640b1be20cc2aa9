//! Where the topology of a subject changes for good, told by scores alone.

/// Frames on both sides of a change that are compared with each other.
const BESIDE: usize = 4;
/// The best of the frames after a change scores so many times the worst of those before.
const STEP: f64 = 1.25;
/// So do all frames to the end, but a tenth, against all frames before, but a tenth.
const TO_THE_END: f64 = 1.25;
/// Nothing has changed where templates lie as well as this, a share of the diagonal.
const LIES_WELL: f64 = 1e-3;

/// The first frame from which a template lies worse all at once and to the end, if any. Scores that
/// are not finite count for nothing.
pub fn changed_for_good(scores: &[f64]) -> Option<usize> {
    let (frames, scores): (Vec<usize>, Vec<f64>) =
        scores.iter().copied().enumerate().filter(|(_, score)| score.is_finite()).unzip();
    let step = |k: usize| {
        let best = scores[k..k + BESIDE].iter().copied().fold(f64::INFINITY, f64::min);
        best / scores[k - BESIDE..k].iter().copied().fold(0.0, f64::max)
    };
    let lasts = |k: usize| {
        let (before, after) = (tenth(&scores[..k], 9), tenth(&scores[k..], 1));
        after > LIES_WELL && after > TO_THE_END * before
    };
    // Few frames are a step, and to see whether one lasts all scores have to be sorted.
    let (_, k) = (BESIDE..(scores.len() + 1).saturating_sub(BESIDE))
        .map(|k| (step(k), k))
        .filter(|&(step, k)| step > STEP && lasts(k))
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(frames[k])
}

/// The score that so many tenths of all do not reach.
fn tenth(scores: &[f64], tenths: usize) -> f64 {
    let mut scores = scores.to_vec();
    scores.sort_by(f64::total_cmp);
    scores[(scores.len() - 1) * tenths / 10]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scores that go up and down around a level, as poses do.
    fn around(level: f64, frames: usize) -> impl Iterator<Item = f64> {
        (0..frames).map(move |k| level * (1.0 + 0.15 * (0.4 * k as f64).sin() + 0.05 * (2.3 * k as f64).cos()))
    }

    #[test]
    fn a_step_to_the_end_is_a_change_and_passing_trouble_or_slow_drift_is_none() {
        let change: Vec<f64> = around(0.003, 40).chain(around(0.006, 20)).collect();
        assert_eq!(changed_for_good(&change), Some(40));
        let early: Vec<f64> = around(0.003, 5).chain(around(0.008, 60)).collect();
        assert_eq!(changed_for_good(&early), Some(5));
        let mut gaps = change;
        gaps[3] = f64::INFINITY;
        gaps[50] = f64::INFINITY;
        assert_eq!(changed_for_good(&gaps), Some(40));

        let steady: Vec<f64> = around(0.003, 60).collect();
        let passing: Vec<f64> = around(0.003, 20).chain(around(0.008, 20)).chain(around(0.003, 20)).collect();
        let drift: Vec<f64> = (0..60).map(|k| 0.002 + 1e-4 * f64::from(k)).collect();
        let exact: Vec<f64> = around(1e-5, 20).chain(around(1e-4, 20)).collect();
        for scores in [&steady[..], &passing, &drift, &exact, &steady[..3], &[]] {
            assert_eq!(changed_for_good(scores), None, "{scores:?}");
        }
    }
}
