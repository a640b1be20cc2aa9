//! Progress bars on terminals; nothing in pipes.

use super::is_quiet;
use cager_proto::cage_messages::CageProgress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::cell::OnceCell;
use std::fmt::Write;
use std::io::IsTerminal;
use std::time::Duration;

/// A bar over frames on stderr; hidden where stderr is not a terminal, and by --quiet.
pub(crate) fn frames(what: &'static str, total: usize) -> ProgressBar {
    let target = if std::io::stderr().is_terminal() && !is_quiet() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    let style = ProgressStyle::with_template("{msg:>9} {bar:40} {pos}/{len} frames, {per_sec}, {eta} left");
    let bar = ProgressBar::with_draw_target(Some(total as u64), target).with_message(what);
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// A bar over steps that differ in length, on stderr; hidden where stderr is not a terminal, and by --quiet.
pub(crate) fn steps() -> ProgressBar {
    let bar = frames("", 1);
    match ProgressStyle::with_template("{msg:>24} {bar:40} {elapsed}") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// What is being done for so long as it takes, with a clock that ticks; hidden as the others are.
pub(crate) fn ticking(what: &'static str) -> ProgressBar {
    let clock = steps();
    if !clock.is_hidden() {
        clock.enable_steady_tick(Duration::from_millis(250));
    }
    clock_of(clock, None).with_message(what)
}

/// What is being prepared, with a clock that ticks; then a bar over frames.
pub(crate) struct PreparationBar {
    what: &'static str,
    total: usize,
    clock: ProgressBar,
    frames: OnceCell<ProgressBar>,
}

impl PreparationBar {
    pub(crate) fn new(what: &'static str, total: usize) -> Self {
        Self { what, total, clock: ticking("coordinates"), frames: OnceCell::new() }
    }

    /// Shows how many seconds preparing will take, about; they are asked for only where somebody sees them.
    pub(crate) fn expecting(mut self, seconds: impl FnOnce() -> f64) -> Self {
        if !self.clock.is_hidden() {
            self.clock = clock_of(self.clock, Some(seconds()));
        }
        self
    }

    pub(crate) fn preparing(&self, step: &'static str) {
        self.clock.set_message(step);
    }

    /// The bar begins with the first frames, so that what is left is judged by frames alone.
    pub(crate) fn done(&self, frames: usize) {
        let begun = || {
            self.clock.finish_and_clear();
            self::frames(self.what, self.total)
        };
        self.frames.get_or_init(begun).set_position(frames as u64);
    }

    pub(crate) fn finish(&self) {
        self.clock.finish_and_clear();
        if let Some(bar) = self.frames.get() {
            bar.finish_and_clear();
        }
    }
}

/// Shows the time that preparing has taken, and the time expected until it is exceeded.
fn clock_of(bar: ProgressBar, expected: Option<f64>) -> ProgressBar {
    match ProgressStyle::with_template("{spinner} preparing: {msg}, {elapsed}{expected}") {
        Ok(style) => bar.with_style(style.with_key("expected", move |state: &ProgressState, out: &mut dyn Write| {
            if let Some(seconds) = expected.filter(|&seconds| state.elapsed().as_secs_f64() < seconds) {
                let _ = write!(out, " of about {}", duration(seconds));
            }
        })),
        Err(_) => bar,
    }
}

/// A rough time in words.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{:.0} s", s.max(1.0)),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Positions of a bar over the whole of a work.
pub(crate) const STEPS: u64 = 1000;

/// As [`steps`], with a clock that ticks during long steps, and the time left as its prefix.
pub(crate) fn timed_steps() -> ProgressBar {
    let bar = frames("", STEPS as usize);
    if !bar.is_hidden() {
        bar.enable_steady_tick(Duration::from_millis(250));
    }
    match ProgressStyle::with_template("{spinner} {msg:26} {bar:30} {elapsed}, {prefix}") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Shows how far the design of a cage is, on a bar over steps.
pub(crate) fn design(bar: &ProgressBar, told: &CageProgress) {
    bar.set_length(STEPS);
    bar.set_position((told.fraction * STEPS as f64) as u64);
    let stage = told.stage.clone().unwrap_or_else(|| "cage".to_owned());
    bar.set_message(match told.error {
        Some(error) => format!("{stage}: {:.3} %", 100.0 * error),
        None => stage,
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_told_in_the_unit_that_fits() {
        assert_eq!([0.2, 42.4, 150.0, 9000.0].map(duration), ["1 s", "42 s", "2 min", "2.5 h"]);
    }
}
