//! The baselines of a sweep.

use super::swept::{Curve, Made, Shared, Swept, Visitor, What};
use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::encode::goal::domain_name;
use crate::error::Result;
use crate::measure::baseline::data::Uncompressed as Values;
use crate::measure::baseline::pca::Components;
use crate::measure::baseline::{clusters, published, tucker};
use std::time::Instant;

/// A baseline in one domain.
fn curve(name: &str, domain: Domain, colour: [u8; 3]) -> Vec<Curve> {
    vec![Curve { name: format!("{name}, {}", domain_name(domain)), colour }]
}

/// The name of the one curve of a baseline, and what is wanted of it.
fn wanted(entry: &dyn Swept, shared: &Shared<'_>, visitor: &Visitor<'_>) -> (String, Vec<u64>) {
    let name = entry.curves(shared.domain).remove(0).name;
    let budgets = visitor.budgets(&name, shared.budgets);
    (name, budgets)
}

/// The decomposition of the whole, truncated and quantised.
pub(super) struct Truncated;

impl Swept for Truncated {
    fn curves(&self, domain: Domain) -> Vec<Curve> {
        curve("PCA", domain, [110, 110, 110])
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let (method, budgets) = wanted(self, shared, visitor);
        for budget in budgets {
            let components = shared.components(visitor)?;
            (visitor.log)(&format!("{method} at {budget} bytes"));
            let start = Instant::now();
            let whole = &mut components.pca;
            let Some(choice) = whole.best_at(budget)? else {
                (visitor.log)(&format!("{method}: left out, {budget} bytes are fewer than the mean takes"));
                continue;
            };
            let is_all = choice.rank == whole.rank();
            (visitor.visit)(Made {
                method: method.clone(),
                budget,
                setting: format!("{} components, {} bits", choice.rank, choice.bits),
                found: if is_all { "all components that were made".into() } else { String::new() },
                seconds: components.seconds + start.elapsed().as_secs_f64(),
                what: What::Baseline(Box::new(whole.decoder(choice.rank, choice.bits))),
            })?;
        }
        Ok(())
    }
}

/// A decomposition for each cluster of texels.
pub(super) struct LocalPca;

/// Numbers of clusters that are tried.
const CLUSTERS: [usize; 4] = [2, 4, 8, 16];
/// Bits of a number of clusters and of Tucker decompositions.
const BITS: u32 = 8;

/// The clusters of least error at a budget; `None` if not even the fewest fit.
///
/// # Errors
/// If data cannot be read.
fn best_clusters<'a, 'd>(
    whole: &'a Components<'d>,
    data: &Dataset,
    budget: u64,
) -> Result<Option<clusters::Clusters<'a, 'd>>> {
    let mut best: Option<(f64, clusters::Clusters<'a, 'd>)> = None;
    for count in CLUSTERS {
        // The most components that fit, by the cost of one.
        let none = clusters::bytes(data, count, 0, BITS);
        let each = clusters::bytes(data, count, 1, BITS) - none;
        if none + each > budget {
            break;
        }
        let made = clusters::clusters(whole, count, ((budget - none) / each) as usize);
        let row = made.measure(BITS)?;
        let error = whole.error(&row);
        if best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, made));
        }
    }
    Ok(best.map(|(_, made)| made))
}

impl Swept for LocalPca {
    fn curves(&self, domain: Domain) -> Vec<Curve> {
        curve("local PCA", domain, [150, 140, 90])
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let (method, budgets) = wanted(self, shared, visitor);
        if budgets.is_empty() {
            return Ok(());
        }
        let data = shared.data;
        let components = shared.components(visitor)?;
        visitor.begin_one(components.peak);
        for budget in budgets {
            (visitor.log)(&format!("{method} at {budget} bytes"));
            let start = Instant::now();
            let Some(made) = best_clusters(&components.pca, data, budget)? else {
                (visitor.log)(&format!("{method}: left out, {budget} bytes are too few for two clusters"));
                continue;
            };
            (visitor.visit)(Made {
                method: method.clone(),
                budget,
                setting: made.describe(),
                found: String::new(),
                seconds: components.seconds + start.elapsed().as_secs_f64(),
                what: What::Baseline(Box::new(made.decoder(BITS))),
            })?;
        }
        Ok(())
    }
}

/// The Tucker decomposition, along all modes.
pub(super) struct Tucker;

/// Columns of view and light whose product fits a budget, before the mean and the matrices are counted.
fn columns(data: &Dataset, [width, height]: [u64; 2], budget: u64) -> [usize; 2] {
    let description = data.description();
    let product = (budget as f64 / (width * height) as f64).max(2.0);
    // Light has colour, so it gets more.
    let views = ((product / 3.0).sqrt().max(1.0) as usize).min(description.views.len());
    let lights = (product / views as f64) as usize;
    [views, lights.min(3 * description.lights.len()).min(tucker::MOST_COLUMNS)]
}

impl Swept for Tucker {
    fn curves(&self, domain: Domain) -> Vec<Curve> {
        curve("Tucker", domain, [130, 100, 140])
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let (method, budgets) = wanted(self, shared, visitor);
        let Some(&most) = budgets.iter().max() else { return Ok(()) };
        let data = shared.data;
        let components = shared.components(visitor)?;
        visitor.begin_one(components.peak);
        (visitor.log)(&format!("{method}: all modes"));
        let start = Instant::now();
        let spatial = data.description().size.map(|n| n.div_ceil(2) as u64);
        let [width, height] = spatial;
        let [views, lights] = columns(data, spatial, most);
        let decomposed = tucker::tucker(&components.pca, views.max(1), lights.max(1))?;
        let preparing = components.seconds + start.elapsed().as_secs_f64();
        for budget in budgets {
            let start = Instant::now();
            let [mut views, mut lights] = columns(data, spatial, budget);
            // What the mean and the matrices take is given back column by column.
            while lights > 1 && decomposed.bytes(views, lights, BITS) > budget {
                if lights > 3 * views || views == 1 { lights -= 1 } else { views -= 1 }
            }
            if decomposed.bytes(views, lights, BITS) > budget {
                (visitor.log)(&format!("{method}: left out, {budget} bytes are too few"));
                continue;
            }
            (visitor.log)(&format!("{method} at {budget} bytes"));
            (visitor.visit)(Made {
                method: method.clone(),
                budget,
                setting: format!(
                    "{width} x {height} spatial, {views} view and {lights} light columns, {BITS} bits"
                ),
                found: String::new(),
                seconds: preparing + start.elapsed().as_secs_f64(),
                what: What::Baseline(Box::new(decomposed.decoder(views, lights, BITS))),
            })?;
        }
        Ok(())
    }
}

/// SparseBTF in the layout of its paper.
pub(super) struct Published;

impl Swept for Published {
    fn domains(&self) -> &'static [Domain] {
        &[Domain::Log]
    }

    fn curves(&self, _: Domain) -> Vec<Curve> {
        vec![Curve { name: "SparseBTF as published".into(), colour: [0, 158, 115] }]
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let (method, budgets) = wanted(self, shared, visitor);
        let Some(&most) = budgets.iter().max() else { return Ok(()) };
        visitor.begin();
        (visitor.log)(&method);
        let start = Instant::now();
        let source = published::Published::new(shared.data)?;
        let own = source.own_ensembles()?;
        let Some(layout) = visitor.kept(source.layout(&own, most), &method)? else { return Ok(()) };
        let seconds = start.elapsed().as_secs_f64();
        for budget in budgets {
            let fixed = source.bytes(0);
            let Some(rest) = budget.checked_sub(fixed) else {
                (visitor.log)(&format!("{method}: left out, its tables alone have {fixed} bytes"));
                continue;
            };
            let coefficients = ((rest / (source.bytes(1) - fixed)) as usize).min(layout.most());
            (visitor.visit)(Made {
                method: method.clone(),
                budget,
                setting: format!(
                    "{coefficients} coefficients a block; its dictionaries ({} bytes) are not counted",
                    layout.dictionary_bytes()
                ),
                found: String::new(),
                seconds,
                what: What::Baseline(Box::new(layout.decoder(coefficients))),
            })?;
        }
        Ok(())
    }
}

/// The data themselves, at their own bytes.
pub(super) struct Uncompressed;

/// Name of the curve.
pub(super) const UNCOMPRESSED: &str = "uncompressed";

impl Swept for Uncompressed {
    fn domains(&self) -> &'static [Domain] {
        &[Domain::Linear]
    }

    fn curves(&self, _: Domain) -> Vec<Curve> {
        vec![Curve { name: UNCOMPRESSED.into(), colour: [0; 3] }]
    }

    fn sweep(&self, shared: &mut Shared<'_>, visitor: &mut Visitor<'_>) -> Result<()> {
        let bytes = shared.data.description().half_bytes();
        if visitor.budgets(UNCOMPRESSED, &[bytes]).is_empty() {
            return Ok(());
        }
        visitor.begin();
        (visitor.log)(UNCOMPRESSED);
        let start = Instant::now();
        let decoder = Values::new(shared.data)?;
        (visitor.visit)(Made {
            method: UNCOMPRESSED.into(),
            budget: bytes,
            setting: "binary16, four texels and nine pairs".into(),
            found: String::new(),
            seconds: start.elapsed().as_secs_f64(),
            what: What::Baseline(Box::new(decoder)),
        })
    }
}
