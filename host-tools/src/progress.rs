//! One line on a terminal that says how far a long piece of work is; nothing where stderr is no terminal.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Mutex;
use std::time::Instant;

/// A line that is written over.
pub struct Progress {
    is_terminal: bool,
    state: Mutex<State>,
}

struct State {
    what: String,
    begun: Instant,
    shown: Option<Instant>,
}

impl Default for Progress {
    fn default() -> Progress {
        Progress::new()
    }
}

impl Progress {
    /// Begins.
    pub fn new() -> Progress {
        let state = State { what: String::new(), begun: Instant::now(), shown: None };
        Progress { is_terminal: std::io::stderr().is_terminal(), state: Mutex::new(state) }
    }

    /// Says that `done` of `all` parts of something are done.
    pub fn tell(&self, what: &str, done: usize, all: usize) {
        if !self.is_terminal {
            return;
        }
        let Ok(mut state) = self.state.lock() else { return };
        let now = Instant::now();
        if state.what != what || done <= 1 {
            *state = State { what: what.to_owned(), begun: now, shown: None };
        }
        if done < all && state.shown.is_some_and(|shown| now.duration_since(shown).as_millis() < 200) {
            return;
        }
        state.shown = Some(now);
        let left = now.duration_since(state.begun).as_secs_f64() / done.max(1) as f64 * all.saturating_sub(done) as f64;
        let _ = write!(std::io::stderr(), "\r\x1b[K{what}: {} %, {left:.0} s left", done * 100 / all.max(1));
    }

    /// Removes the line, so that something else can be said.
    pub fn clear(&self) {
        if self.is_terminal {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}
