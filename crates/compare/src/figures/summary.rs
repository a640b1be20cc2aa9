//! Recommended options, and the paper's claims checked on this capture.

use super::{MethodFigures, NoiseFigures, System, SystemFigures};
use crate::methods::Method;
use crate::noise::RADIUS;
use cager_core::coordinates::{CoordinateSystem, Green};
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;
use serde::Serialize;

/// A method is accurate where its mean L2 is at most this many times the lowest of its system.
const ACCURATE: f64 = 1.4;
/// Relative differences below this do not count.
const CLEAR: f64 = 0.02;

/// What the figures advise.
#[derive(Clone, Debug, Serialize)]
pub struct Recommendation {
    /// The method whose cages move most smoothly among the accurate ones.
    pub editing: Option<Choice>,
    /// The method of the lowest error.
    pub accuracy: Option<Choice>,
    /// Bound on the mean L2 of the accurate ones, as a multiple of the lowest of their system:
    /// systems that follow the capture more closely by cages full of spikes do not rule out the
    /// others.
    pub(crate) accurate: f64,
}

/// A method of a system.
#[derive(Clone, Debug, Serialize)]
pub struct Choice {
    pub(crate) system: String,
    pub(crate) method: String,
    /// Options of `cager encode`.
    pub flags: String,
    /// Mean L2.
    pub l2_mean: f64,
    pub(crate) smoothness: f64,
    pub(crate) smoothness_of: Smoothness,
}

/// What the smoothness of cages is measured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Smoothness {
    /// The second temporal difference of a cage vertex, over the rest diagonal.
    SecondDifference,
    /// The change of an edge's length over the mean one, where no three frames follow each other.
    Edges,
}

/// Chooses among all methods of all systems.
pub(crate) fn recommend(systems: &[System]) -> Recommendation {
    let all: Vec<Vec<Choice>> = systems.iter().map(choices).collect();
    let least = |of: &mut dyn Iterator<Item = &Choice>, by: fn(&Choice) -> f64| {
        of.min_by(|a, b| by(a).total_cmp(&by(b))).cloned()
    };
    let accuracy = least(&mut all.iter().flatten(), |c| c.l2_mean);
    let accurate = |of: &[Choice]| {
        let bound = ACCURATE * of.iter().map(|c| c.l2_mean).fold(f64::INFINITY, f64::min);
        of.iter().filter(|c| c.l2_mean <= bound && c.smoothness.is_finite()).cloned().collect::<Vec<_>>()
    };
    // Cages with normals of their own are not edited.
    let editable = all.iter().flat_map(|of| accurate(of)).filter(|c| c.system != Green::Free.name());
    let editing = least(&mut editable.collect::<Vec<_>>().iter(), |c| c.smoothness);
    Recommendation { editing, accuracy, accurate: ACCURATE }
}

fn choices(system: &System) -> Vec<Choice> {
    let Some(figures) = &system.figures else { return Vec::new() };
    let choice = |found: &MethodFigures| {
        let (smoothness, smoothness_of) = match found.totals.spike_mean {
            mean if mean.is_finite() => (mean, Smoothness::SecondDifference),
            _ => (found.totals.edges_mean, Smoothness::Edges),
        };
        Choice {
            system: system.name.clone(),
            method: found.method.name(),
            flags: format!("--coordinates {} {}", system.name, found.method.flags()),
            l2_mean: found.totals.l2_mean,
            smoothness,
            smoothness_of,
        }
    };
    figures.methods.iter().map(choice).filter(|c| c.l2_mean.is_finite()).collect()
}

/// Whether a claim holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Verdict {
    Holds,
    /// The figures do not differ clearly, or agree in part.
    InPart,
    Fails,
}

/// A statement of the paper, measured.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Claim {
    /// Coordinate system it was measured with.
    pub(crate) system: String,
    pub(crate) statement: &'static str,
    pub(crate) source: &'static str,
    pub(crate) measured: String,
    pub(crate) verdict: Verdict,
}

/// The paper's claims, held against every system that could be computed.
pub(crate) fn claims(systems: &[System]) -> Vec<Claim> {
    let mut all = Vec::new();
    for system in systems {
        let Some(figures) = system.figures.as_deref() else { continue };
        let found = [
            condition(figures),
            swaps(figures),
            random(figures),
            maxvol_spikes(figures),
            sub_spectral(figures),
            rival(figures),
            localised(figures),
            noise(figures),
        ];
        all.extend(found.into_iter().flatten().map(|claim| Claim { system: system.name.clone(), ..claim }));
    }
    all
}

fn claim(statement: &'static str, source: &'static str, measured: String, verdict: Verdict) -> Option<Claim> {
    Some(Claim { system: String::new(), statement, source, measured, verdict })
}

/// Of two figures of which the first should be the lower one.
fn lower(first: f64, second: f64) -> Verdict {
    if first < second * (1.0 - CLEAR) {
        Verdict::Holds
    } else if first <= second * (1.0 + CLEAR) {
        Verdict::InPart
    } else {
        Verdict::Fails
    }
}

fn both(a: Verdict, b: Verdict) -> Verdict {
    match (a, b) {
        (Verdict::Holds, Verdict::Holds) => Verdict::Holds,
        (Verdict::Fails, Verdict::Fails) => Verdict::Fails,
        _ => Verdict::InPart,
    }
}

fn condition(figures: &SystemFigures) -> Option<Claim> {
    let spectra = &figures.spectra;
    claim(
        "Maxvol lowers the condition number of the system.",
        "§4.3, Fig. 9",
        format!(
            "Φ□ {:.1}, Φ {:.1}, ΦᵀΦ {:.0}",
            spectra.condition_handles, spectra.condition_full, spectra.condition_normal
        ),
        lower(spectra.condition_handles, spectra.condition_full),
    )
}

fn swaps(figures: &SystemFigures) -> Option<Claim> {
    let trace = figures.swaps.from_random.as_ref()?;
    let (first, last) = (*trace.condition.first()?, *trace.condition.last()?);
    let rises = trace.log_volume.windows(2).all(|w| w[1] >= w[0]);
    claim(
        "With the swaps the volume rises and the condition number falls.",
        "§4.3, Fig. 4",
        format!("{} swaps from a random start: condition {first:.0} to {last:.1}", trace.swaps()),
        both(if rises { Verdict::Holds } else { Verdict::Fails }, lower(last, first)),
    )
}

fn random(figures: &SystemFigures) -> Option<Claim> {
    let maxvol = usual(figures)?;
    let drawn = figures.random.iter().filter(|draw| draw.choice.starts_with("random"));
    let mut l2: Vec<f64> = drawn.map(|draw| draw.totals.l2_mean).collect();
    l2.sort_by(f64::total_cmp);
    let (best, median) = (*l2.first()?, l2[l2.len() / 2]);
    claim(
        "As many points chosen at random reconstruct poorly.",
        "§4.2, Fig. 3",
        format!(
            "mean L2 of {} draws: median {}, best {}; maxvol {}",
            l2.len(),
            percent(median),
            percent(best),
            percent(maxvol.totals.l2_mean)
        ),
        both(lower(maxvol.totals.l2_mean, median), lower(maxvol.totals.l2_mean, best)),
    )
}

fn maxvol_spikes(figures: &SystemFigures) -> Option<Claim> {
    let full = figures.method(Method::is_full_least_squares)?;
    let maxvol = figures.method(|m| m.is(Handles::MaxVol, Regularizer::None))?;
    spikes_known(&[full, maxvol])?;
    claim(
        "Maxvol alone removes many of the cage's instabilities, at a slightly higher error.",
        "§4.3, Figs. 8, 20",
        format!(
            "mean spike {} against {} of full least squares, largest {} against {}; mean L2 {} against {}",
            percent(maxvol.totals.spike_mean),
            percent(full.totals.spike_mean),
            percent(maxvol.totals.spike_max),
            percent(full.totals.spike_max),
            percent(maxvol.totals.l2_mean),
            percent(full.totals.l2_mean)
        ),
        both(
            lower(maxvol.totals.spike_mean, full.totals.spike_mean),
            lower(maxvol.totals.spike_max, full.totals.spike_max),
        ),
    )
}

fn spikes_known(methods: &[&MethodFigures]) -> Option<()> {
    methods.iter().all(|m| m.totals.spike_mean.is_finite()).then_some(())
}

/// The paper's method at the usual threshold, which is the one the error curves show.
fn usual(figures: &SystemFigures) -> Option<&MethodFigures> {
    figures.method(|m| m.is_cager() && m.curve)
}

fn sub_spectral(figures: &SystemFigures) -> Option<Claim> {
    let (cager, plain) = (usual(figures)?, figures.method(|m| m.is(Handles::MaxVol, Regularizer::None))?);
    let global = figures.method(|m| m.is(Handles::MaxVol, Regularizer::Global))?;
    spikes_known(&[cager, plain])?;
    claim(
        "Regularising the end of the spectrum lowers spikes, and costs less accuracy than regularising all of it at the same λ.",
        "§5.2, Fig. 13",
        format!(
            "mean spike {} against {} without; mean L2 {}, global {}, without {}",
            percent(cager.totals.spike_mean),
            percent(plain.totals.spike_mean),
            percent(cager.totals.l2_mean),
            percent(global.totals.l2_mean),
            percent(plain.totals.l2_mean)
        ),
        both(
            lower(cager.totals.spike_mean, plain.totals.spike_mean),
            lower(cager.totals.l2_mean, global.totals.l2_mean),
        ),
    )
}

fn rival(figures: &SystemFigures) -> Option<Claim> {
    let cager = usual(figures)?;
    let rival = figures.method(|m| m.is(Handles::All, Regularizer::Global))?;
    claim(
        "The method is more accurate than globally regularised least squares over all points.",
        "§6.3, Fig. 18",
        format!("mean L2 {} against {}", percent(cager.totals.l2_mean), percent(rival.totals.l2_mean)),
        lower(cager.totals.l2_mean, rival.totals.l2_mean),
    )
}

fn localised(figures: &SystemFigures) -> Option<Claim> {
    let vectors = &figures.vectors;
    claim(
        "The last singular vectors live on few vertices of the cage.",
        "§5.2, Fig. 11",
        format!(
            "the first tenth live on {:.0} of {} unknowns on average, the last tenth on {:.1}",
            vectors.spread_first, figures.unknowns, vectors.spread_last
        ),
        lower(2.0 * vectors.spread_last, vectors.spread_first),
    )
}

fn noise(figures: &SystemFigures) -> Option<Claim> {
    let noisy: &NoiseFigures = figures.noise.iter().find(|n| n.method.is_cager())?;
    let clean = figures.method(|m| *m == noisy.method)?;
    let rise = noisy.totals.linf_max - clean.totals.linf_max;
    claim(
        "Noise on the capture raises the largest L∞ by no more than about its own size.",
        "§6.2, Fig. 16",
        format!(
            "{} of noise: largest L∞ {} against {}, a difference of {}",
            percent(RADIUS),
            percent(noisy.totals.linf_max),
            percent(clean.totals.linf_max),
            percent(rise)
        ),
        bounded(rise / RADIUS),
    )
}

/// Of what should be no more than about one.
fn bounded(size: f64) -> Verdict {
    if size <= 1.5 {
        Verdict::Holds
    } else if size <= 3.0 {
        Verdict::InPart
    } else {
        Verdict::Fails
    }
}

/// A fraction in percent.
fn percent(fraction: f64) -> String {
    format!("{:.3} %", 100.0 * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_follow_the_figures() {
        assert_eq!(lower(1.0, 2.0), Verdict::Holds);
        assert_eq!(lower(1.0, 1.0), Verdict::InPart);
        assert_eq!(lower(2.0, 1.0), Verdict::Fails);
        assert_eq!(lower(f64::NAN, 1.0), Verdict::Fails);
        let sizes = [-9.0, 0.0, 1.2, 2.0, 4.0, f64::NAN].map(bounded);
        assert_eq!(sizes[..3], [Verdict::Holds; 3]);
        assert_eq!(sizes[3..], [Verdict::InPart, Verdict::Fails, Verdict::Fails]);
        assert_eq!(both(Verdict::Holds, Verdict::Fails), Verdict::InPart);
    }

    #[test]
    fn nothing_computed_recommends_nothing() {
        let refused = System { name: "harmonic".to_owned(), refused: Some("no".to_owned()), figures: None };
        let advice = recommend(std::slice::from_ref(&refused));
        assert!(advice.editing.is_none() && advice.accuracy.is_none() && claims(&[refused]).is_empty());
    }
}
