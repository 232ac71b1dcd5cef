//! The conformance suite, with nothing but the core: every vector is answered as its manifest states, on
//! every path.

use selvedge::kernel::interpolation::{radiance, texel_values};
use selvedge::{
    BufferTooSmall, Direction, FilteredQuery, First, Limits, Part, Rgb, Selvedge, open_with, validate,
};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/vectors")
}

fn read(file: &str) -> Vec<u8> {
    std::fs::read(folder().join(file)).expect("a file of the suite")
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Queries of any words, and at the places where results may go either of two ways.
fn queries_of(material: &Selvedge<'_>) -> Vec<FilteredQuery> {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state
    };
    let mut queries: Vec<FilteredQuery> = (0..48)
        .map(|_| {
            let mut direction = || Direction {
                x_q18: (next() >> 13) as i32 - 262_144,
                y_q18: (next() >> 13) as i32 - 262_144,
                z_q15: (next() >> 16) as i32 - 100,
            };
            let (light, view) = (direction(), direction());
            FilteredQuery { u_q32: next(), v_q32: next(), light, view }
        })
        .collect();
    // On the horizon, and on every sample direction, where a weight is zero.
    for i in 0..8 {
        let (light, view) = (material.light_direction(i), material.view_direction(i));
        queries.push(FilteredQuery { u_q32: next(), v_q32: next(), light, view });
        queries.push(FilteredQuery {
            u_q32: next(),
            v_q32: next(),
            light: Direction { z_q15: 0, ..light },
            view: Direction { z_q15: 0, ..view },
        });
    }
    // At centres, edges and half way between texels, where neighbours weigh the same or nothing.
    for i in 0..16u32 {
        let (light, view) = (queries[i as usize].light, queries[i as usize].view);
        queries.push(FilteredQuery { u_q32: (i & 3) << 30, v_q32: (i >> 2) << 30, light, view });
    }
    queries
}

/// Batches give what single samples give.
fn batches_agree(material: &Selvedge<'_>, queries: &[FilteredQuery]) {
    let mut scratch = vec![-1; material.batch_scratch_len(queries.len())];
    let mut out = vec![Rgb::default(); queries.len()];
    material.sample_batch(queries, &mut scratch, &mut out).expect("buffers fit");
    for (query, rgb) in queries.iter().zip(&out) {
        assert_eq!(material.filtered(query.u_q32, query.v_q32, query.light, query.view), *rgb);
    }
    // A result longer than the queries is left alone behind them; a shorter one is refused.
    let mut longer = vec![Rgb { r: 7, g: 7, b: 7 }; queries.len() + 1];
    material.sample_batch(queries, &mut scratch, &mut longer).expect("buffers fit");
    assert_eq!((&longer[..queries.len()], longer[queries.len()]), (&out[..], Rgb { r: 7, g: 7, b: 7 }));
    let short = BufferTooSmall { needed: queries.len(), lent: queries.len() - 1 };
    assert_eq!(material.sample_batch(queries, &mut scratch, &mut longer[..queries.len() - 1]), Err(short));
    assert!(
        material.sample_batch(queries, &mut scratch[1..], &mut out).is_err()
            || material.batch_scratch_len(queries.len()) == 0
    );
}

/// Images and channels give what single texels give; buffers may be longer than needed, and not shorter.
fn images_agree(material: &Selvedge<'_>, light: Direction, view: Direction) {
    assert_eq!(material.image_size(0), [material.header().width, material.header().height]);
    for level in 0..material.header().level_count {
        let [width, height] = material.image_size(level);
        let texels = (width * height) as usize;
        let mut scratch = vec![-1; material.image_scratch_len()];
        let mut image = vec![Rgb::default(); texels];
        material.decode_image(level, light, view, &mut scratch, &mut image).expect("buffers fit");
        let mut channel = vec![0; texels];
        material.decode_channel(0, level, light, view, &mut scratch, &mut channel).expect("buffers fit");
        assert!(material.decode_image(level, light, view, &mut scratch, &mut image[1..]).is_err());
        // Scratch may be longer, and not shorter.
        let mut longer = vec![-1; scratch.len() + 1];
        material.decode_image(level, light, view, &mut longer, &mut image).expect("buffers fit");
        if let Some((_, shorter)) = scratch.split_first_mut() {
            assert!(material.decode_image(level, light, view, shorter, &mut image).is_err());
        }
        let (light, view) = (material.locate_light(light), material.locate_view(view));
        for i in (0..texels).step_by(1 + texels / 200).filter(|_| level == 0) {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let values = texel_values(material.words(), material.material(), x, y, &light, &view);
            assert_eq!((radiance(material.material(), values, &light), values.c0), (image[i], channel[i]));
        }
    }
}

/// A sample direction is found, alone and whole; on the horizon no light arrives (5.1-4, 5.6-3).
fn sample_directions_are_found(material: &Selvedge<'_>) {
    let (header, m) = (material.header(), material.material());
    for (is_light, start, count) in
        [(true, m.light_start, header.light_count), (false, m.view_start, header.view_count)]
    {
        let direction =
            |i: u32| if is_light { material.light_direction(i) } else { material.view_direction(i) };
        let locate = |asked: Direction| {
            if is_light { material.locate_light(asked) } else { material.locate_view(asked) }
        };
        for i in 0..count {
            let pair = selvedge::kernel::direction::point(material.words(), start, i);
            let asked = direction(i);
            assert_eq!(
                [asked.x_q18, asked.y_q18],
                [(pair as u16 as i16 as i32) * 16, ((pair >> 16) as u16 as i16 as i32) * 16]
            );
            let located = locate(asked);
            let taps = located.taps;
            // 5.7-9: a sample direction is its own clamped point.
            assert_eq!([located.clamped_x_q18, located.clamped_y_q18], [asked.x_q18, asked.y_q18]);
            let all = [(taps.a, taps.weight_a_q15), (taps.b, taps.weight_b_q15), (taps.c, taps.weight_c_q15)];
            let own: i32 = all.iter().filter(|t| t.0 == i).map(|t| t.1).sum();
            assert_eq!((own, taps.weight_a_q15 + taps.weight_b_q15 + taps.weight_c_q15), (32_768, 32_768));
            for (z_q15, lit) in [(0, false), (-1, false), (asked.z_q15, asked.z_q15 > 0)] {
                assert_eq!(
                    !is_light || locate(Direction { z_q15, ..asked }).taps.cosine_q15 > 0,
                    !is_light || lit,
                    "{z_q15}"
                );
            }
            assert_eq!(direction(u32::MAX), direction(count - 1));
        }
    }
}

/// The clamped point is the query's own within the hull, and on the hull beyond it (5.7-9).
fn points_are_clamped_to_the_hull(material: &Selvedge<'_>, count: u32) -> [u32; 2] {
    let mut found = [0; 2];
    let start = material.material().light_start;
    let words = material.words();
    for i in 0..count {
        let (u, v) = (i.wrapping_mul(0x9e37_79b9), i.wrapping_mul(0x85eb_ca6b) ^ 0x1234_5678);
        let asked = Direction {
            x_q18: (u >> 13) as i32 - 262_144,
            y_q18: (v >> 13) as i32 - 262_144,
            z_q15: (u & 0x7fff) as i32,
        };
        let located = material.locate_light(asked);
        let taps = located.taps;
        let point = [located.clamped_x_q18, located.clamped_y_q18];
        assert_eq!(located.direction, asked);
        let beyond = taps.weight_c_q15 == 0 && taps.c == taps.a;
        found[beyond as usize] += 1;
        if !beyond {
            assert_eq!(point, [asked.x_q18, asked.y_q18]);
            continue;
        }
        let [a, b] = [taps.a, taps.b].map(|i| selvedge::kernel::direction::point(words, start, i));
        let axes = |pair: u32| [pair as u16 as i16, (pair >> 16) as u16 as i16].map(f64::from);
        let part = f64::from(taps.weight_b_q15) / 32768.0;
        for ((a, b), found) in axes(a).into_iter().zip(axes(b)).zip(point) {
            assert_eq!((16.0 * (a + (b - a) * part) + 0.5).floor(), f64::from(found));
        }
    }
    found
}

/// Behind other words and a dictionary before or behind it, a file gives the same, by the record for that
/// place.
fn place_does_not_matter(material: &Selvedge<'_>, file: &[u8], dictionary: &[u8]) {
    use selvedge::kernel::interpolation::{
        filtered_values, locate_light, locate_view, point_values, radiance,
    };
    for is_behind in [true, false] {
        let (mut buffer, mut starts) = (vec![0xa5; 20], [0; 2]);
        for part in if is_behind { [0, 1] } else { [1, 0] } {
            starts[part] = buffer.len() as u32 / 4;
            buffer.extend([file, dictionary][part]);
            buffer.extend([0x5a; 12]);
        }
        let words = selvedge::kernel::words::Words { file: &buffer, dictionary: &[] };
        let placed = material.material_at(starts[0], starts[1]);
        for i in 0..24u32 {
            let (u, v) = (i.wrapping_mul(0x9e37_79b9), i.wrapping_mul(0x85eb_ca6b));
            let (x, y, light, view) = (
                u % placed.width,
                v % placed.height,
                (u >> 3) % placed.light_count,
                (v >> 3) % placed.view_count,
            );
            assert_eq!(
                point_values(words, &placed, x, y, light, view),
                material.point_values(x, y, light, view)
            );
            let (light, view) = (material.light_direction(light), material.view_direction(view));
            let (own_light, own_view) =
                (locate_light(words, &placed, light), locate_view(words, &placed, view));
            let values = filtered_values(words, &placed, placed.level_count - 1, u, v, &own_light, &own_view);
            let wanted = filtered_values(
                material.words(),
                material.material(),
                placed.level_count - 1,
                u,
                v,
                &material.locate_light(light),
                &material.locate_view(view),
            );
            assert_eq!(
                radiance(&placed, values, &own_light),
                radiance(material.material(), wanted, &own_light)
            );
        }
    }
}

/// The sections are those of the directory's bytes (3.2), and the metadata what their bytes say (3.4).
fn what_a_file_holds_is_told(material: &Selvedge<'_>, file: &[u8]) {
    let word = |at: usize| u32::from_le_bytes(*file[at..].first_chunk().expect("a word"));
    let mut sections = 0;
    for (n, section) in material.sections().enumerate() {
        let entry = 128 + 16 * n;
        assert_eq!(
            [section.kind | section.instance << 16, section.offset, section.length],
            [word(entry), word(entry + 4), word(entry + 8)]
        );
        if section.kind == 1 {
            let (metadata, at) = (material.metadata(), section.offset as usize);
            let codes = [
                metadata.texel_width_nm,
                metadata.texel_height_nm,
                metadata.frame,
                metadata.image_origin,
                metadata.primaries,
            ];
            assert_eq!(codes, [0, 4, 8, 12, 16].map(|field| word(at + field)));
            let mut text = at + 32;
            for told in [metadata.name, metadata.origin, metadata.licence] {
                let length = word(text) as usize;
                assert_eq!(told.as_bytes(), &file[text + 4..text + 4 + length]);
                text += 4 + length.next_multiple_of(4);
            }
        }
        sections += 1;
    }
    assert_eq!(sections, material.header().section_count);
}

#[test]
fn the_suite_is_answered_as_stated() {
    let manifest = String::from_utf8(read("manifest.tsv")).expect("text");
    let (mut count, mut inside, mut beyond) = (0, 0, 0);
    for line in manifest.lines().filter(|line| !line.starts_with('#')) {
        let columns: Vec<&str> = line.split('\t').collect();
        let (file, dictionary) = (read(columns[1]), (columns[2] != "-").then(|| read(columns[2])));
        let number = |text: &str| text.parse::<u32>().expect("a number");
        let valid = columns[0] == "valid";
        let mut limits = Limits::NONE;
        if !valid && columns[3] != "-" {
            let all: Vec<u32> =
                columns[3].split(',').map(number).map(|n| if n == 0 { u32::MAX } else { n }).collect();
            limits = Limits { bytes: all[0], operations: all[1], texels: all[2] };
        }
        let is_dictionary = file.get(16) == Some(&1);
        let mut first = First::default();
        validate(&file, dictionary.as_deref(), &limits, &mut first);
        let opened = open_with(&file, dictionary.as_deref(), &limits);
        if !is_dictionary {
            assert_eq!(opened.as_ref().err().copied(), first.0, "{}", columns[1]);
        }
        if valid {
            assert_eq!(first.0, None, "{}", columns[1]);
            if let Ok(material) = &opened {
                assert_eq!(hex(&material.decode_digest()), columns[3], "{}", columns[1]);
                let queries = queries_of(material);
                batches_agree(material, &queries);
                images_agree(material, queries[0].light, queries[0].view);
                sample_directions_are_found(material);
                let found = points_are_clamped_to_the_hull(material, 200);
                (inside, beyond) = (inside + found[0], beyond + found[1]);
                place_does_not_matter(material, &file, dictionary.as_deref().unwrap_or(&[]));
                what_a_file_holds_is_told(material, &file);
            }
        } else {
            let finding = first.0.unwrap_or_else(|| panic!("{}: nothing is found", columns[1]));
            let part = if finding.part == Part::File { "file" } else { "dictionary" };
            assert_eq!(
                (finding.rule.id(), part, finding.offset, finding.found),
                (columns[4], columns[5], number(columns[6]), number(columns[7])),
                "{}",
                columns[1]
            );
        }
        count += 1;
    }
    assert!(count > 200 && inside > 1000 && beyond > 1000, "{count} {inside} {beyond}");
}

#[test]
fn the_examples_say_what_they_are() {
    let file = read("valid/tensor-example.selv");
    let material = selvedge::open(&file, &Limits::NONE).expect("legal");
    let metadata = material.metadata();
    assert_eq!(
        [metadata.name, metadata.origin, metadata.licence],
        ["tensor example", "the specification", "CC0-1.0"]
    );
}

/// What makes queries and shows answers, beside the arithmetic.
#[test]
fn numbers_and_words_of_callers() {
    use selvedge::{Finding, Rule, open, open_reporting, position_from_f32};
    assert_eq!(Rgb { r: 1f32.to_bits(), g: 0.5f32.to_bits(), b: 0 }.to_f32(), [1.0, 0.5, 0.0]);
    assert_eq!([0.25, 1.25, -0.75, 3.0].map(position_from_f32), [1 << 30, 1 << 30, 1 << 30, 0]);
    // x / (1 + z) of 0.6, 0, 0.8 is a third.
    let direction = Direction { x_q18: 87_381, y_q18: 0, z_q15: 26_214 };
    assert_eq!(Direction::from_unit_vector([0.6, 0.0, 0.8]), direction);
    let up = Direction { x_q18: 0, y_q18: 0, z_q15: 32_768 };
    let query = FilteredQuery { u_q32: 1 << 30, v_q32: 1 << 31, light: direction, view: up };
    assert_eq!(FilteredQuery::from_f32([0.25, -0.5], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]), query);

    let file = read("valid/minor-version.selv");
    assert_eq!(open(&file, &Limits::NONE).expect("legal").header().minor_version, 7);
    let finding = Finding { rule: Rule::SectionPadding, part: Part::Dictionary, offset: 40, found: 255 };
    let words = finding.to_string();
    assert!(
        words.starts_with("dictionary: 3.2-5 at byte 40: ") && words.ends_with("; found 255 (0xff)"),
        "{words}"
    );
    assert!(!Finding { part: Part::File, ..finding }.to_string().contains("dictionary"));
    assert_eq!(BufferTooSmall { needed: 5, lent: 4 }.to_string(), "the buffer has 4 elements, 5 are needed");

    // A sink that is a closure hears what there is, and ends it where it says so.
    let mut broken = file.clone();
    for entry in [128, 144] {
        let section = u32::from_le_bytes(*file[entry + 4..].first_chunk().expect("a word")) as usize;
        broken[section] ^= 1;
    }
    let heard = |more: bool| {
        let mut heard = Vec::new();
        let opened = open_reporting(&broken, None, &Limits::NONE, &mut |finding: Finding| {
            heard.push(finding.rule.id());
            more
        });
        assert!(opened.is_none());
        heard
    };
    let sum = Rule::SectionChecksum.id();
    assert_eq!((heard(false), &heard(true)[..2]), (vec![sum], &[sum, sum][..]));

    // What is beyond the caller's limits is not looked into, whatever else is wrong with it (4.1).
    let limited = |limits: Limits| {
        let mut heard = Vec::new();
        validate(&broken, None, &limits, &mut |finding: Finding| {
            heard.push(finding.rule);
            true
        });
        heard
    };
    assert_eq!(limited(Limits { bytes: 10, ..Limits::NONE }), [Rule::LimitBytes]);
    assert_eq!(limited(Limits { operations: 1, ..Limits::NONE }), [Rule::LimitOperations]);
    assert_eq!(limited(Limits { texels: 1, ..Limits::NONE }), [Rule::LimitTexels]);
}
