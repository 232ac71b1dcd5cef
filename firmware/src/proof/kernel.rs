//! The functions that the kernel is made of, and what opening stands on: chapters 1 to 9.

use crate::{any, any_direction, bytes, i, n};
use core::hint::black_box;
use selvedge::container::directions;
use selvedge::kernel::{colour, direction, fixed, interpolation, levels, material, method, position, words};
use selvedge::walk::{cost, stream};
use selvedge::{Direction, Located, Taps, Values};

/// For numbers that no file may hold.
pub fn call(files: words::Words<'_>) {
    arithmetic(files);
    directions_of(files);
    positions_and_colours();
    samples(files);
    registry();
}

/// Chapters 1, 2 and 16, and what opening reads bits with.
fn arithmetic(files: words::Words<'_>) {
    black_box((
        words::word(files, n()),
        words::packed_i16(files, n(), n()),
        words::low_i16(n()),
        words::high_i16(n()),
        words::bit_window(files, n(), n()),
    ));
    black_box((
        fixed::multiply_q15(i(), i()),
        fixed::multiply_q13(i(), i()),
        fixed::round_shift(i(), n()),
        fixed::product_high(n(), n()),
    ));
    black_box((
        fixed::divide(n(), n(), n()),
        fixed::clamp_magnitude(i(), i()),
        fixed::exp2_q31(n()),
        fixed::assemble_binary32(n(), i()),
    ));
    black_box((cost::filtered_operations(any(cost::Shape::default()), any(0)), words::low_part(n(), n())));
    let mut ones = stream::Ones::new(bytes(), n(), n());
    black_box((stream::window(bytes(), n()), ones.take(), ones.take()));
}

/// Chapter 5.
fn directions_of(files: words::Words<'_>) {
    black_box((
        direction::binary32_to_q30(n()),
        direction::project_q18(i(), n()),
        direction::direction_from_binary32(n(), n(), n()),
    ));
    black_box((
        direction::clamp_direction(any_direction()),
        direction::single_tap(n()),
        direction::sample_direction(files, n(), n()),
    ));
    black_box((
        direction::points_start(n()),
        direction::triangles_start(files, n()),
        direction::hull_start(files, n()),
        direction::grid_start(files, n()),
    ));
    black_box((
        direction::point(files, n(), n()),
        direction::point_z_q15(files, n(), n()),
        direction::cross(i(), i(), i(), i(), i(), i()),
    ));
    black_box((
        direction::ratio_q15(i(), n(), n(), i()),
        direction::coarse_q14(i()),
        direction::refine(i(), i(), i(), i(), i(), i()),
    ));
    black_box((direction::grid_cell(i(), n()), direction::dot_product(i(), i(), i(), i(), i(), i())));
    black_box((
        direction::locate(files, n(), any_direction()),
        direction::locate_on_hull(files, n(), any_direction()),
    ));
    black_box((
        direction::beyond_hull(files, n(), any_direction(), n(), n(), i()),
        Direction::from_unit_vector(any([0.0; 3])),
    ));
    black_box((
        directions::reciprocal_of(n()),
        directions::cosine_of(i(), i()),
        directions::cell_range(n(), n()),
        directions::meets_cell(any([(0, 0); 3]), (i(), i()), (i(), i())),
    ));
    black_box((direction::locate_sample(files, n(), n()), direction::between_q18(i(), i(), i())));
}

/// Chapters 6 and 7.
fn positions_and_colours() {
    black_box((
        position::fraction_from_binary32(n()),
        position::block_of(n(), n()),
        position::axis_at_texel(n(), n(), n()),
    ));
    black_box((position::axis_at_position(n(), n(), n(), n()), position::texel_at_position(n(), n())));
    let one = any(material::Material::default());
    black_box((
        position::block_count(&one, n()),
        material::level_size(n(), n()),
        selvedge::position_from_f32(any(0.0)),
    ));

    black_box(selvedge::container::metadata::is_invisible(any('a')));

    let values = any(Values::default());
    black_box((
        colour::matrix_row(i(), i(), i(), values),
        colour::present(n(), i(), i()),
        colour::transfer_log2(i(), n(), i(), i()),
    ));
    black_box((
        colour::transfer_linear(i(), i(), i()),
        colour::transfer(&one, i(), i()),
        colour::colour(&one, values, i()),
    ));
    black_box((material::channel_of(&one, n()), material::part(&one, n())));
}

/// Chapters 8 and 9.
fn samples(files: words::Words<'_>) {
    let (values, taps) = (any(Values::default()), any(Taps::default()));
    let one = any(material::Material::default());
    let channel = any(material::Channel::default());
    let (place, located) = (any(position::Place::default()), any(Located::default()));
    black_box((
        interpolation::blend_table_q15(files, n(), n(), taps, taps),
        interpolation::blend_row(files, n(), taps),
    ));
    black_box((
        interpolation::mean_q20(files, &one, channel, taps, taps),
        interpolation::scale_q15(files, &one, channel, taps, taps),
    ));
    black_box((
        interpolation::scale_texture(i(), i(), n()),
        interpolation::channel_q20(files, &one, n(), i(), taps, taps),
        method::textures_q20(files, &one, &place, &located, &located),
    ));
    black_box(interpolation::place_values(files, &one, &place, &located, &located));
    black_box((
        interpolation::place_at_position(&one, n(), n(), n()),
        interpolation::place_at_texel(&one, n(), n(), n()),
    ));
    black_box(interpolation::filtered_values(files, &one, n(), n(), n(), &located, &located));
    black_box((
        levels::between(i(), i(), i()),
        levels::trilinear_values(files, &one, n(), n(), n(), &located, &located),
    ));
    black_box((
        interpolation::point_values(files, &one, n(), n(), n(), n()),
        interpolation::texel_values(files, &one, n(), n(), &located, &located),
    ));
    black_box((
        interpolation::locate_light(files, &one, any_direction()),
        interpolation::locate_view(files, &one, any_direction()),
    ));
    black_box((interpolation::light_sample(files, &one, n()), interpolation::view_sample(files, &one, n())));
    black_box((interpolation::radiance(&one, values, &located), selvedge::next_query_word(&mut n())));
}

/// What every method says of itself.
fn registry() {
    let header = any(selvedge::Header::default());
    for number in selvedge::method::numbers() {
        if let Some(method) = selvedge::method::method_of(number ^ n()) {
            if let Some(rule) = method.section_rule(n()) {
                black_box((rule.has_instance(&header, n()), rule.call(any(true), any(false))));
            }
        }
    }
    black_box(selvedge::method::rule::layer_instance(n(), n(), n()));
}
