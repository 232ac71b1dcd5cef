//! Mistakes of a caller give statuses, and write nothing.

use super::common::{Numbers, fixture_bytes};
use super::{NONE, UP, c, open_in_c, string, told};
use selvedge::{Direction, Located, Rgb, Values};
use selvedge_c::*;
use std::ptr::{null, null_mut};

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

/// A function of the interface on a material, with a place for its result.
type Call<'a> = Box<dyn Fn(*const selvedge_material, *mut u8) -> selvedge_status + 'a>;

/// The functions of facts and single samples.
fn calls_of_samples<'a>(taps: &'a Located, values: &'a Values) -> Vec<Call<'a>> {
    let up: *const Direction = &UP;
    vec![
        Box::new(move |m, o| c!(selvedge_read_header(m, o.cast()))),
        Box::new(move |m, o| c!(selvedge_read_metadata(m, o.cast()))),
        Box::new(move |m, o| c!(selvedge_with_layers(m, 1, o.cast()))),
        Box::new(move |m, o| c!(selvedge_light_direction(m, 0, o.cast()))),
        Box::new(move |m, o| c!(selvedge_view_direction(m, 0, o.cast()))),
        Box::new(move |m, o| c!(selvedge_locate_light(m, up, o.cast()))),
        Box::new(move |m, o| c!(selvedge_locate_view(m, up, o.cast()))),
        Box::new(move |m, o| c!(selvedge_sample_point(m, 0, 0, 0, 0, o.cast()))),
        Box::new(move |m, o| c!(selvedge_sample_texel(m, 0, 0, up, up, o.cast()))),
        Box::new(move |m, o| c!(selvedge_sample_filtered(m, 0, 0, up, up, o.cast()))),
        Box::new(move |m, o| c!(selvedge_sample_trilinear(m, 0, 0, 0, up, up, o.cast()))),
        Box::new(move |m, o| c!(selvedge_point_values(m, 0, 0, 0, 0, o.cast()))),
        Box::new(move |m, o| c!(selvedge_texel_values(m, 0, 0, taps, taps, o.cast()))),
        Box::new(move |m, o| c!(selvedge_filtered_values(m, 0, 0, taps, taps, o.cast()))),
        Box::new(move |m, o| c!(selvedge_trilinear_values(m, 0, 0, 0, taps, taps, o.cast()))),
        Box::new(move |m, o| c!(selvedge_radiance(m, values, taps, o.cast()))),
    ]
}

/// The functions of images, batches and the digest. A result at `good` goes to memory that is long enough.
fn calls_in_bulk<'a>(scratch: &'a mut [i32], image: &'a mut [Rgb], good: *mut u64) -> Vec<Call<'a>> {
    let up: *const Direction = &UP;
    let query = selvedge_query::default();
    let (s, sn, i) = (scratch.as_mut_ptr(), scratch.len(), image.as_mut_ptr());
    vec![
        Box::new(move |m, o| c!(selvedge_image_size(m, 0, o.cast(), o.cast()))),
        Box::new(move |m, o| c!(selvedge_image_scratch_length(m, o.cast()))),
        Box::new(move |m, o| c!(selvedge_batch_scratch_length(m, 1, o.cast()))),
        Box::new(move |m, o| {
            c!(selvedge_decode_image(m, 0, up, up, s, sn, if o.cast() == good { i } else { o.cast() }, 3600))
        }),
        Box::new(move |m, o| {
            c!(selvedge_decode_channel(
                m,
                0,
                0,
                up,
                up,
                s,
                sn,
                if o.cast() == good { i.cast() } else { o.cast() },
                3600
            ))
        }),
        Box::new(move |m, o| c!(selvedge_sample_batch(m, &query, 1, s, sn, o.cast(), 1))),
        Box::new(move |m, o| {
            if o.cast() == good || o.is_null() {
                c!(selvedge_decode_digest(m, o))
            } else {
                SELVEDGE_MISALIGNED
            }
        }),
    ]
}

/// Memory that was never opened: noise, ones, and an open material copied in part.
fn never_opened(good: &selvedge_material) -> [selvedge_material; 5] {
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
        let (from, to) = ((&raw const *good).cast::<u64>(), (&raw mut half).cast::<u64>());
        // SAFETY: both have 64 words and lie apart.
        unsafe { from.wrapping_add(skip).copy_to(to.wrapping_add(skip), 8) };
        half
    };
    [selvedge_material::CLOSED, noise, ones, half(true), half(false)]
}

/// Each function with a good material, then with none, an askew one, and memory that was never opened.
#[test]
fn mistakes_about_materials_give_statuses() {
    let bytes = fixture_bytes();
    let good = open_in_c(&bytes);
    let taps = told(|o| c!(selvedge_locate_light(&good, &UP, o)));
    let values = Values::default();
    let lengths = [
        told(|o| c!(selvedge_image_scratch_length(&good, o))),
        told(|o| c!(selvedge_batch_scratch_length(&good, 1, o))),
    ];
    let mut scratch = vec![0i32; lengths[0].max(lengths[1])];
    let mut image = vec![NONE; 3600];
    // Long enough for any result, aligned for all.
    let mut memory = [0u64; 64];
    let out = memory.as_mut_ptr();
    let mut calls = calls_of_samples(&taps, &values);
    calls.extend(calls_in_bulk(&mut scratch, &mut image, out));
    assert_eq!(calls.len(), 23);
    let closed = never_opened(&good);
    for (number, call) in calls.iter().enumerate() {
        assert_eq!(call(&good, out.cast()), SELVEDGE_OK, "function {number}");
        memory = [0x5555; 64];
        assert_eq!(call(null(), out.cast()), SELVEDGE_NULL_POINTER, "function {number}");
        assert_eq!(call(askew(&good), out.cast()), SELVEDGE_MISALIGNED, "function {number}");
        for closed in &closed {
            assert_eq!(call(closed, out.cast()), SELVEDGE_NOT_OPEN, "function {number}");
        }
        assert_eq!(call(&good, null_mut()), SELVEDGE_NULL_POINTER, "function {number}");
        assert_eq!(call(&good, askew(out).cast_mut().cast()), SELVEDGE_MISALIGNED, "function {number}");
        assert_eq!(memory, [0x5555; 64], "function {number} wrote although it failed");
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

/// Memory that is lent to the functions of many samples, and how much of it they need.
struct Lent {
    bytes: Vec<u8>,
    m: selvedge_material,
    texels: usize,
    needed: usize,
    batch_needed: usize,
    scratch: Vec<i32>,
    image: Vec<Rgb>,
    queries: [selvedge_query; 2],
}

impl Lent {
    fn new() -> Lent {
        let bytes = fixture_bytes();
        let m = open_in_c(&bytes);
        let size = told(|o: *mut [u32; 2]| {
            c!(selvedge_image_size(&m, 0, o.cast(), o.cast::<u32>().wrapping_add(1)))
        });
        let texels = size.iter().product::<u32>() as usize;
        let needed = told(|o| c!(selvedge_image_scratch_length(&m, o)));
        let batch_needed = told(|o| c!(selvedge_batch_scratch_length(&m, 2, o)));
        Lent {
            scratch: vec![0; needed.max(batch_needed)],
            image: vec![NONE; texels.max(2)],
            queries: [selvedge_query::default(); 2],
            bytes,
            m,
            texels,
            needed,
            batch_needed,
        }
    }

    /// Scratch, results and queries.
    fn pointers(&mut self) -> (*mut i32, *mut Rgb, *mut selvedge_query) {
        (self.scratch.as_mut_ptr(), self.image.as_mut_ptr(), self.queries.as_mut_ptr())
    }

    /// No failure wrote a result or the file.
    fn check_untouched(&self) {
        assert_eq!(self.bytes, fixture_bytes(), "the file was not touched");
        assert!(self.image.iter().all(|rgb| *rgb == NONE), "no failure wrote a result");
    }
}

fn decode(m: *const selvedge_material, s: *mut i32, sn: usize, o: *mut Rgb, on: usize) -> selvedge_status {
    c!(selvedge_decode_image(m, 0, &UP, &UP, s, sn, o, on))
}

fn channel(m: *const selvedge_material, s: *mut i32, sn: usize, o: *mut i32, on: usize) -> selvedge_status {
    c!(selvedge_decode_channel(m, 0, 0, &UP, &UP, s, sn, o, on))
}

/// A batch; queries and their number, scratch and its length, results and theirs.
fn batch(
    m: *const selvedge_material,
    (q, n): (*mut selvedge_query, usize),
    (s, sn): (*mut i32, usize),
    (o, on): (*mut Rgb, usize),
) -> selvedge_status {
    c!(selvedge_sample_batch(m, q, n, s, sn, o, on))
}

#[test]
fn buffers_that_are_short_or_askew_give_statuses() {
    let mut lent = Lent::new();
    let (s, i, q) = lent.pointers();
    let (m, needed, batch_needed, count) = (&raw const lent.m, lent.needed, lent.batch_needed, lent.texels);
    assert_eq!(
        [decode(m, s, needed - 1, i, count), decode(m, s, needed, i, count - 1), decode(m, s, 0, i, 0)],
        [SELVEDGE_TOO_SHORT; 3]
    );
    assert_eq!(
        [channel(m, s, needed - 1, i.cast(), count), channel(m, s, needed, i.cast(), count - 1)],
        [SELVEDGE_TOO_SHORT; 2]
    );
    assert_eq!(
        [batch(m, (q, 2), (s, batch_needed - 1), (i, 2)), batch(m, (q, 2), (s, batch_needed), (i, 1))],
        [SELVEDGE_TOO_SHORT; 2]
    );
    assert_eq!(
        [decode(m, null_mut(), needed, i, count), batch(m, (null_mut(), 2), (s, batch_needed), (i, 2))],
        [SELVEDGE_NULL_POINTER; 2]
    );
    let bent = askew(s).cast_mut();
    assert_eq!(
        [
            decode(m, bent, needed, i, count),
            channel(m, s, needed, bent, count),
            batch(m, (q, 2), (bent, batch_needed), (i, 2))
        ],
        [SELVEDGE_MISALIGNED; 3]
    );
    lent.check_untouched();
}

/// Results and scratch over each other, over the file, and over what the call points at.
#[test]
fn buffers_that_overlap_give_statuses() {
    let mut lent = Lent::new();
    let (s, i, q) = lent.pointers();
    let (m, needed, batch_needed, count) = (&raw const lent.m, lent.needed, lent.batch_needed, lent.texels);
    let file = lent.bytes.as_ptr().cast_mut().wrapping_add(lent.bytes.as_ptr().align_offset(4));
    let named = m.cast_mut();
    let overlaps = [
        decode(m, s, needed, s.cast(), count),
        channel(m, s, needed, s.wrapping_add(needed - 1), count),
        decode(m, file.cast(), needed, i, count),
        decode(m, s, needed, file.cast(), count),
        decode(m, named.cast(), needed, i, count),
        decode(m, s, needed, named.cast(), count),
        batch(m, (q, 2), (s, batch_needed), (q.cast(), 2)),
        batch(m, (q, 2), (q.cast(), batch_needed), (i, 2)),
        batch(m, (q, 2), (s, batch_needed), (file.cast(), 2)),
        batch(m, (q, 2), (s, batch_needed), (named.cast(), 2)),
    ];
    assert_eq!(overlaps, [SELVEDGE_OVERLAP; 10]);
    let light = i.cast::<Direction>().wrapping_add(5);
    assert_eq!(c!(selvedge_decode_image(m, 0, light, &UP, s, needed, i, count)), SELVEDGE_OVERLAP);
    lent.check_untouched();
}

#[test]
fn buffers_that_are_too_long_or_empty_give_statuses() {
    let mut lent = Lent::new();
    let (s, i, q) = lent.pointers();
    let (m, batch_needed) = (&raw const lent.m, lent.batch_needed);
    let mut length = 7;
    assert_eq!(
        c!(selvedge_batch_scratch_length(m, SELVEDGE_BATCH_LIMIT + 1, &mut length)),
        SELVEDGE_TOO_LONG
    );
    assert_eq!(
        (length, c!(selvedge_batch_scratch_length(m, SELVEDGE_BATCH_LIMIT, &mut length))),
        (7, SELVEDGE_OK)
    );
    let beyond = batch(m, (q, SELVEDGE_BATCH_LIMIT + 1), (s, usize::MAX), (i, usize::MAX));
    assert_eq!(beyond, SELVEDGE_TOO_LONG);
    let nothing = batch(m, (null_mut(), 0), (s, batch_needed), (null_mut(), 0));
    assert_eq!(nothing, SELVEDGE_OK, "nothing is asked and nothing given");
    let floats = |n, on| c!(selvedge_to_floats(i, n, s.cast(), on));
    assert_eq!(
        [floats(2, 5), floats(usize::MAX, usize::MAX), floats(usize::MAX / 3, usize::MAX)],
        [SELVEDGE_TOO_SHORT, SELVEDGE_TOO_LONG, SELVEDGE_TOO_LONG]
    );
    assert_eq!(c!(selvedge_to_floats(null(), 0, null_mut(), 0)), SELVEDGE_OK);
    lent.check_untouched();
}
