//! When something is shown: a value that holds until the next one, and leaves it to what is above
//! where it says nothing.

use std::collections::HashMap;
use std::sync::Arc;

use super::track::{Track, Value};
use crate::error::Fault;

/// At ascending times, of which the first holds before too, whether something itself is shown.
type Own = Vec<(f64, Option<bool>)>;

#[derive(Debug, Default)]
pub(crate) struct Steps {
    own: Own,
    /// Of what is above; shown where there is none.
    above: Option<Arc<Steps>>,
}

impl Steps {
    fn below(above: Arc<Self>, mut own: Own) -> Arc<Self> {
        own.dedup_by(|later, earlier| later.1 == earlier.1);
        if own.iter().all(|(_, said)| said.is_none()) {
            return above;
        }
        Arc::new(Self { own, above: Some(above) })
    }

    /// How many changes it has, those of what is above it included.
    pub(crate) fn len(&self) -> usize {
        self.own.len() + self.above.as_ref().map_or(0, |above| above.len())
    }

    /// Whether it is shown at a time; a value that comes within rounding of it counts.
    pub(crate) fn at(&self, time: f64) -> bool {
        const NEAR: f64 = 1e-6;
        let next = self.own.partition_point(|&(begin, _)| begin <= time + NEAR * time.abs().max(1.0));
        let own = self.own.get(next.saturating_sub(1)).and_then(|&(_, said)| said);
        own.unwrap_or_else(|| self.above.as_ref().is_none_or(|above| above.at(time)))
    }
}

/// When the nodes of a tree are shown: what each says is read once, however many lie below it.
#[derive(Default)]
pub(crate) struct Visibility(HashMap<usize, Arc<Steps>>);

impl Visibility {
    /// Of the first of these nodes, each of which lies below the next; `own` reads what one says.
    pub(crate) fn of(
        &mut self,
        nodes: &[usize],
        mut own: impl FnMut(usize) -> Result<Own, Fault>,
    ) -> Result<Arc<Steps>, Fault> {
        let known = nodes.iter().position(|node| self.0.contains_key(node)).unwrap_or(nodes.len());
        let mut steps = nodes.get(known).map_or_else(Arc::default, |node| Arc::clone(&self.0[node]));
        for &node in nodes[..known].iter().rev() {
            steps = Steps::below(steps, own(node)?);
            self.0.insert(node, Arc::clone(&steps));
        }
        Ok(steps)
    }
}

/// What values of a track say, of which each is read once.
pub(crate) fn said(track: &Track, mut read: impl FnMut(Value) -> Result<Option<bool>, Fault>) -> Result<Own, Fault> {
    let still = track.default.filter(|_| track.times.is_empty()).map(|value| (0.0, value));
    let (mut known, mut own) = (HashMap::new(), Vec::new());
    for (time, value) in track.times.iter().copied().zip(track.values.iter().copied()).chain(still) {
        let said = match known.get(&value.0) {
            Some(said) => *said,
            None => *known.entry(value.0).or_insert(read(value)?),
        };
        own.push((time, said));
    }
    Ok(own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_holds_until_the_next_and_hides_what_is_below() {
        let (mut visibility, mut asked) = (Visibility::default(), Vec::new());
        let mut own = |node: usize| {
            asked.push(node);
            Ok(match node {
                0 => vec![(2.0, Some(false)), (3.0, Some(false)), (5.0, None)],
                1 => vec![(4.0, None), (7.0, Some(false))],
                3 => vec![(0.0, Some(true))],
                _ => Vec::new(),
            })
        };
        let mut at = |nodes: &[usize]| {
            let steps = visibility.of(nodes, &mut own).unwrap();
            [0.0, 2.0, 4.9, 5.0, 9.0].map(|time| steps.at(time))
        };
        assert_eq!(at(&[1, 0]), [false, false, false, true, false]);
        assert_eq!(at(&[2, 0]), [false, false, false, true, true]);
        assert_eq!(at(&[3, 0]), [true; 5]);
        // Each is asked once.
        assert_eq!(asked, [0, 1, 2, 3]);
        assert!(Steps::default().at(3.0));
    }
}
