//! What is compared: which points an inversion reads, and how it treats the spectrum's end.

use cager_core::inversion::{Handles, SolverOptions};
use cager_core::regularize::Regularizer;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Spectrum thresholds of the paper's figures.
const THRESHOLDS: [usize; 5] = [0, 5, 20, 50, 100];

/// One way to invert.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Method {
    /// λ is α for Tikhonov.
    pub(crate) options: SolverOptions,
    /// Whether curves, cages and models of it are shown; the tables show every method.
    pub(crate) curve: bool,
}

/// With its name in words, and with names as on the command line.
impl Serialize for Method {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        let mut fields = out.serialize_struct("Method", 6)?;
        fields.serialize_field("name", &self.name())?;
        fields.serialize_field("handles", self.options.handles.name())?;
        fields.serialize_field("regularizer", self.options.regularizer.name())?;
        fields.serialize_field("spectrum", &self.options.spectrum)?;
        fields.serialize_field("lambda", &self.options.lambda)?;
        fields.serialize_field("curve", &self.curve)?;
        fields.end()
    }
}

impl Method {
    fn new(handles: Handles, regularizer: Regularizer, spectrum: usize) -> Self {
        Self { options: SolverOptions { handles, regularizer, spectrum, lambda: 1.0 }, curve: false }
    }

    /// In words, for tables and legends.
    pub(crate) fn name(&self) -> String {
        let read = match self.options.handles {
            Handles::All => "all points",
            other => other.name(),
        };
        let s = self.options.spectrum;
        match self.options.regularizer {
            Regularizer::None => format!("{read}, data alone"),
            Regularizer::Laplacian => format!("{read}, sub-spectral s = {s}"),
            Regularizer::TruncatedSvd => format!("{read}, truncated s = {s}"),
            Regularizer::Tikhonov => format!("{read}, Tikhonov α = {:.2}", self.options.lambda),
            Regularizer::Global => format!("{read}, global λ = {}", self.options.lambda),
            other => format!("{read}, {} s = {s}", other.name()),
        }
    }

    /// The options of `cager encode` that choose it.
    pub(crate) fn flags(&self) -> String {
        let mut flags =
            format!("--handles {} --regularizer {}", self.options.handles.name(), self.options.regularizer.name());
        if self.options.regularizer.has_threshold() {
            flags += &format!(" --spectrum {}", self.options.spectrum);
        }
        if !matches!(self.options.regularizer, Regularizer::None | Regularizer::TruncatedSvd) {
            flags += &format!(" --lambda {}", self.options.lambda);
        }
        flags
    }

    /// Whether it reads these points and treats the spectrum so, at any threshold.
    pub(crate) fn is(&self, handles: Handles, regularizer: Regularizer) -> bool {
        (self.options.handles, self.options.regularizer) == (handles, regularizer)
    }

    /// Whether it is plain least squares over all points, which the paper compares with.
    pub(crate) fn is_full_least_squares(&self) -> bool {
        self.is(Handles::All, Regularizer::None)
    }

    /// Whether it is what the paper proposes, at any threshold.
    pub(crate) fn is_cager(&self) -> bool {
        self.is(Handles::MaxVol, Regularizer::Laplacian)
    }
}

/// The methods to compare on a cage with these unknowns; `usual` is the usual threshold, `damping`
/// the singular value there, from which Tikhonov's α is. Where every frame is measured, `in_order`,
/// those that depend on the previous frame as well.
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
    let mut tikhonov = Method::new(Handles::MaxVol, Regularizer::Tikhonov, 0);
    tikhonov.options.lambda = damping;
    all.push(tikhonov);
    all
}
