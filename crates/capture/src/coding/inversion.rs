//! How cages are solved for: what was asked for, and what is usual otherwise.

use cager_core::coordinates::{CoordinateSystem, Green};
use cager_core::inversion::{Handles, SolverOptions, default_spectrum};
use cager_core::regularize::Regularizer;

/// Weight λ where frames are coded. Over the whole spectrum it keeps still what would be coded as
/// noise: files are up to half as large for cages with more unknowns than the points determine.
const CODED_LAMBDA: f64 = 1e-3;

/// Options of the inversion as far as they were given.
#[derive(Clone, Copy)]
pub struct InversionChoices {
    /// Coordinate system.
    pub system: &'static dyn CoordinateSystem,
    /// Points that are read.
    pub handles: Option<Handles>,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: Regularizer,
    /// How many of the last singular directions are regularised.
    pub spectrum: Option<usize>,
    /// Weight of the regularisation.
    pub lambda: Option<f64>,
    /// Whether frames are coded.
    pub is_coded: bool,
}

impl InversionChoices {
    /// Nothing but that frames are coded.
    pub fn coded(system: &'static dyn CoordinateSystem) -> Self {
        let regularizer = Regularizer::default();
        Self { system, handles: None, regularizer, spectrum: None, lambda: None, is_coded: true }
    }

    /// With what is usual for the rest, for a cage of so many unknowns.
    pub fn options(self, unknowns: usize) -> SolverOptions {
        let usual = if self.is_light() { unknowns } else { default_spectrum(unknowns) };
        SolverOptions {
            handles: self.handles(),
            regularizer: self.regularizer,
            spectrum: self.spectrum.unwrap_or(usual),
            lambda: self.lambda(),
        }
    }

    /// The points read: all where frames are coded, since closer cages leave less to code.
    pub fn handles(self) -> Handles {
        self.handles.unwrap_or(if self.is_coded_linearly() { Handles::All } else { Handles::default() })
    }

    /// The weight of the regularisation.
    pub fn lambda(self) -> f64 {
        self.lambda.unwrap_or(if self.is_light() { CODED_LAMBDA } else { SolverOptions::default().lambda })
    }

    /// Whether the whole spectrum is regularised lightly: only where weight and spectrum are open.
    fn is_light(self) -> bool {
        let is_open = self.spectrum.is_none() && self.lambda.is_none();
        self.is_coded_linearly() && is_open && self.regularizer == Regularizer::default()
    }

    /// Where normals follow from the vertices, lighter weights give larger files.
    fn is_coded_linearly(self) -> bool {
        self.is_coded && self.system.name() != Green::Consistent.name()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::coordinates::MeanValue;

    #[test]
    fn what_was_given_is_kept_and_the_rest_depends_on_whether_frames_are_coded() {
        let coded = InversionChoices::coded(&MeanValue);
        let said = |choices: InversionChoices| {
            let SolverOptions { handles, spectrum, lambda, .. } = choices.options(100);
            (handles.name(), spectrum, lambda)
        };
        assert_eq!(said(coded), ("all", 100, 1e-3));
        assert_eq!(said(InversionChoices { is_coded: false, ..coded }), ("spread", 6, 1.0));
        assert_eq!(said(InversionChoices { system: &Green::Free, ..coded }), ("all", 100, 1e-3));
        assert_eq!(said(InversionChoices { system: &Green::Consistent, ..coded }), ("spread", 6, 1.0));
        assert_eq!(said(InversionChoices { spectrum: Some(6), ..coded }), ("all", 6, 1.0));
        assert_eq!(said(InversionChoices { lambda: Some(0.5), ..coded }), ("all", 6, 0.5));
        assert_eq!(said(InversionChoices { handles: Some(Handles::MaxVol), ..coded }), ("maxvol", 100, 1e-3));
        assert_eq!(said(InversionChoices { regularizer: Regularizer::Laplacian, ..coded }), ("all", 6, 1.0));
    }
}
