//! When something is shown: a value that holds until the next one.

use super::track::union;

/// Values at ascending times, of which the first holds before too; shown where there are none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Steps(Vec<(f64, bool)>);

impl Steps {
    /// By a function of the time, which changes at some of these alone.
    pub(crate) fn of<E>(times: Vec<f64>, mut is_shown: impl FnMut(f64) -> Result<bool, E>) -> Result<Self, E> {
        let mut steps: Vec<(f64, bool)> = Vec::new();
        for time in union(times, 0.0) {
            let now = is_shown(time)?;
            if steps.last().is_none_or(|&(_, before)| before != now) {
                steps.push((time, now));
            }
        }
        Ok(Self(steps))
    }

    /// Whether it is shown at a time; a value that comes within rounding of it counts.
    pub(crate) fn at(&self, time: f64) -> bool {
        const NEAR: f64 = 1e-6;
        let next = self.0.partition_point(|&(begin, _)| begin <= time + NEAR * time.abs().max(1.0));
        self.0.get(next.saturating_sub(1)).is_none_or(|&(_, is_shown)| is_shown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_holds_until_the_next() {
        let steps = Steps::of(vec![5.0, 2.0, 2.0, 7.0], |time| Ok::<_, ()>(time != 2.0)).unwrap();
        let at = |time| steps.at(time);
        assert_eq!([0.0, 2.0, 4.9, 5.0, 9.0].map(at), [false, false, false, true, true]);
        assert!(Steps::default().at(3.0));
    }
}
