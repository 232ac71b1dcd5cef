//! What a sweep is made of: something that can be swept, what of it is shared, and what comes of it.

use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::encode::goal::domain_name;
use crate::error::{Result, ToolError};
use crate::measure::baseline::decoder::Decoder;
use crate::measure::baseline::pca;
use crate::measure::verify::open_made;
use crate::report::bench::Subject;
use crate::report::memory::{forget_peak, peak_memory};
use std::cell::Cell;
use std::time::Instant;

/// A curve of a report: a method or baseline in one domain and, where it has several, one setting.
pub(super) struct Curve {
    /// Its name, part of the keys of a store.
    pub(super) name: String,
    /// Red, green and blue in plots.
    pub(super) colour: [u8; 3],
}

/// A method or a baseline as a sweep has it.
pub(super) trait Swept {
    /// The domains that are coded.
    fn domains(&self) -> &'static [Domain] {
        &DOMAINS
    }

    /// Its curves, in the order in which they are made.
    fn curves(&self, domain: Domain) -> Vec<Curve>;

    /// Makes what is wanted of each curve.
    ///
    /// # Errors
    /// If data cannot be read, the visitor fails, or an encoder fails for another reason than its budget.
    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()>;
}

/// All domains, in the order of a sweep.
pub(super) const DOMAINS: [Domain; 2] = [Domain::Log, Domain::Linear];

/// What is swept, and the work that a group shares.
pub(super) struct Shared<'d> {
    /// The data.
    pub(super) data: &'d Dataset,
    /// The domain that is coded.
    pub(super) domain: Domain,
    /// Components of a decomposition.
    pub(super) rank: usize,
    /// Budgets, bytes.
    pub(super) budgets: &'d [u64],
    components: Option<Components<'d>>,
}

/// The components of a dataset, and what making them took.
pub(super) struct Components<'d> {
    /// The components.
    pub(super) pca: pca::Components<'d>,
    /// Seconds.
    pub(super) seconds: f64,
    /// The largest memory, bytes, where the system reports it.
    pub(super) peak: Option<u64>,
}

impl<'d> Shared<'d> {
    pub(super) fn new(data: &'d Dataset, domain: Domain, rank: usize, budgets: &'d [u64]) -> Shared<'d> {
        Shared { data, domain, rank, budgets, components: None }
    }

    /// The components, made when they are first needed.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub(super) fn components(&mut self, visitor: &Visitor<'_>) -> Result<&mut Components<'d>> {
        let made = match self.components.take() {
            Some(made) => made,
            None => {
                visitor.begin();
                (visitor.log)(&format!("{} components, {}", self.rank, domain_name(self.domain)));
                let start = Instant::now();
                let pca = pca::components(self.data, self.domain, self.rank)?;
                Components { pca, seconds: start.elapsed().as_secs_f64(), peak: visitor.memory.peak() }
            }
        };
        Ok(self.components.insert(made))
    }
}

/// A method at a budget, made.
pub(super) struct Made {
    /// Name of its curve.
    pub(super) method: String,
    /// The budget, bytes.
    pub(super) budget: u64,
    /// What was chosen to meet it.
    pub(super) setting: String,
    /// What a user should know of how it was made.
    pub(super) found: String,
    /// The file or the baseline.
    pub(super) what: What,
    /// Seconds, shared work included.
    pub(super) seconds: f64,
}

/// A file or a baseline that was made.
pub(super) enum What {
    /// A file of this format.
    File(Vec<u8>),
    /// A baseline.
    Baseline(Box<dyn Decoder>),
}

impl What {
    /// Measures it: as a subject, with its bytes.
    pub(super) fn with<T>(&self, measure: impl FnOnce(Subject<'_>, u64) -> Result<T>) -> Result<T> {
        match self {
            What::File(bytes) => measure(Subject::File(&open_made(bytes, None)?), bytes.len() as u64),
            What::Baseline(decoder) => measure(Subject::Baseline(decoder.as_ref()), decoder.bytes()),
        }
    }
}

/// Receives what was made; asked before, so that nothing is made in vain.
pub(super) struct Visitor<'v> {
    /// Whether a curve is wanted at a budget.
    pub(super) wanted: &'v dyn Fn(&str, u64) -> bool,
    /// Takes what was made.
    pub(super) visit: &'v mut dyn FnMut(Made) -> Result<()>,
    /// Logs a line.
    pub(super) log: &'v dyn Fn(&str),
    /// Keeps the largest memory.
    pub(super) memory: &'v Memory,
}

/// Where the largest memory of a method comes from.
#[derive(Default)]
pub(super) struct Memory {
    /// Whether the system reports the largest since the last start.
    is_known: Cell<bool>,
    /// The largest of what methods share.
    shared: Cell<u64>,
}

impl Memory {
    /// The largest of what is shared and of the method, bytes.
    pub(super) fn peak(&self) -> Option<u64> {
        peak_memory().filter(|_| self.is_known.get()).map(|own| own.max(self.shared.get()))
    }
}

impl Visitor<'_> {
    /// Starts the work that the settings of a method share.
    pub(super) fn begin(&self) {
        self.begin_one(None);
    }

    /// Starts the work of one method that shares work with others; with the largest memory of what is shared.
    pub(super) fn begin_one(&self, shared: Option<u64>) {
        self.memory.shared.set(shared.unwrap_or(0));
        self.memory.is_known.set(forget_peak());
    }

    /// The budgets that are wanted of a curve.
    pub(super) fn budgets(&self, curve: &str, budgets: &[u64]) -> Vec<u64> {
        budgets.iter().copied().filter(|&budget| (self.wanted)(curve, budget)).collect()
    }

    /// What a curve was made into; `None`, logged, for a budget that it cannot meet.
    ///
    /// # Errors
    /// Of `result`, but for [`ToolError::Unreachable`].
    pub(super) fn kept<T>(&self, result: Result<T>, curve: &str) -> Result<Option<T>> {
        match result {
            Ok(made) => Ok(Some(made)),
            Err(error @ ToolError::Unreachable { .. }) => {
                (self.log)(&format!("{curve}: left out, {error}"));
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}
