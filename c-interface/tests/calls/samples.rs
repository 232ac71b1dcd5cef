//! Samples, directions, images and batches are the core's, word for word, from any number of threads.

use super::common::{Numbers, expected_print, fixture_bytes};
use super::{NONE, UP, c, open_in_c, told};
use selvedge::kernel::interpolation::{radiance, texel_values};
use selvedge::kernel::levels::trilinear_values;
use selvedge::{Direction, FilteredQuery, Limits, Located, Rgb, Selvedge, Taps, Values, open};
use selvedge_c::*;
use std::ptr::{null, null_mut};

/// A located direction that no direction gives.
fn wild_located(numbers: &mut Numbers) -> Located {
    let [a, b, c] = [0; 3].map(|_| numbers.word());
    let [weight_a_q15, weight_b_q15, weight_c_q15, cosine_q15] = [0; 4].map(|_| numbers.word() as i32);
    let taps = Taps { a, b, c, weight_a_q15, weight_b_q15, weight_c_q15, cosine_q15 };
    let [clamped_x_q18, clamped_y_q18, x_q18, y_q18, z_q15] = [0; 5].map(|_| numbers.word() as i32);
    Located { direction: Direction { x_q18, y_q18, z_q15 }, clamped_x_q18, clamped_y_q18, taps }
}

/// Random queries of every function of single samples.
fn hold_samples(m: &selvedge_material, core: &Selvedge<'_>, numbers: &mut Numbers, count: usize) {
    for _ in 0..count {
        // Mostly within the image, now and then beyond all ends.
        let wild = numbers.below(16) == 0;
        let mut index = |end: u32| if wild { numbers.word() } else { numbers.below(end) };
        let (x, y, l, v) = (
            index(core.header().width),
            index(core.header().height),
            index(core.header().light_count),
            index(core.header().view_count),
        );
        assert_eq!(told(|o| c!(selvedge_sample_point(m, x, y, l, v, o))), core.point(x, y, l, v));
        assert_eq!(told(|o| c!(selvedge_point_values(m, x, y, l, v, o))), core.point_values(x, y, l, v));
        assert_eq!(told(|o| c!(selvedge_light_direction(m, l, o))), core.light_direction(l));
        assert_eq!(told(|o| c!(selvedge_view_direction(m, v, o))), core.view_direction(v));

        let (light, view) = (numbers.direction(), numbers.direction());
        let (lt, vt) = (core.locate_light(light), core.locate_view(view));
        assert_eq!(told(|o| c!(selvedge_locate_light(m, &light, o))), lt);
        assert_eq!(told(|o| c!(selvedge_locate_view(m, &view, o))), vt);

        let (p, q, level) = (
            numbers.word(),
            numbers.word(),
            if wild { numbers.word() } else { numbers.below(core.header().level_count << 16) },
        );
        let texel = texel_values(core.words(), core.material(), x, y, &lt, &vt);
        assert_eq!(told(|o| c!(selvedge_texel_values(m, x, y, &lt, &vt, o))), texel);
        assert_eq!(
            told(|o| c!(selvedge_sample_texel(m, x, y, &light, &view, o))),
            radiance(core.material(), texel, &lt)
        );
        assert_eq!(told(|o| c!(selvedge_radiance(m, &texel, &lt, o))), radiance(core.material(), texel, &lt));
        assert_eq!(
            told(|o| c!(selvedge_filtered_values(m, p, q, &lt, &vt, o))),
            core.filtered_values(p, q, &lt, &vt)
        );
        assert_eq!(
            told(|o| c!(selvedge_sample_filtered(m, p, q, &light, &view, o))),
            core.filtered(p, q, light, view)
        );
        let between = trilinear_values(core.words(), core.material(), level, p, q, &lt, &vt);
        assert_eq!(told(|o| c!(selvedge_trilinear_values(m, level, p, q, &lt, &vt, o))), between);
        assert_eq!(
            told(|o| c!(selvedge_sample_trilinear(m, level, p, q, &light, &view, o))),
            core.trilinear(level, p, q, light, view)
        );
    }
}

#[test]
fn samples_are_those_of_the_core() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let material = open_in_c(&bytes);
    let mut numbers = Numbers::new(1);
    hold_samples(&material, &core, &mut numbers, 4000);

    // A copy is as good, and each number of layers is a material of its own.
    let copy = material;
    hold_samples(&copy, &core, &mut numbers, 20);
    for layers in [0, 1, core.header().layer_count, u32::MAX] {
        let mut limited = selvedge_material::CLOSED;
        assert_eq!(c!(selvedge_with_layers(&material, layers, &mut limited)), SELVEDGE_OK);
        hold_samples(&limited, &core.with_layers(layers), &mut numbers, 100);
        let digest =
            told(|o: *mut [u8; SELVEDGE_DIGEST_LENGTH]| c!(selvedge_decode_digest(&limited, o.cast())));
        assert_eq!(digest, core.with_layers(layers).decode_digest());
    }
    let mut own = material;
    let place = &raw mut own;
    assert_eq!(
        c!(selvedge_with_layers(place, 1, place)),
        SELVEDGE_OK,
        "a material may be limited where it is"
    );
    hold_samples(&own, &core.with_layers(1), &mut numbers, 20);
}

/// The valid vectors of the conformance suite: external dictionaries, several levels and layers, all states
/// and transfers.
#[test]
fn the_suite_is_sampled_as_by_the_core() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/vectors");
    let read = |file: &str| std::fs::read(folder.join(file)).expect("a file of the suite");
    let manifest = String::from_utf8(read("manifest.tsv")).expect("text");
    let (mut materials, mut outside) = (0, 0);
    for line in manifest.lines().filter(|line| line.starts_with("valid")) {
        let columns: Vec<&str> = line.split('\t').collect();
        let (bytes, dictionary) = (read(columns[1]), (columns[2] != "-").then(|| read(columns[2])));
        let Ok(core) = selvedge::open_with(&bytes, dictionary.as_deref(), &Limits::default()) else {
            continue;
        };
        let (at, length) = dictionary.as_ref().map_or((null(), 0), |d| (d.as_ptr(), d.len()));
        let mut material = selvedge_material::CLOSED;
        assert_eq!(
            c!(selvedge_open(bytes.as_ptr(), bytes.len(), at, length, null(), &mut material, null_mut())),
            SELVEDGE_OK,
            "{line}"
        );
        hold_samples(&material, &core, &mut Numbers::new(materials), 40);
        let digest =
            told(|o: *mut [u8; SELVEDGE_DIGEST_LENGTH]| c!(selvedge_decode_digest(&material, o.cast())));
        let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(digest, columns[3], "{line}");
        materials += 1;
        outside += usize::from(dictionary.is_some());
    }
    assert!(materials > 25 && outside >= 2, "{materials} {outside}");
}

/// Any located directions and values are safe, though they mean nothing.
#[test]
fn wild_directions_are_safe() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let m = open_in_c(&bytes);
    let mut numbers = Numbers::new(2);
    for _ in 0..2000 {
        let (lt, vt) = (wild_located(&mut numbers), wild_located(&mut numbers));
        let [x, y, level] = [0; 3].map(|_| numbers.word());
        assert_eq!(
            told(|o| c!(selvedge_filtered_values(&m, x, y, &lt, &vt, o))),
            core.filtered_values(x, y, &lt, &vt)
        );
        let texel = texel_values(core.words(), core.material(), x, y, &lt, &vt);
        assert_eq!(told(|o| c!(selvedge_texel_values(&m, x, y, &lt, &vt, o))), texel);
        let between = trilinear_values(core.words(), core.material(), level, x, y, &lt, &vt);
        assert_eq!(told(|o| c!(selvedge_trilinear_values(&m, level, x, y, &lt, &vt, o))), between);
        let [c0, c1, c2] = [0; 3].map(|_| numbers.word() as i32);
        let values = Values { c0, c1, c2 };
        assert_eq!(
            told(|o| c!(selvedge_radiance(&m, &values, &lt, o))),
            radiance(core.material(), values, &lt)
        );
    }
}

#[test]
fn directions_and_positions_are_those_of_the_core() {
    let mut numbers = Numbers::new(3);
    for _ in 0..4000 {
        let (light, view) = (numbers.vector(), numbers.vector());
        let position = [0; 2].map(|_| f32::from_bits(numbers.word()));
        let [x, y, z] = light.map(f32::to_bits);
        assert_eq!(
            told(|o| c!(selvedge_direction_from_vector(light.as_ptr(), o))),
            Direction::from_unit_vector(light)
        );
        assert_eq!(
            told(|o| c!(selvedge_direction_from_bits(x, y, z, o))),
            Direction::from_unit_vector(light)
        );
        assert_eq!(
            selvedge_position_from_bits(position[0].to_bits()),
            selvedge::position_from_f32(position[0])
        );
        let query =
            told(|o| c!(selvedge_query_from_floats(position.as_ptr(), light.as_ptr(), view.as_ptr(), o)));
        assert_eq!(query, selvedge_query::from(FilteredQuery::from_f32(position, light, view)));
    }
    for position in [1.25f32, -0.75] {
        assert_eq!(selvedge_position_from_bits(position.to_bits()), 0x4000_0000, "as the header says");
    }
}

#[test]
fn images_are_those_of_the_core() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let m = open_in_c(&bytes);
    let mut numbers = Numbers::new(4);
    let needed = told(|o| c!(selvedge_image_scratch_length(&m, o)));
    assert_eq!(needed, core.image_scratch_len());
    for level in [0, 1, u32::MAX] {
        let (mut width, mut height) = (0, 0);
        assert_eq!(c!(selvedge_image_size(&m, level, &mut width, &mut height)), SELVEDGE_OK);
        assert_eq!([width, height], core.image_size(level));
        let count = (width * height) as usize;
        let (light, view) = (numbers.direction(), numbers.direction());
        // Lent memory holds anything; one element more than needed stays as it is.
        let mut scratch = vec![-1; needed];
        let mut out = vec![NONE; count + 1];
        assert_eq!(
            c!(selvedge_decode_image(
                &m,
                level,
                &light,
                &view,
                scratch.as_mut_ptr(),
                needed,
                out.as_mut_ptr(),
                count + 1
            )),
            SELVEDGE_OK
        );
        let mut wanted = vec![Rgb::default(); count];
        core.decode_image(level, light, view, &mut vec![0; needed], &mut wanted)
            .expect("buffers are long enough");
        assert_eq!((&out[..count], out[count]), (&wanted[..], NONE));
        for channel in [0, 1, 2, 3, u32::MAX] {
            let mut out = vec![77; count + 1];
            let (s, o) = (scratch.as_mut_ptr(), out.as_mut_ptr());
            assert_eq!(
                c!(selvedge_decode_channel(&m, channel, level, &light, &view, s, needed, o, count + 1)),
                SELVEDGE_OK
            );
            let mut wanted = vec![0; count];
            core.decode_channel(
                channel.min(2) as usize,
                level,
                light,
                view,
                &mut vec![0; needed],
                &mut wanted,
            )
            .expect("buffers are long enough");
            assert_eq!((&out[..count], out[count]), (&wanted[..], 77));
        }
    }
}

#[test]
fn batches_are_those_of_the_core() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let m = open_in_c(&bytes);
    let mut numbers = Numbers::new(5);
    for count in [0, 1, 7, 8, 3000] {
        let mut query = || selvedge_query {
            u_q32: numbers.word(),
            v_q32: numbers.word(),
            light: numbers.direction(),
            view: numbers.direction(),
        };
        let queries: Vec<_> = (0..count).map(|_| query()).collect();
        let needed = told(|o| c!(selvedge_batch_scratch_length(&m, count, o)));
        assert_eq!(needed, core.batch_scratch_len(count));
        let mut scratch = vec![-1; needed];
        let mut out = vec![NONE; count + 1];
        assert_eq!(
            c!(selvedge_sample_batch(
                &m,
                queries.as_ptr(),
                count,
                scratch.as_mut_ptr(),
                needed,
                out.as_mut_ptr(),
                count + 1
            )),
            SELVEDGE_OK
        );
        let wanted: Vec<_> =
            queries.iter().map(|q| core.filtered(q.u_q32, q.v_q32, q.light, q.view)).collect();
        assert_eq!((&out[..count], out[count]), (&wanted[..], NONE));

        let mut floats = vec![-1.0; count * 3 + 1];
        assert_eq!(
            c!(selvedge_to_floats(out.as_ptr(), count, floats.as_mut_ptr(), count * 3 + 1)),
            SELVEDGE_OK
        );
        let wanted: Vec<f32> = wanted.iter().flat_map(|rgb| rgb.to_f32()).collect();
        assert_eq!((&floats[..count * 3], floats[count * 3]), (&wanted[..], -1.0));
        let place = out.as_mut_ptr();
        assert_eq!(c!(selvedge_to_floats(place, count, place.cast(), count * 3)), SELVEDGE_OK, "in place");
        assert_eq!(out.iter().take(count).flat_map(|rgb| rgb.to_f32()).collect::<Vec<_>>(), wanted);
    }
}

/// One material, sampled and decoded by many threads at once.
#[test]
fn many_threads_share_a_material() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let material = open_in_c(&bytes);
    // A material holds pointers in words; a shared reference to it goes to threads as its address does in C.
    struct Shared(*const selvedge_material);
    // SAFETY: the interface promises that any number of threads may read one material.
    unsafe impl Sync for Shared {}
    let shared = &Shared(&material);
    let image_length = (core.header().width * core.header().height) as usize;
    let mut wanted = vec![Rgb::default(); image_length];
    core.decode_image(0, UP, UP, &mut vec![0; core.image_scratch_len()], &mut wanted)
        .expect("buffers are long enough");
    let wanted = &wanted;
    std::thread::scope(|scope| {
        for thread in 0..16 {
            scope.spawn(move || {
                // SAFETY: the material outlives the scope, and nobody writes it.
                let m = unsafe { &*{ shared }.0 };
                hold_samples(m, &core, &mut Numbers::new(100 + thread), 200);
                let mut scratch = vec![-1; core.image_scratch_len()];
                let mut out = vec![NONE; image_length];
                let status = c!(selvedge_decode_image(
                    m,
                    0,
                    &UP,
                    &UP,
                    scratch.as_mut_ptr(),
                    scratch.len(),
                    out.as_mut_ptr(),
                    out.len()
                ));
                assert_eq!((status, &out), (SELVEDGE_OK, wanted));
                assert_eq!(
                    told(|o: *mut [u8; 32]| c!(selvedge_decode_digest(m, o.cast()))),
                    core.decode_digest()
                );
            });
        }
    });
    assert!(expected_print(&core).contains("digest"), "the core is as it was");
}
