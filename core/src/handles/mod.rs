//! Which points the inversion reads: from one per unknown to all.
//!
//! | handles | rows read | L2 above least squares over all points, four captures |
//! |---|---|---|
//! | [`Handles::MaxVol`] | m | 29 … 55 % |
//! | [`Handles::Rectangular`] | K = 2m | 19 … 43 % |
//! | [`Handles::Spread`] | K = 2m | 1 … 7 % |
//! | [`Handles::All`] | n | 0 |

pub(crate) mod farthest;
pub(crate) mod interpolation;
pub(crate) mod rectangular;

/// Which points the inversion reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handles {
    /// As many as unknowns, of maximum volume: stable, and a frame costs microseconds.
    MaxVol,
    /// Those of maximum volume, and the rows of the largest leverage beside them (Mikhalev and Oseledets 2018): for comparison.
    Rectangular {
        /// Rows read, K; 2m where none is given.
        count: Option<usize>,
    },
    /// Those of maximum volume, and points spread evenly over the model; what all others do is interpolated. Close to
    /// [`Self::All`] for a few percent of the bytes.
    Spread {
        /// Rows read, K; 2m where none is given.
        count: Option<usize>,
    },
    /// Every point: least squares, the lowest error.
    All,
}

impl Default for Handles {
    /// On four captures 19 to 32 % less error than maximum volume alone.
    fn default() -> Self {
        Self::Spread { count: None }
    }
}

impl Handles {
    /// The names, in the order of the documentation.
    pub const NAMES: [&'static str; 4] = ["maxvol", "rectangular", "spread", "all"];

    /// The one with this name, reading `count` rows; `None` where there is none, or where it reads a number of rows of its own
    /// and yet one is given.
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

    /// Rows read of so many points for so many unknowns. Without a wish, twice as many as unknowns where there can be a choice.
    pub fn count(self, points: usize, unknowns: usize) -> usize {
        match self {
            Self::MaxVol => unknowns,
            Self::Rectangular { count } | Self::Spread { count } => count.unwrap_or(points.min(2 * unknowns)),
            Self::All => points,
        }
    }
}
