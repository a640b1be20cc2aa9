//! Handles: the points that the inversion reads, from one per unknown to all. `docs/PAPER.md` compares their errors.

/// Which points the inversion reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handles {
    /// As many rows as unknowns, of maximum volume: well-conditioned, microseconds per frame.
    MaxVol,
    /// The rows of maximum volume and those of largest leverage (Mikhalev and Oseledets 2018): for comparison.
    Rectangular {
        /// Rows read, K; 2m where none is given.
        count: Option<usize>,
    },
    /// The rows of maximum volume and farthest-point samples, from which the other points are interpolated by kriging. Close to [`Self::All`] while
    /// reading a few percent of the points.
    Spread {
        /// Rows read, K; 2m where none is given.
        count: Option<usize>,
    },
    /// Every point: least squares, the lowest error.
    All,
}

impl Default for Handles {
    /// Spread handles, two for each unknown.
    fn default() -> Self {
        Self::Spread { count: None }
    }
}

impl Handles {
    /// The names, in the order of the documentation.
    pub const NAMES: [&'static str; 4] = ["maxvol", "rectangular", "spread", "all"];

    /// The variant with this name, reading `count` rows; `None` for an unknown name, and for a count where the variant fixes its own.
    pub fn by_name(name: &str, count: Option<usize>) -> Option<Self> {
        match (name, count) {
            ("maxvol", None) => Some(Self::MaxVol),
            ("all", None) => Some(Self::All),
            ("rectangular", count) => Some(Self::Rectangular { count }),
            ("spread", count) => Some(Self::Spread { count }),
            _ => None,
        }
    }

    /// The name on the command line, in reports and in containers.
    pub fn name(self) -> &'static str {
        match self {
            Self::MaxVol => "maxvol",
            Self::Rectangular { .. } => "rectangular",
            Self::Spread { .. } => "spread",
            Self::All => "all",
        }
    }

    /// Number of rows read for a model of `points` points and a cage of `unknowns` unknowns; by default twice the unknowns where the number is free.
    pub fn count(self, points: usize, unknowns: usize) -> usize {
        match self {
            Self::MaxVol => unknowns,
            Self::Rectangular { count } | Self::Spread { count } => count.unwrap_or(points.min(2 * unknowns)),
            Self::All => points,
        }
    }
}
