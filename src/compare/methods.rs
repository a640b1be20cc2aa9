//! What is compared: which points an inversion reads, and how it treats the unstable end of the spectrum.

use cager_core::inversion::{Handles, SolverOptions};
use cager_core::regularize::Regularizer;
use serde::{Serialize, Serializer};

/// Spectrum thresholds of the paper's figures.
const THRESHOLDS: [usize; 5] = [0, 5, 20, 50, 100];

/// One way to invert.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Method {
    /// Points read, as on the command line.
    #[serde(serialize_with = "handles_name")]
    pub(crate) handles: Handles,
    /// Treatment of the spectrum, as on the command line.
    #[serde(serialize_with = "regularizer_name")]
    pub(crate) regularizer: Regularizer,
    /// Spectrum threshold s.
    pub(crate) spectrum: usize,
    /// Weight λ; α for Tikhonov.
    pub(crate) lambda: f64,
    /// Its colour: a class of the report's style sheet.
    #[serde(skip)]
    pub(crate) class: &'static str,
    /// Whether the error curves show it; the tables show every method.
    #[serde(skip)]
    pub(crate) curve: bool,
}

fn handles_name<S: Serializer>(handles: &Handles, out: S) -> Result<S::Ok, S::Error> {
    out.serialize_str(handles.name())
}

fn regularizer_name<S: Serializer>(regularizer: &Regularizer, out: S) -> Result<S::Ok, S::Error> {
    out.serialize_str(regularizer.name())
}

impl Method {
    fn new(handles: Handles, regularizer: Regularizer, spectrum: usize) -> Self {
        let mut method = Self { handles, regularizer, spectrum, lambda: 1.0, class: "", curve: false };
        method.class = method.colour();
        method
    }

    /// One colour for each pair of points read and treatment, whatever the threshold.
    fn colour(&self) -> &'static str {
        match (self.handles, self.regularizer) {
            (Handles::All, Regularizer::None) => "k-all",
            (Handles::All, Regularizer::Global) => "k-all-global",
            (Handles::All, _) => "k-all-sub",
            (Handles::MaxVol, Regularizer::None) => "k-maxvol",
            (Handles::MaxVol, Regularizer::Laplacian) => "k-cager",
            (Handles::MaxVol, Regularizer::Global) => "k-maxvol-global",
            (Handles::MaxVol, Regularizer::TruncatedSvd) => "k-truncated",
            (Handles::MaxVol, Regularizer::Tikhonov) => "k-tikhonov",
            (Handles::MaxVol, Regularizer::Differential) => "k-differential",
            (Handles::MaxVol, Regularizer::Temporal) => "k-temporal",
            (Handles::Spread { .. }, Regularizer::None) => "k-spread-data",
            (Handles::Spread { .. }, Regularizer::Differential) => "k-usual",
            (Handles::Spread { .. }, _) => "k-spread",
            (Handles::Rectangular { .. }, Regularizer::None) => "k-rectangular-data",
            (Handles::Rectangular { .. }, _) => "k-rectangular",
            (Handles::MaxVol, Regularizer::Matrix) => "k-other",
        }
    }

    /// In words, for tables and legends.
    pub(crate) fn name(&self) -> String {
        let read = match self.handles {
            Handles::All => "all points",
            other => other.name(),
        };
        let s = self.spectrum;
        match self.regularizer {
            Regularizer::None => format!("{read}, data alone"),
            Regularizer::Laplacian => format!("{read}, sub-spectral s = {s}"),
            Regularizer::TruncatedSvd => format!("{read}, truncated s = {s}"),
            Regularizer::Tikhonov => format!("{read}, Tikhonov α = {:.2}", self.lambda),
            Regularizer::Global => format!("{read}, global λ = {}", self.lambda),
            other => format!("{read}, {} s = {s}", other.name()),
        }
    }

    /// As [`Self::name`], without the threshold.
    pub(crate) fn family(&self) -> String {
        let name = self.name();
        name.split(" s = ").next().map_or(name.clone(), str::to_owned)
    }

    /// Whether its line is dashed, as a second mark beside its colour.
    pub(crate) fn is_dashed(&self) -> bool {
        !(self.regularizer == Regularizer::None || self.regularizer.is_sub_spectral())
    }

    /// The options of `cager encode` that choose it.
    pub(crate) fn flags(&self) -> String {
        let mut flags = format!("--handles {} --regularizer {}", self.handles.name(), self.regularizer.name());
        if self.regularizer.has_threshold() {
            flags += &format!(" --spectrum {}", self.spectrum);
        }
        if !matches!(self.regularizer, Regularizer::None | Regularizer::TruncatedSvd) {
            flags += &format!(" --lambda {}", self.lambda);
        }
        flags
    }

    /// The options of its solver.
    pub(crate) fn options(&self) -> SolverOptions {
        SolverOptions {
            handles: self.handles,
            regularizer: self.regularizer,
            spectrum: self.spectrum,
            lambda: self.lambda,
        }
    }

    /// Whether it is plain least squares over all points, which the paper compares with.
    pub(crate) fn is_full_least_squares(&self) -> bool {
        self.handles == Handles::All && self.regularizer == Regularizer::None
    }

    /// Whether it is what the paper proposes, at any threshold.
    pub(crate) fn is_cager(&self) -> bool {
        self.handles == Handles::MaxVol && self.regularizer == Regularizer::Laplacian
    }
}

/// The methods to compare on a cage with these unknowns; `usual` is the usual threshold, `damping` the singular value there, from
/// which Tikhonov's α is. Where every frame is measured, `in_order`, those that depend on the previous frame as well.
pub(crate) fn methods(unknowns: usize, usual: usize, damping: f64, in_order: bool) -> Vec<Method> {
    let mut thresholds: Vec<usize> = THRESHOLDS.into_iter().chain([usual]).filter(|&s| s <= unknowns).collect();
    thresholds.sort_unstable();
    thresholds.dedup();
    let curve = |method: Method| Method { curve: true, ..method };
    let mut all = Vec::new();
    for handles in [Handles::All, Handles::MaxVol] {
        for &s in &thresholds {
            let regularizer = if s == 0 { Regularizer::None } else { Regularizer::Laplacian };
            let method = Method::new(handles, regularizer, s);
            all.push(Method { curve: s == 0 || s == usual, ..method });
        }
        all.push(curve(Method::new(handles, Regularizer::Global, 0)));
    }
    for handles in [Handles::Rectangular { count: None }, Handles::Spread { count: None }] {
        all.push(Method::new(handles, Regularizer::None, 0));
        all.push(curve(Method::new(handles, Regularizer::Laplacian, usual)));
    }
    all.push(curve(Method::new(Handles::Spread { count: None }, Regularizer::Differential, usual)));
    all.push(Method::new(Handles::MaxVol, Regularizer::Differential, usual));
    if in_order {
        all.push(Method::new(Handles::MaxVol, Regularizer::Temporal, usual));
    }
    all.push(curve(Method::new(Handles::MaxVol, Regularizer::TruncatedSvd, usual)));
    all.push(Method { lambda: damping, ..Method::new(Handles::MaxVol, Regularizer::Tikhonov, 0) });
    all
}
