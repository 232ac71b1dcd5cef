//! New numbers for what stays when something else goes.

/// Numbers of what is used, in order, and the new number of each.
#[derive(Clone, Debug)]
pub struct Renumbering {
    /// Old numbers of what stays.
    pub kept: Vec<u32>,
    /// New number by the old one; 0 for what goes.
    pub new: Vec<u32>,
}

impl Renumbering {
    /// Of what is used; the first stays if nothing is and `at_least_one` must, for the format has no empty
    /// factor and no empty ensemble.
    pub fn new(is_used: &[bool], at_least_one: bool) -> Renumbering {
        let mut kept: Vec<u32> = (0u32..).zip(is_used).filter(|(_, used)| **used).map(|(i, _)| i).collect();
        if kept.is_empty() && at_least_one {
            kept.push(0);
        }
        let mut new = vec![0; is_used.len()];
        (0u32..).zip(&kept).for_each(|(number, &old)| new[old as usize] = number);
        Renumbering { kept, new }
    }
}

/// Some rows of `length` numbers each, in the order given.
pub fn kept_rows<T: Copy>(entries: &[T], length: usize, kept: &[u32]) -> Vec<T> {
    kept.iter().flat_map(|&row| &entries[row as usize * length..][..length]).copied().collect()
}

/// Some columns of rows of `columns` numbers each, in the order given.
pub fn kept_columns<T: Copy>(entries: &[T], columns: usize, kept: &[u32]) -> Vec<T> {
    let rows = entries.chunks(columns.max(1));
    rows.flat_map(|row| kept.iter().map(|&column| row[column as usize])).collect()
}
