//! Proof at link time that no public entry of the decoder can panic: the panic handler calls a function that does not exist.
//!
//! If a panic can be reached from what is called here, the linker does not find `a_panic_can_be_reached`. Every argument is read
//! through a volatile read, slices with their lengths, so the compiler knows nothing of it and nothing is folded away: what holds
//! here holds for every file, every buffer and every number. Nothing allocates either: there is no allocator to link.
//!
//! Every `pub fn` of the core is called by its full path or as a method; `tests/tests/proof_list.rs` compares the two lists.
#![no_std]
#![no_main]

mod machine;

use core::fmt::Write;
use core::hint::black_box;
use machine::end;
use selvedge::{Direction, Finding, First, Limits, Part, Rule, Selvedge, Sha256, Sink, Taps, Values};
use selvedge::{
    colour, cost, direction, direction_set, ensemble, fixed, interpolation, material, position, result,
    stream, tensor, words,
};

/// A value that the compiler knows nothing of.
#[inline(always)]
fn any<T: Copy>(value: T) -> T {
    // SAFETY: a reference to an initialised local.
    unsafe { core::ptr::read_volatile(&value) }
}

/// Any number.
fn n() -> u32 {
    any(77)
}

/// Any signed number.
fn i() -> i32 {
    any(-77)
}

/// Any bytes, of any length.
fn bytes() -> &'static [u8] {
    any(&[])
}

/// Room of any length for results.
#[cfg(feature = "batch")]
fn room<T: Copy>(mut nothing: [T; 0]) -> &'static mut [T] {
    let empty: *mut [T] = &mut nothing;
    // SAFETY: an empty slice may be anywhere; that it is empty only this line knows.
    unsafe { &mut *any(empty) }
}

/// Text goes nowhere.
struct Nowhere;

impl Write for Nowhere {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        black_box(text);
        Ok(())
    }
}

pub fn start() -> ! {
    let files = any(words::Words { file: &[], dictionary: &[] });
    containers();
    kernel(files);
    method(files);
    second_method(files);
    #[cfg(feature = "planted")]
    black_box([1, 2, 3][any(5usize)]);
    end(true)
}

/// Opening, checking, and what an open material answers.
fn containers() {
    let (file, dictionary) = (bytes(), any(Some(bytes())));
    let limits = any(Limits::default());
    let mut count = 0u32;
    let mut sink = |finding: Finding| {
        count ^= finding.found;
        tell(finding);
        any(true)
    };
    black_box(selvedge::validate(file, dictionary, &limits, &mut sink));
    black_box(selvedge::open_reporting(file, dictionary, &limits, &mut sink).is_some());
    let mut first = First::default();
    black_box(first.report(any(Finding { rule: Rule::Magic, part: Part::File, offset: 0, found: 0 })));
    black_box(selvedge::validate(file, dictionary, &limits, &mut first));
    for opened in [selvedge::open(file, &limits), selvedge::open_with(file, dictionary, &limits)] {
        match opened {
            Ok(material) => answers(material.with_layers(n())),
            Err(finding) => tell(finding),
        }
    }
    let header = selvedge::Header::read(|at| at ^ n());
    black_box((header.is_full(n()), header.has_texture()));
    let mut hash = any(Sha256Parts(bytes(), bytes())).hash();
    hash.update(bytes());
    black_box((hash.finish(), selvedge::sha256(bytes()), selvedge::crc32(n(), bytes()), count));
}

/// A hash that has taken in something.
#[derive(Clone, Copy)]
struct Sha256Parts(&'static [u8], &'static [u8]);

impl Sha256Parts {
    fn hash(self) -> Sha256 {
        let mut hash = Sha256::default();
        hash.update(self.0);
        hash.update(self.1);
        hash
    }
}

/// What a finding can be asked for, and its text.
fn tell(finding: Finding) {
    let rule = finding.rule;
    black_box((rule.id(), rule.name(), rule.title(), rule.family()));
    black_box(write!(Nowhere, "{finding}").is_ok());
}

fn any_direction() -> Direction {
    any(Direction::default())
}

fn answers(material: Selvedge<'_>) {
    black_box((*material.header(), *material.material(), material.words(), material.metadata()));
    material.sections().for_each(|section| _ = black_box(section));
    black_box((
        material.material_at(n(), n()).to_words(),
        material.light_direction(n()),
        material.view_direction(n()),
    ));
    let (light, view) = (any_direction(), any_direction());
    black_box((material.locate_light(light), material.locate_view(view)));
    // Taps that no set of directions has, too.
    let taps = any(Taps::default());
    black_box((material.point(n(), n(), n(), n()), material.point_values(n(), n(), n(), n())));
    black_box((
        material.filtered(n(), n(), light, view).to_words(),
        material.filtered_values(n(), n(), taps, taps),
    ));
    black_box((material.trilinear(n(), n(), n(), light, view).to_f32(), material.decode_digest()));
    #[cfg(feature = "batch")]
    {
        let (scratch, out, values) = (room([0i32; 0]), room([colour::Rgb::default(); 0]), room([0i32; 0]));
        black_box((
            material.image_size(n()),
            material.image_scratch_len(),
            material.batch_scratch_len(any(1)),
        ));
        let told = [
            material.decode_channel(any(1), n(), light, view, scratch, values),
            material.decode_image(n(), light, view, scratch, out),
            material.sample_batch(any(&[]), scratch, out),
        ];
        for lack in told.into_iter().filter_map(Result::err) {
            black_box(write!(Nowhere, "{lack}").is_ok());
        }
        black_box(selvedge::FilteredQuery::from_f32(any([0.0; 2]), any([0.0; 3]), any([0.0; 3])));
    }
}

/// Chapters 1 to 9: the functions that the kernel is made of, for numbers that no file may hold.
fn kernel(files: words::Words<'_>) {
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
        direction_set::reciprocal_of(n()),
        direction_set::cosine_of(i(), i()),
        direction_set::cell_range(n(), n()),
        direction_set::meets_cell(any([(0, 0); 3]), (i(), i()), (i(), i())),
    ));

    black_box((
        position::fraction_from_binary32(n()),
        position::block_of(n(), n()),
        position::axis_at_texel(n(), n(), n()),
    ));
    black_box((position::axis_at_position(n(), n(), n(), n()), position::texel_at_position(n(), n())));
    let one = any(material::Material::default());
    let channel = any(material::Channel::default());
    black_box((
        position::block_count(&one, n()),
        material::level_size(n(), n()),
        selvedge::position_from_f32(any(0.0)),
    ));

    black_box(selvedge::container::metadata::is_invisible(any('a')));

    let (values, taps) = (any(Values::default()), any(Taps::default()));
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

    let axis = any(position::Axis::default());
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
        interpolation::channel_q20(files, &one, channel, i(), n(), axis, axis, taps, taps),
    ));
    black_box((
        interpolation::channel_of(&one, n()),
        interpolation::level_values(files, &one, n(), axis, axis, taps, taps),
    ));
    black_box((
        interpolation::filtered_values(files, &one, n(), n(), n(), taps, taps),
        interpolation::between(i(), i(), i()),
    ));
    black_box((
        interpolation::trilinear_values(files, &one, n(), n(), n(), taps, taps),
        interpolation::point_values(files, &one, n(), n(), n(), n()),
    ));
    black_box(interpolation::texel_values(files, &one, n(), n(), taps, taps));
    black_box((
        interpolation::locate_light(files, &one, any_direction()),
        interpolation::locate_view(files, &one, any_direction()),
    ));
    black_box((interpolation::radiance(&one, values, taps), result::next_query_word(&mut n())));
    black_box((
        cost::record_operations(n(), n()),
        cost::layer_operations(n(), n(), n()),
        cost::filtered_operations(any(cost::Shape::default()), any(0)),
    ));
}

/// Chapter 10, and the fast way through its streams.
fn method(files: words::Words<'_>) {
    let (taps, span, axis) =
        (any(Taps::default()), any(position::Span::default()), any(position::Axis::default()));
    let (one, channel) = (any(material::Material::default()), any(material::Channel::default()));
    let record = any(ensemble::Record::default());
    black_box((
        words::low_part(n(), n()),
        ensemble::coefficients_start(files, &one, channel, n(), n()),
        ensemble::read_record(files, n(), n()),
    ));
    black_box((
        ensemble::dequantise(n(), n(), n()),
        ensemble::blend_column(files, n(), n(), taps, n()),
        ensemble::blend_span(files, n(), n(), span, n()),
    ));
    black_box(ensemble::record_q20(files, channel, record, span, span, taps, taps));
    black_box(ensemble::block_q20(files, &one, channel, n(), span, span, taps, taps));
    black_box(ensemble::texture_q20(files, &one, channel, n(), axis, axis, taps, taps));
    let mut ones = stream::Ones::new(bytes(), n(), n());
    black_box((stream::window(bytes(), n()), ones.take(), ones.take()));
}

/// Chapter 12.
fn second_method(files: words::Words<'_>) {
    let (taps, axis) = (any(Taps::default()), any(position::Axis::default()));
    let (one, list) = (any(material::Material::default()), any(tensor::List::default()));
    black_box((
        tensor::bit_length(n()),
        tensor::list_low_bits(n(), n()),
        tensor::list_bits(n(), n(), n(), n()),
        tensor::list_coefficient(n(), n()),
    ));
    black_box((
        tensor::lists_start(files, &one, n(), n()),
        tensor::next_coefficient(files, list),
        tensor::open_list(files, n(), n(), n()),
        tensor::no_list(),
    ));
    black_box((
        tensor::light_entry(n(), n()),
        tensor::blend_light(n(), n(), n(), taps, n()),
        tensor::corner_weight(i(), i(), i()),
    ));
    black_box((
        tensor::add_fibre(files, &one, n(), n(), i(), taps, any(Values::default())),
        tensor::angular_q15(files, &one, n(), n(), taps, taps),
    ));
    black_box((
        tensor::layer_q20(files, &one, n(), n(), axis, axis, taps, taps),
        tensor::textures_q20(files, &one, n(), axis, axis, taps, taps),
    ));
}

#[cfg(feature = "proof")]
unsafe extern "C" {
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(feature = "proof")]
    // SAFETY: never called, for it does not exist: that is what the linker finds out.
    unsafe {
        a_panic_can_be_reached()
    }
    #[cfg(not(feature = "proof"))]
    end(false)
}
