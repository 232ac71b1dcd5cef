//! Each C function gives the core's words, tells mistakes by statuses, and may be called from many threads.

mod common;

use common::{Numbers, broken_files, expected_print, fixture_bytes};
use selvedge::kernel::interpolation::{radiance, texel_values};
use selvedge::kernel::levels::trilinear_values;
use selvedge::{
    Direction, Family, FilteredQuery, Finding, Limits, Located, Part, Rgb, Rule, Selvedge, Taps, Values, open,
};
use selvedge_c::*;
use std::ffi::{CStr, c_char, c_void};
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

const NONE: Rgb = Rgb { r: 0xdead_beef, g: 0xdead_beef, b: 0xdead_beef };
const UP: Direction = Direction { x_q18: 0, y_q18: 0, z_q15: SELVEDGE_ONE_Q15 };

/// What a function wrote, and that it went well.
fn told<T: Default>(call: impl FnOnce(*mut T) -> selvedge_status) -> T {
    let mut out = T::default();
    assert_eq!(call(&mut out), SELVEDGE_OK);
    out
}

/// Calls a function of the interface with pointers into memory that lives on. One place, so one promise.
macro_rules! c {
    ($name:ident($($argument:expr),* $(,)?)) => {
        // SAFETY: every pointer that a test hands over is of live memory of its type, or one that the function has to refuse.
        unsafe { $name($($argument),*) }
    };
}

fn open_in_c(bytes: &[u8]) -> selvedge_material {
    let mut material = selvedge_material::CLOSED;
    let mut finding = selvedge_finding { rule: 9, ..selvedge_finding::default() };
    assert_eq!(
        c!(selvedge_open(bytes.as_ptr(), bytes.len(), null(), 0, null(), &mut material, &mut finding)),
        SELVEDGE_OK
    );
    assert_eq!(finding, selvedge_finding::default(), "no finding");
    material
}

fn string(text: *const c_char) -> String {
    // SAFETY: the interface promises a constant string with a NUL.
    unsafe { CStr::from_ptr(text) }.to_str().expect("texts are ASCII").into()
}

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
fn images_and_batches_are_those_of_the_core() {
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

#[test]
fn header_metadata_and_limits_are_those_of_the_core() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let m = open_in_c(&bytes);
    assert_eq!(told(|o| c!(selvedge_read_header(&m, o))), selvedge_header::from(core.header()));
    let limits = told(|o| c!(selvedge_default_limits(o)));
    assert_eq!(Limits::from(limits), Limits::default());
    let mut metadata = MaybeUninit::<selvedge_metadata>::uninit();
    assert_eq!(c!(selvedge_read_metadata(&m, metadata.as_mut_ptr())), SELVEDGE_OK);
    // SAFETY: written, as the status says.
    let metadata = unsafe { metadata.assume_init() };
    let wanted = core.metadata();
    let codes = [
        metadata.texel_width_nm,
        metadata.texel_height_nm,
        metadata.frame,
        metadata.image_origin,
        metadata.primaries,
    ];
    assert_eq!(
        codes,
        [wanted.texel_width_nm, wanted.texel_height_nm, wanted.frame, wanted.image_origin, wanted.primaries]
    );
    for (text, wanted) in
        [(metadata.name, wanted.name), (metadata.origin, wanted.origin), (metadata.licence, wanted.licence)]
    {
        // The very bytes of the file.
        assert_eq!((text.text.cast(), text.length), (wanted.as_ptr(), wanted.len()));
    }
    // Limits are asked: with one byte less the file is refused.
    let mut material = m;
    let tight = selvedge_limits { bytes: bytes.len() as u32 - 1, ..limits };
    assert_eq!(
        c!(selvedge_open(bytes.as_ptr(), bytes.len(), null(), 0, &tight, &mut material, null_mut())),
        SELVEDGE_LIMITS
    );
    assert_eq!(
        c!(selvedge_read_header(&material, &mut selvedge_header::default())),
        SELVEDGE_NOT_OPEN,
        "a refused file leaves nothing open"
    );
}

#[test]
fn rules_and_statuses_have_texts() {
    assert_eq!(selvedge_abi_version(), SELVEDGE_ABI_VERSION);
    assert_eq!(selvedge_rule_count() as usize, Rule::ALL.len());
    for (number, rule) in (1..).zip(Rule::ALL) {
        let texts =
            [selvedge_rule_id(number), selvedge_rule_name(number), selvedge_rule_title(number)].map(string);
        assert_eq!(texts, [rule.id(), rule.name(), rule.title()]);
        let wanted = match rule.family() {
            Family::Invalid => SELVEDGE_INVALID,
            Family::Unsupported => SELVEDGE_UNSUPPORTED,
            Family::Limits => SELVEDGE_LIMITS,
            Family::Usage => SELVEDGE_USAGE,
        };
        assert_eq!(selvedge_rule_family(number), wanted);
    }
    for number in [0, selvedge_rule_count() + 1, u32::MAX] {
        assert_eq!(
            [selvedge_rule_id(number), selvedge_rule_name(number), selvedge_rule_title(number)].map(string),
            [""; 3]
        );
        assert_eq!(selvedge_rule_family(number), SELVEDGE_NO_RULE);
    }
    let statuses = (0..=1).chain(3..=5).chain(16..=22);
    let texts: std::collections::BTreeSet<_> =
        statuses.clone().map(|status| string(selvedge_status_text(status))).collect();
    assert_eq!(texts.len(), statuses.count(), "each status has its own text");
    assert!(
        [i32::MIN, -1, 2, 6, 23, i32::MAX]
            .iter()
            .all(|&status| string(selvedge_status_text(status)) == "not a status")
    );
}

/// Keeps what it is told; goes on while there is room.
struct Kept {
    findings: Vec<selvedge_finding>,
    room: usize,
}

unsafe extern "C-unwind" fn keep(context: *mut c_void, finding: *const selvedge_finding) -> i32 {
    // SAFETY: the tests below give a `Kept` that lives during the call.
    let kept = unsafe { &mut *context.cast::<Kept>() };
    // SAFETY: the library hands over a finding that lives during the call.
    kept.findings.push(unsafe { *finding });
    (kept.findings.len() < kept.room) as i32
}

#[test]
fn findings_are_those_of_the_core() {
    let good = fixture_bytes();
    assert_eq!(
        c!(selvedge_validate(good.as_ptr(), good.len(), null(), 0, null(), None, null_mut())),
        SELVEDGE_OK
    );
    for (name, bytes) in broken_files() {
        let limits = Limits::default();
        let wanted = open(&bytes, &limits).expect_err("the file is broken");
        let mut material = selvedge_material::CLOSED;
        let mut finding = selvedge_finding::default();
        let status =
            c!(selvedge_open(bytes.as_ptr(), bytes.len(), null(), 0, null(), &mut material, &mut finding));
        assert_eq!((status, finding), (selvedge_rule_family(finding.rule), wanted.into()), "{name}");
        assert_eq!(string(selvedge_rule_id(finding.rule)), wanted.rule.id(), "{name}");
        assert_eq!(c!(selvedge_decode_digest(&material, [0; 32].as_mut_ptr())), SELVEDGE_NOT_OPEN, "{name}");

        let mut all = Vec::new();
        selvedge::validate(&bytes, None, &limits, &mut |finding: Finding| {
            all.push(selvedge_finding::from(finding));
            true
        });
        for room in [1, usize::MAX] {
            let mut kept = Kept { findings: Vec::new(), room };
            let context = (&raw mut kept).cast();
            assert_eq!(
                c!(selvedge_validate(bytes.as_ptr(), bytes.len(), null(), 0, null(), Some(keep), context)),
                status,
                "{name}"
            );
            assert_eq!(kept.findings, all[..all.len().min(room)], "{name}");
        }
        assert_eq!(
            c!(selvedge_validate(bytes.as_ptr(), bytes.len(), null(), 0, null(), None, null_mut())),
            status,
            "{name}"
        );
    }
    let dictionary: selvedge_finding =
        Finding { rule: Rule::Magic, part: Part::Dictionary, offset: 4, found: 5 }.into();
    assert_eq!(dictionary, selvedge_finding { rule: 2, part: SELVEDGE_PART_DICTIONARY, offset: 4, found: 5 });
}

/// A pointer one byte beyond a good one. Nobody may follow it.
fn askew<T>(pointer: *const T) -> *const T {
    pointer.wrapping_byte_add(1)
}

#[test]
fn mistakes_of_opening_give_statuses() {
    let bytes = fixture_bytes();
    let (b, n) = (bytes.as_ptr(), bytes.len());
    let mut m = open_in_c(&bytes);
    let mut finding = selvedge_finding { rule: 99, ..selvedge_finding::default() };
    let limits = told(|o| c!(selvedge_default_limits(o)));
    let out = &raw mut m;
    let at = &raw mut finding;
    let is_open = || c!(selvedge_read_header(out, &mut selvedge_header::default())) == SELVEDGE_OK;

    assert_eq!(c!(selvedge_open(b, n, null(), 0, null(), null_mut(), at)), SELVEDGE_NULL_POINTER);
    assert_eq!(c!(selvedge_open(b, n, null(), 0, null(), askew(out).cast_mut(), at)), SELVEDGE_MISALIGNED);
    assert!(is_open(), "what could not be written was not touched");
    let failing: [(_, selvedge_status); 7] = [
        ((null(), n, null(), 0, null(), at), SELVEDGE_NULL_POINTER),
        ((b, n, null(), 1, null(), at), SELVEDGE_NULL_POINTER),
        ((b, n, null(), usize::MAX, null(), at), SELVEDGE_NULL_POINTER),
        ((null(), usize::MAX, null(), 0, null(), at), SELVEDGE_NULL_POINTER),
        ((b, n, null(), 0, askew(&raw const limits), at), SELVEDGE_MISALIGNED),
        ((b, n, null(), 0, null(), askew(at).cast_mut()), SELVEDGE_MISALIGNED),
        ((b, n, null(), 0, null(), out.cast()), SELVEDGE_OVERLAP),
    ];
    for (case, ((bytes, length, dictionary, dictionary_length, limits, finding), wanted)) in
        failing.into_iter().enumerate()
    {
        m = open_in_c(&fixture_bytes());
        let out = &raw mut m;
        assert_eq!(
            c!(selvedge_open(bytes, length, dictionary, dictionary_length, limits, out, finding)),
            wanted,
            "case {case}"
        );
        let closed = c!(selvedge_read_header(out, &mut selvedge_header::default()));
        assert_eq!(closed, SELVEDGE_NOT_OPEN, "case {case}");
    }
    // A length that no memory has, well away from everything else that is lent.
    let far = std::ptr::without_provenance(usize::MAX - 4096);
    let out = &raw mut m;
    assert_eq!(c!(selvedge_open(far, usize::MAX / 2 + 1, null(), 0, null(), out, at)), SELVEDGE_TOO_LONG);
    assert_eq!(c!(selvedge_validate(far, 8192, null(), 0, null(), None, null_mut())), SELVEDGE_TOO_LONG);
    assert_eq!(finding.rule, 99, "no file was looked at");

    // Results over what is read.
    let mut memory = [selvedge_material::CLOSED; 2];
    let place = memory.as_mut_ptr();
    assert_eq!(
        c!(selvedge_open(place.cast::<u8>().wrapping_add(500), 100, null(), 0, null(), place, null_mut())),
        SELVEDGE_OVERLAP
    );
    assert_eq!(c!(selvedge_open(b, n, place.cast(), 16, null(), place, null_mut())), SELVEDGE_OVERLAP);
    assert_eq!(c!(selvedge_open(b, n, null(), 0, place.cast(), place, null_mut())), SELVEDGE_OVERLAP);
    assert_eq!(
        c!(selvedge_open(place.cast(), 100, null(), 0, null(), place.wrapping_add(1), place.cast())),
        SELVEDGE_OVERLAP
    );

    // Nothing at all is an empty file, and an empty dictionary is one that nobody asked for.
    assert_eq!(c!(selvedge_open(null(), 0, null(), 0, null(), out, at)), SELVEDGE_INVALID);
    assert_eq!((finding.rule, finding.found), (1, 0));
    assert_eq!(c!(selvedge_open(b, n, b, 0, null(), out, at)), SELVEDGE_USAGE);
    assert_eq!(string(selvedge_rule_name(finding.rule)), "ExternalUnwanted");
    for (bytes, length, limits, wanted) in
        [(null(), 1, null(), SELVEDGE_NULL_POINTER), (b, n, askew(&raw const limits), SELVEDGE_MISALIGNED)]
    {
        assert_eq!(c!(selvedge_validate(bytes, length, null(), 0, limits, None, null_mut())), wanted);
    }
}

/// Each function with a good material, then with none, an askew one, and memory that was never opened.
#[test]
fn mistakes_about_materials_give_statuses() {
    let bytes = fixture_bytes();
    let good = open_in_c(&bytes);
    let taps = told(|o| c!(selvedge_locate_light(&good, &UP, o)));
    let (up, values): (*const Direction, _) = (&UP, Values::default());
    let query = selvedge_query::default();
    let mut scratch = vec![
        0i32;
        told(|o| c!(selvedge_image_scratch_length(&good, o)))
            .max(told(|o| c!(selvedge_batch_scratch_length(&good, 1, o))))
    ];
    let mut image = vec![NONE; 3600];
    let (s, sn) = (scratch.as_mut_ptr(), scratch.len());
    let i = image.as_mut_ptr();
    // Room for any result, aligned for all.
    let mut room = [0u64; 64];
    let out = room.as_mut_ptr();
    type Call<'a> = Box<dyn Fn(*const selvedge_material, *mut u8) -> selvedge_status + 'a>;
    let calls: Vec<Call<'_>> = vec![
        Box::new(|m, o| c!(selvedge_read_header(m, o.cast()))),
        Box::new(|m, o| c!(selvedge_read_metadata(m, o.cast()))),
        Box::new(|m, o| c!(selvedge_with_layers(m, 1, o.cast()))),
        Box::new(|m, o| c!(selvedge_light_direction(m, 0, o.cast()))),
        Box::new(|m, o| c!(selvedge_view_direction(m, 0, o.cast()))),
        Box::new(|m, o| c!(selvedge_locate_light(m, up, o.cast()))),
        Box::new(|m, o| c!(selvedge_locate_view(m, up, o.cast()))),
        Box::new(|m, o| c!(selvedge_sample_point(m, 0, 0, 0, 0, o.cast()))),
        Box::new(|m, o| c!(selvedge_sample_texel(m, 0, 0, up, up, o.cast()))),
        Box::new(|m, o| c!(selvedge_sample_filtered(m, 0, 0, up, up, o.cast()))),
        Box::new(|m, o| c!(selvedge_sample_trilinear(m, 0, 0, 0, up, up, o.cast()))),
        Box::new(|m, o| c!(selvedge_point_values(m, 0, 0, 0, 0, o.cast()))),
        Box::new(|m, o| c!(selvedge_texel_values(m, 0, 0, &taps, &taps, o.cast()))),
        Box::new(|m, o| c!(selvedge_filtered_values(m, 0, 0, &taps, &taps, o.cast()))),
        Box::new(|m, o| c!(selvedge_trilinear_values(m, 0, 0, 0, &taps, &taps, o.cast()))),
        Box::new(|m, o| c!(selvedge_radiance(m, &values, &taps, o.cast()))),
        Box::new(|m, o| c!(selvedge_image_size(m, 0, o.cast(), o.cast()))),
        Box::new(|m, o| c!(selvedge_image_scratch_length(m, o.cast()))),
        Box::new(|m, o| c!(selvedge_batch_scratch_length(m, 1, o.cast()))),
        Box::new(|m, o| {
            c!(selvedge_decode_image(m, 0, up, up, s, sn, if o.cast() == out { i } else { o.cast() }, 3600))
        }),
        Box::new(|m, o| {
            c!(selvedge_decode_channel(
                m,
                0,
                0,
                up,
                up,
                s,
                sn,
                if o.cast() == out { i.cast() } else { o.cast() },
                3600
            ))
        }),
        Box::new(|m, o| c!(selvedge_sample_batch(m, &query, 1, s, sn, o.cast(), 1))),
        Box::new(|m, o| {
            if o.cast() == out || o.is_null() {
                c!(selvedge_decode_digest(m, o))
            } else {
                SELVEDGE_MISALIGNED
            }
        }),
    ];
    let mut numbers = Numbers::new(5);
    let mut noise =
        [0u64; SELVEDGE_MATERIAL_WORDS].map(|_| u64::from(numbers.word()) << 32 | u64::from(numbers.word()));
    noise[0] |= 1;
    // SAFETY: a material is a row of words of any value.
    let noise = unsafe { std::mem::transmute::<[u64; SELVEDGE_MATERIAL_WORDS], selvedge_material>(noise) };
    // SAFETY: the same.
    let ones = unsafe {
        std::mem::transmute::<[u64; SELVEDGE_MATERIAL_WORDS], selvedge_material>(
            [u64::MAX; SELVEDGE_MATERIAL_WORDS],
        )
    };
    // Copied in part: the front half alone, as a short memcpy leaves it, and the back half alone.
    let half = |front: bool| {
        let mut half = selvedge_material::CLOSED;
        let skip = if front { 0 } else { 8 };
        let (from, to) = ((&raw const good).cast::<u64>(), (&raw mut half).cast::<u64>());
        // SAFETY: both have 64 words and lie apart.
        unsafe { from.wrapping_add(skip).copy_to(to.wrapping_add(skip), 8) };
        half
    };
    let halves = [half(true), half(false)];
    for (number, call) in calls.iter().enumerate() {
        assert_eq!(call(&good, out.cast()), SELVEDGE_OK, "function {number}");
        room = [0x5555; 64];
        assert_eq!(call(null(), out.cast()), SELVEDGE_NULL_POINTER, "function {number}");
        assert_eq!(call(askew(&good), out.cast()), SELVEDGE_MISALIGNED, "function {number}");
        for closed in [&selvedge_material::CLOSED, &noise, &ones, &halves[0], &halves[1]] {
            assert_eq!(call(closed, out.cast()), SELVEDGE_NOT_OPEN, "function {number}");
        }
        assert_eq!(call(&good, null_mut()), SELVEDGE_NULL_POINTER, "function {number}");
        assert_eq!(call(&good, askew(out).cast_mut().cast()), SELVEDGE_MISALIGNED, "function {number}");
        assert_eq!(room, [0x5555; 64], "function {number} wrote although it failed");
    }
}

#[test]
fn mistakes_about_arguments_give_statuses() {
    let bytes = fixture_bytes();
    let m = open_in_c(&bytes);
    let taps = told(|o| c!(selvedge_locate_light(&m, &UP, o)));
    let (values, vector, query) = (Values::default(), [0.0f32; 3], [selvedge_query::default(); 2]);
    let (mut rgb, mut colour, mut direction, mut located) = (NONE, values, UP, taps);
    let mut made = query[0];
    for (bad, wanted) in
        [(null::<u8>(), SELVEDGE_NULL_POINTER), (askew((&raw const taps).cast()), SELVEDGE_MISALIGNED)]
    {
        let (d, t): (*const Direction, *const Located) = (bad.cast(), bad.cast());
        let statuses = [
            c!(selvedge_locate_light(&m, d, &mut located)),
            c!(selvedge_locate_view(&m, d, &mut located)),
            c!(selvedge_sample_texel(&m, 0, 0, d, &UP, &mut rgb)),
            c!(selvedge_sample_texel(&m, 0, 0, &UP, d, &mut rgb)),
            c!(selvedge_sample_filtered(&m, 0, 0, d, &UP, &mut rgb)),
            c!(selvedge_sample_filtered(&m, 0, 0, &UP, d, &mut rgb)),
            c!(selvedge_sample_trilinear(&m, 0, 0, 0, d, &UP, &mut rgb)),
            c!(selvedge_sample_trilinear(&m, 0, 0, 0, &UP, d, &mut rgb)),
            c!(selvedge_texel_values(&m, 0, 0, t, &taps, &mut colour)),
            c!(selvedge_texel_values(&m, 0, 0, &taps, t, &mut colour)),
            c!(selvedge_filtered_values(&m, 0, 0, t, &taps, &mut colour)),
            c!(selvedge_filtered_values(&m, 0, 0, &taps, t, &mut colour)),
            c!(selvedge_trilinear_values(&m, 0, 0, 0, t, &taps, &mut colour)),
            c!(selvedge_trilinear_values(&m, 0, 0, 0, &taps, t, &mut colour)),
            c!(selvedge_radiance(&m, bad.cast(), &taps, &mut rgb)),
            c!(selvedge_radiance(&m, &values, t, &mut rgb)),
            c!(selvedge_direction_from_vector(bad.cast(), &mut direction)),
            c!(selvedge_direction_from_vector(vector.as_ptr(), bad.cast_mut().cast())),
            c!(selvedge_direction_from_bits(0, 0, 0, bad.cast_mut().cast())),
            c!(selvedge_query_from_floats(bad.cast(), vector.as_ptr(), vector.as_ptr(), &mut made)),
            c!(selvedge_query_from_floats(vector.as_ptr(), bad.cast(), vector.as_ptr(), &mut made)),
            c!(selvedge_query_from_floats(vector.as_ptr(), vector.as_ptr(), bad.cast(), &mut made)),
            c!(selvedge_query_from_floats(
                vector.as_ptr(),
                vector.as_ptr(),
                vector.as_ptr(),
                bad.cast_mut().cast()
            )),
            c!(selvedge_default_limits(bad.cast_mut().cast())),
            c!(selvedge_image_size(&m, 0, &mut 0, bad.cast_mut().cast())),
            c!(selvedge_to_floats(bad.cast(), 1, [0.0; 3].as_mut_ptr(), 3)),
            c!(selvedge_to_floats(&rgb, 1, bad.cast_mut().cast(), 3)),
        ];
        assert!(statuses.iter().all(|&status| status == wanted), "{statuses:?}");
    }
    assert_eq!(
        (rgb, colour, direction, located, made),
        (NONE, values, UP, taps, query[0]),
        "nothing was written"
    );
}

#[test]
fn mistakes_about_buffers_give_statuses() {
    let bytes = fixture_bytes();
    let m = open_in_c(&bytes);
    let count =
        told(|o: *mut [u32; 2]| c!(selvedge_image_size(&m, 0, o.cast(), o.cast::<u32>().wrapping_add(1))))
            .iter()
            .product::<u32>() as usize;
    let needed = told(|o| c!(selvedge_image_scratch_length(&m, o)));
    let batch_needed = told(|o| c!(selvedge_batch_scratch_length(&m, 2, o)));
    let mut scratch = vec![0i32; needed.max(batch_needed)];
    let mut image = vec![NONE; count.max(2)];
    let mut queries = [selvedge_query::default(); 2];
    let (s, i) = (scratch.as_mut_ptr(), image.as_mut_ptr());
    let q = queries.as_mut_ptr();
    let decode = |s, sn, o, on| c!(selvedge_decode_image(&m, 0, &UP, &UP, s, sn, o, on));
    let channel = |s, sn, o: *mut i32, on| c!(selvedge_decode_channel(&m, 0, 0, &UP, &UP, s, sn, o, on));
    let batch = |q: *mut selvedge_query, n, s, sn, o, on| c!(selvedge_sample_batch(&m, q, n, s, sn, o, on));
    assert_eq!(
        [decode(s, needed - 1, i, count), decode(s, needed, i, count - 1), decode(s, 0, i, 0)],
        [SELVEDGE_TOO_SHORT; 3]
    );
    assert_eq!(
        [channel(s, needed - 1, i.cast(), count), channel(s, needed, i.cast(), count - 1)],
        [SELVEDGE_TOO_SHORT; 2]
    );
    assert_eq!(
        [batch(q, 2, s, batch_needed - 1, i, 2), batch(q, 2, s, batch_needed, i, 1)],
        [SELVEDGE_TOO_SHORT; 2]
    );
    assert_eq!(
        [decode(null_mut(), needed, i, count), batch(null_mut(), 2, s, batch_needed, i, 2)],
        [SELVEDGE_NULL_POINTER; 2]
    );
    let bent = askew(s).cast_mut();
    assert_eq!(
        [
            decode(bent, needed, i, count),
            channel(s, needed, bent, count),
            batch(q, 2, bent, batch_needed, i, 2)
        ],
        [SELVEDGE_MISALIGNED; 3]
    );
    // Over each other, over the file, and over what the call names.
    let file = bytes.as_ptr().cast_mut().wrapping_add(bytes.as_ptr().align_offset(4));
    let named = (&raw const m).cast_mut();
    let overlaps = [
        decode(s, needed, s.cast(), count),
        channel(s, needed, s.wrapping_add(needed - 1), count),
        decode(file.cast(), needed, i, count),
        decode(s, needed, file.cast(), count),
        decode(named.cast(), needed, i, count),
        decode(s, needed, named.cast(), count),
        batch(q, 2, s, batch_needed, q.cast(), 2),
        batch(q, 2, q.cast(), batch_needed, i, 2),
        batch(q, 2, s, batch_needed, file.cast(), 2),
        batch(q, 2, s, batch_needed, named.cast(), 2),
    ];
    assert_eq!(overlaps, [SELVEDGE_OVERLAP; 10]);
    let light = i.cast::<Direction>().wrapping_add(5);
    assert_eq!(c!(selvedge_decode_image(&m, 0, light, &UP, s, needed, i, count)), SELVEDGE_OVERLAP);

    let mut length = 7;
    assert_eq!(
        c!(selvedge_batch_scratch_length(&m, SELVEDGE_BATCH_LIMIT + 1, &mut length)),
        SELVEDGE_TOO_LONG
    );
    assert_eq!(
        (length, c!(selvedge_batch_scratch_length(&m, SELVEDGE_BATCH_LIMIT, &mut length))),
        (7, SELVEDGE_OK)
    );
    assert_eq!(batch(q, SELVEDGE_BATCH_LIMIT + 1, s, usize::MAX, i, usize::MAX), SELVEDGE_TOO_LONG);
    assert_eq!(
        batch(null_mut(), 0, s, batch_needed, null_mut(), 0),
        SELVEDGE_OK,
        "nothing is asked and nothing given"
    );
    let floats = |n, on| c!(selvedge_to_floats(i, n, s.cast(), on));
    assert_eq!(
        [floats(2, 5), floats(usize::MAX, usize::MAX), floats(usize::MAX / 3, usize::MAX)],
        [SELVEDGE_TOO_SHORT, SELVEDGE_TOO_LONG, SELVEDGE_TOO_LONG]
    );
    assert_eq!(c!(selvedge_to_floats(null(), 0, null_mut(), 0)), SELVEDGE_OK);
    assert_eq!(bytes, fixture_bytes(), "the file was not touched");
    assert!(image.iter().all(|rgb| *rgb == NONE), "no failure wrote a result");
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
