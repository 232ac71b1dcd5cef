//! The methods of the format in a sweep: those that share work between budgets, and all others by their
//! encoders alone.

use super::swept::{Curve, Made, Shared, Swept, Visitor, What};
use crate::data::transfer::Domain;
use crate::data::transfer::transfer_of;
use crate::encode::ENCODERS;
use crate::encode::encoder::{self, Common, Encoder, Levels};
use crate::encode::goal::{Goal, Target, domain_name};
use crate::error::Result;
use crate::methods::sparse_ensemble::encode::{self, prepare};
use crate::methods::sparse_tensor::encode::{ShapeSearch, fit};
use crate::methods::{by_name, sparse_ensemble, sparse_tensor};
use crate::progress::Quiet;
use std::time::Instant;

/// The sparse ensemble, a curve for each edge of its blocks.
pub(super) struct Ensembles;

/// Darker and lighter than the method's colour: of smaller and of larger blocks.
const DARKER: [u8; 3] = [0, 60, 130];
const LIGHTER: [u8; 3] = [86, 180, 233];

impl Ensembles {
    /// Edges of blocks that are tried, with their colours.
    fn edges(domain: Domain) -> Vec<(usize, [u8; 3])> {
        let middle = (4, sparse_ensemble::METHOD.colour);
        match domain {
            Domain::Log => vec![(2, DARKER), middle, (8, LIGHTER)],
            Domain::Linear => vec![middle],
        }
    }

    fn name(edge: usize, domain: Domain) -> String {
        format!("ensemble {edge}, {}", domain_name(domain))
    }
}

impl Swept for Ensembles {
    fn curves(&self, domain: Domain) -> Vec<Curve> {
        let curve = |(edge, colour)| Curve { name: Ensembles::name(edge, domain), colour };
        Ensembles::edges(domain).into_iter().map(curve).collect()
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let Shared { data, domain, budgets, .. } = *shared;
        if self.curves(domain).iter().all(|curve| visitor.budgets(&curve.name, budgets).is_empty()) {
            return Ok(());
        }
        visitor.begin();
        let start = Instant::now();
        let prepared = prepare(vec![data], transfer_of(data, domain), &|_, _| ())?;
        let preparing = start.elapsed().as_secs_f64();
        for (edge, _) in Ensembles::edges(domain) {
            let method = Ensembles::name(edge, domain);
            let bases = prepared.own_ensembles(edge);
            for budget in visitor.budgets(&method, budgets) {
                (visitor.log)(&format!("{method} at {budget} bytes"));
                let start = Instant::now();
                let criterion = encode::Criterion::Bytes(budget);
                let options = encode::Options { edge, criterion, ..encode::Options::default() };
                let made = encode::encode(&prepared, &bases, &options, &|_, _| ());
                let Some(encoded) = visitor.kept(made, &method)? else {
                    continue;
                };
                let coefficients: usize = encoded.coefficients.iter().sum();
                (visitor.visit)(Made {
                    method: method.clone(),
                    budget,
                    setting: format!("blocks of {edge} x {edge}, {coefficients} coefficients"),
                    found: String::new(),
                    seconds: preparing + start.elapsed().as_secs_f64(),
                    what: What::File(encoded.bytes),
                })?;
            }
        }
        Ok(())
    }
}

/// The sparse tensor.
pub(super) struct Tensor;

impl Tensor {
    fn name(domain: Domain) -> String {
        format!("tensor, {}", domain_name(domain))
    }
}

impl Swept for Tensor {
    fn curves(&self, domain: Domain) -> Vec<Curve> {
        vec![Curve { name: Tensor::name(domain), colour: sparse_tensor::METHOD.colour }]
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let method = Tensor::name(shared.domain);
        let wanted = visitor.budgets(&method, shared.budgets);
        if wanted.is_empty() {
            return Ok(());
        }
        let texels = shared.data.description().texels() as f64;
        let components = shared.components(visitor)?;
        visitor.begin_one(components.peak);
        (visitor.log)(&format!("{method}: trial dictionaries"));
        let start = Instant::now();
        let training = fit::Training::default();
        let search = ShapeSearch::new(&components.pca, training, |_, _, _| ());
        let preparing = components.seconds + start.elapsed().as_secs_f64();
        for budget in wanted {
            (visitor.log)(&format!("{method} at {budget} bytes"));
            let start = Instant::now();
            let made = search.encode(&[], Target::Bytes(budget), None, training, |_, _, _| ());
            let Some((shape, _, encoded)) = visitor.kept(made, &method)? else {
                continue;
            };
            (visitor.visit)(Made {
                method: method.clone(),
                budget,
                setting: format!(
                    "{} light atoms, {} ABRDF atoms, {} entries, {:.1} coefficients a texel",
                    shape.light_atoms,
                    shape.abrdf_atoms,
                    shape.entries,
                    encoded.coefficients as f64 / texels
                ),
                found: encoded.found(),
                seconds: preparing + start.elapsed().as_secs_f64(),
                what: What::File(encoded.bytes),
            })?;
        }
        Ok(())
    }
}

/// A method by its encoder with default options, of which nothing is shared between budgets.
struct ByEncoder(&'static dyn Encoder);

/// Methods without an entry of their own above.
pub(super) fn other_methods() -> Vec<Box<dyn Swept>> {
    let own = [sparse_ensemble::METHOD.name, sparse_tensor::METHOD.name];
    let others = ENCODERS.iter().filter(|encoder| !own.contains(&encoder.method()));
    others.map(|encoder| Box::new(ByEncoder(*encoder)) as Box<dyn Swept>).collect()
}

impl ByEncoder {
    fn name(&self, domain: Domain) -> String {
        format!("{}, {}", self.0.method(), domain_name(domain))
    }
}

impl Swept for ByEncoder {
    fn curves(&self, domain: Domain) -> Vec<Curve> {
        let colour = by_name(self.0.method()).map_or([0; 3], |method| method.colour);
        vec![Curve { name: self.name(domain), colour }]
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let method = self.name(shared.domain);
        let common = Common { transfer: shared.domain, ..Common::default() };
        for budget in visitor.budgets(&method, shared.budgets) {
            visitor.begin();
            (visitor.log)(&format!("{method} at {budget} bytes"));
            let start = Instant::now();
            let levels = Levels::of(shared.data);
            let made = encoder::encode(self.0, &levels, Goal::Bytes(budget), &common, &Quiet);
            let Some(encoded) = visitor.kept(made, &method)? else {
                continue;
            };
            (visitor.visit)(Made {
                method: method.clone(),
                budget,
                setting: encoded.setting,
                found: String::new(),
                seconds: start.elapsed().as_secs_f64(),
                what: What::File(encoded.bytes),
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::baseline::tests::small;
    use crate::methods::METHODS;
    use crate::report::sweep::swept::Memory;
    use std::cell::RefCell;

    #[test]
    fn any_method_can_be_swept_by_its_encoder() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [6, 5]);
        let (met, missed) = (60_000, 10);
        for (encoder, method) in ENCODERS.iter().zip(METHODS) {
            let entry = ByEncoder(*encoder);
            let curve = entry.curves(Domain::Log).remove(0);
            assert_eq!((curve.name, curve.colour), (format!("{}, log", method.name), method.colour));
            let mut found = Vec::new();
            let said = RefCell::new(Vec::new());
            let mut visitor = Visitor {
                wanted: &|_, _| true,
                visit: &mut |made: Made| {
                    made.what.with(|_, bytes| {
                        found.push((made.budget, bytes));
                        Ok(())
                    })
                },
                log: &|line| said.borrow_mut().push(line.to_owned()),
                memory: &Memory::default(),
            };
            let budgets = [missed, met];
            let mut shared = Shared::new(&data, Domain::Log, 8, &budgets);
            entry.sweep(&mut shared, &mut visitor).expect("swept");
            assert!(found.len() == 1 && found[0].0 == met && found[0].1 <= met, "{found:?}");
            assert!(said.borrow().iter().any(|line| line.contains("left out")), "{said:?}");
        }
    }
}
