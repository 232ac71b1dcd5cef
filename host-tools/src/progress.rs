//! Progress of long work: one line on a terminal, nothing where stderr is none, and afterwards how long each
//! step took.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Mutex;
use std::time::Instant;

/// Told of long work while it runs, from any thread.
pub trait Observer: Sync {
    /// `done` of `all` parts of a step are done.
    fn pass(&self, step: &str, done: usize, all: usize);

    /// Something that a user should know of a result.
    fn note(&self, text: &str);
}

/// An observer that keeps everything to itself.
pub struct Quiet;

impl Observer for Quiet {
    fn pass(&self, _: &str, _: usize, _: usize) {}

    fn note(&self, _: &str) {}
}

/// A line that is written over.
pub struct Progress {
    is_terminal: bool,
    state: Mutex<State>,
}

struct State {
    what: String,
    begun: Instant,
    shown: Option<Instant>,
    reported: Instant,
    /// Seconds of each step, in the order of their first mention.
    steps: Vec<(String, f64)>,
}

impl Default for Progress {
    fn default() -> Progress {
        Progress::new()
    }
}

impl Observer for Progress {
    fn pass(&self, step: &str, done: usize, all: usize) {
        self.report(step, done, all);
    }

    fn note(&self, text: &str) {
        self.clear();
        eprintln!("{text}");
    }
}

impl Progress {
    /// Starts the clock.
    pub fn new() -> Progress {
        let now = Instant::now();
        let state = State { what: String::new(), begun: now, shown: None, reported: now, steps: Vec::new() };
        Progress { is_terminal: std::io::stderr().is_terminal(), state: Mutex::new(state) }
    }

    /// Reports that `done` of `all` parts of a step are done.
    pub fn report(&self, what: &str, done: usize, all: usize) {
        let Ok(mut state) = self.state.lock() else { return };
        let now = Instant::now();
        // The time since the last report belongs to the step that is reported.
        let seconds = now.duration_since(state.reported).as_secs_f64();
        state.reported = now;
        match state.steps.iter_mut().find(|step| step.0 == what) {
            Some(step) => step.1 += seconds,
            None => state.steps.push((what.to_owned(), seconds)),
        }
        if !self.is_terminal {
            return;
        }
        if state.what != what || done <= 1 {
            (state.what, state.begun, state.shown) = (what.to_owned(), now, None);
        }
        if done < all && state.shown.is_some_and(|shown| now.duration_since(shown).as_millis() < 200) {
            return;
        }
        state.shown = Some(now);
        let left = now.duration_since(state.begun).as_secs_f64() / done.max(1) as f64
            * all.saturating_sub(done) as f64;
        let _ = write!(std::io::stderr(), "\r\x1b[K{what}: {} %, {left:.0} s left", done * 100 / all.max(1));
    }

    /// Removes the line, so that something else can be printed.
    pub fn clear(&self) {
        if self.is_terminal {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }

    /// How long each step took, and under `rest` the time after the last report: `reading 1.2 s, finishing
    /// 0.4 s`.
    pub fn times(&self, rest: &str) -> String {
        let Ok(state) = self.state.lock() else { return String::new() };
        let last = (rest.to_owned(), state.reported.elapsed().as_secs_f64());
        let parts: Vec<String> = state
            .steps
            .iter()
            .chain([&last])
            .map(|(what, seconds)| format!("{what} {seconds:.1} s"))
            .collect();
        parts.join(", ")
    }
}
