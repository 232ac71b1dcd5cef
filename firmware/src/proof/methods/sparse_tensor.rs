//! Chapter 12.

use crate::{any, i, n};
use core::hint::black_box;
use selvedge::kernel::{material, position, words};
use selvedge::method::sparse_tensor::{self, cost};
use selvedge::{Located, Taps, Values};

/// For numbers that no file may hold.
pub fn call(files: words::Words<'_>) {
    let (taps, list) = (any(Taps::default()), any(sparse_tensor::List::default()));
    let one = any(material::Material::default());
    let (place, located) = (any(position::Place::default()), any(Located::default()));
    black_box((
        sparse_tensor::bit_length(n()),
        sparse_tensor::list_low_bits(n(), n()),
        sparse_tensor::list_bits(n(), n(), n(), n()),
        sparse_tensor::list_coefficient(n(), n()),
    ));
    black_box((
        sparse_tensor::lists_start(files, &one, n(), n()),
        sparse_tensor::next_coefficient(files, list),
        sparse_tensor::open_list(files, n(), n(), n()),
        sparse_tensor::no_list(),
    ));
    black_box((
        sparse_tensor::light_entry(n(), n()),
        sparse_tensor::blend_light(n(), n(), n(), taps, n()),
        sparse_tensor::corner_weight(i(), i(), i()),
    ));
    black_box((
        sparse_tensor::add_fibre(files, &one, n(), n(), i(), taps, any(Values::default())),
        sparse_tensor::angular_q15(files, &one, n(), n(), taps, taps),
    ));
    black_box((sparse_tensor::angular_shift(n()), sparse_tensor::gain_shift(n())));
    black_box((
        sparse_tensor::layer_q20(files, &one, n(), &place, taps, taps),
        sparse_tensor::sparse_tensor_textures_q20(files, &one, &place, &located, &located),
        cost::layer_operations(n(), n(), n()),
    ));
}
