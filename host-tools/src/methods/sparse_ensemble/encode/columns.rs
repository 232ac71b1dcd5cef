//! Columns of bases that a file uses, as integers.

use crate::math::linear::Basis;
use crate::methods::sparse_ensemble::model::FactorModel;

/// Columns of a basis that are used, each scaled to its largest entry.
pub(crate) struct Used {
    pub(crate) factor: FactorModel,
    /// New number of each column.
    pub(super) number: Vec<u32>,
    /// Largest entry of each new column.
    pub(super) scale: Vec<f64>,
}

/// Marks a column that is not used.
const UNUSED: u32 = u32::MAX;

impl Used {
    /// All columns of a table as they are.
    pub(super) fn whole(factor: &FactorModel) -> Used {
        let columns = factor.columns as usize;
        let squares = |c: usize| {
            factor.entries.iter().skip(c).step_by(columns).map(|&e| (e as f64).powi(2)).sum::<f64>()
        };
        // The entry that stands for one, over the length of the column: entries are those of a unit vector
        // over this.
        let scale = (0..columns).map(|c| 32_767.0 / squares(c).sqrt().max(1e-9)).collect();
        Used { factor: factor.clone(), number: (0..factor.columns).collect(), scale }
    }

    /// Those columns of a basis that are used.
    pub(crate) fn new(basis: &Basis, used: &[bool]) -> Used {
        let mut number = vec![UNUSED; basis.columns];
        let mut scales = Vec::new();
        let mut columns = Vec::new();
        for column in (0..basis.columns).filter(|&column| used[column]) {
            number[column] = columns.len() as u32;
            // An orthonormal column has an entry that is not zero.
            let largest = (0..basis.rows)
                .fold(1e-30f64, |largest, row| largest.max((basis.at(row, column) as f64).abs()));
            columns.push(
                (0..basis.rows)
                    .map(|row| (basis.at(row, column) as f64 * 32_767.0 / largest).round() as i16)
                    .collect::<Vec<_>>(),
            );
            scales.push(largest);
        }
        let entries = (0..basis.rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        Used { factor: FactorModel { columns: columns.len() as u32, entries }, number, scale: scales }
    }
}

/// The used columns of the dictionaries of a channel.
pub(super) struct Tables {
    /// Number of each dictionary in the file, `usize::MAX` for one that is not used.
    pub(super) numbers: Vec<usize>,
    /// Columns of light, view, x and y of each dictionary in the file.
    pub(super) parts: Vec<[Used; 4]>,
}
