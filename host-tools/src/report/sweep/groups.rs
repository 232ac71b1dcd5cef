//! Everything that is swept, in the order of a report.

use super::baselines::{LocalPca, Published, Truncated, Tucker, Uncompressed};
use super::methods::{Ensembles, Tensor, other_methods};
use super::swept::{DOMAINS, Shared, Swept, Visitor};
use crate::data::dataset::Dataset;
use crate::error::Result;

/// Everything that is swept, in the order of a report; each group shares its work in a domain.
fn groups() -> Vec<Vec<Box<dyn Swept>>> {
    vec![
        vec![Box::new(Ensembles)],
        vec![Box::new(Truncated), Box::new(Tensor), Box::new(LocalPca), Box::new(Tucker)],
        other_methods(),
        vec![Box::new(Published)],
        vec![Box::new(Uncompressed)],
    ]
}

/// Makes all that is wanted of a dataset.
///
/// # Errors
/// As [`Swept::sweep`].
pub(super) fn everything(
    data: &Dataset,
    rank: usize,
    budgets: &[u64],
    visitor: &mut Visitor<'_>,
) -> Result<()> {
    for group in groups() {
        for domain in DOMAINS {
            let mut shared = Shared::new(data, domain, rank, budgets);
            for entry in group.iter().filter(|entry| entry.domains().contains(&domain)) {
                entry.sweep(&mut shared, visitor)?;
            }
        }
    }
    Ok(())
}

/// The colour of a curve in plots; black if these tools have none of this name.
pub(in crate::report) fn colour_of(name: &str) -> [u8; 3] {
    let all = groups().into_iter().flatten();
    let mut curves = all.flat_map(|entry| DOMAINS.map(|domain| entry.curves(domain)).into_iter().flatten());
    curves.find(|curve| curve.name == name).map_or([0; 3], |curve| curve.colour)
}
