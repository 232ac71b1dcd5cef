//! Chapter 10.

use crate::{any, i, n};
use core::hint::black_box;
use selvedge::kernel::{material, position, words};
use selvedge::method::sparse_ensemble::{self, cost};
use selvedge::{Located, Taps};

/// For numbers that no file may hold.
pub fn call(files: words::Words<'_>) {
    let (taps, span) = (any(Taps::default()), any(position::Span::default()));
    let (one, tables) = (any(material::Material::default()), any(sparse_ensemble::Tables::default()));
    let (place, located) = (any(position::Place::default()), any(Located::default()));
    let record = any(sparse_ensemble::Record::default());
    black_box((
        sparse_ensemble::tables_of(&one, n()),
        sparse_ensemble::coefficients_start(files, &one, n(), n(), n()),
        sparse_ensemble::read_record(files, n(), n()),
    ));
    black_box((
        sparse_ensemble::atom_light(n()),
        sparse_ensemble::atom_view(n()),
        sparse_ensemble::atom_x(n()),
        sparse_ensemble::atom_y(n()),
        sparse_ensemble::atom_shift(n()),
    ));
    black_box((
        sparse_ensemble::dequantise(n(), n(), n()),
        sparse_ensemble::blend_column(files, n(), n(), taps, n()),
        sparse_ensemble::blend_span(files, n(), n(), span, n()),
    ));
    black_box(sparse_ensemble::record_q20(files, tables, record, span, span, taps, taps));
    black_box(sparse_ensemble::block_q20(files, &one, tables, n(), span, span, taps, taps));
    black_box(sparse_ensemble::texture_q20(files, &one, n(), &place, taps, taps));
    black_box(sparse_ensemble::sparse_ensemble_textures_q20(files, &one, &place, &located, &located));
    black_box((cost::record_operations(n(), n()), i()));
}
