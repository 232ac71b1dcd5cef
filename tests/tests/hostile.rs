//! Bad files: every rule can be broken and is then the one that is reported; truncations, flipped bits
//! and absurd values give a typed error or a legal file, never a panic.

use selvedge::{Finding, First, Limits, Rule};
use selvedge_tests::setting;
use selvedge_tools::example::example_model;
use selvedge_tools::extreme::extreme_model;
use selvedge_tools::model::{AtomModel, FactorModel};
use selvedge_tools::random::Random;
use selvedge_tools::triangulate::{triangulate, with_grid};
use selvedge_tools::write::{
    Part, directions_part, lay_out, repair_checksums, repair_header_checksum, take_apart, words_to_bytes, write_material, write_split,
};
use std::collections::BTreeMap;

fn example() -> Vec<u8> {
    write_material(&example_model())
}

fn word(file: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]])
}

fn set_word(file: &mut [u8], at: usize, value: u32) {
    file[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// Byte offsets of a section of the example and of its directory entry.
fn place(file: &[u8], kind: u32, instance: u32) -> (usize, usize) {
    let entry = (0..word(file, 24) as usize).map(|i| 128 + i * 16).find(|&e| word(file, e) == kind | instance << 16).expect("there");
    (word(file, entry + 4) as usize, entry)
}

/// One way to break one rule.
struct Case {
    rule: Rule,
    file: Vec<u8>,
    dictionary: Option<Vec<u8>>,
    limits: Limits,
    /// Where the finding must be, rounded down to a word; `None` if it is about the whole.
    offset: Option<usize>,
}

impl Case {
    fn new(rule: Rule, file: Vec<u8>, offset: Option<usize>) -> Case {
        Case { rule, file, dictionary: None, limits: Limits::NONE, offset }
    }

    /// The example with one word changed and checksums repaired.
    fn patch(rule: Rule, at: usize, value: u32) -> Case {
        let mut file = example();
        assert_ne!(word(&file, at), value, "{rule:?}: nothing is changed");
        set_word(&mut file, at, value);
        repair_checksums(&mut file);
        Case::new(rule, file, Some(at))
    }

    /// The example with a word of a section changed.
    fn patch_in(rule: Rule, kind: u32, instance: u32, word: usize, value: u32) -> Case {
        Case::patch(rule, place(&example(), kind, instance).0 + word * 4, value)
    }

    /// The example with the bytes of a section changed in length, laid out again.
    fn resize(rule: Rule, kind: u32, instance: u32, edit: impl FnOnce(&mut Vec<u8>)) -> Case {
        let (header, mut parts) = take_apart(&example());
        edit(&mut parts.iter_mut().find(|p| (p.kind, p.instance) == (kind, instance)).expect("there").bytes);
        Case::new(rule, lay_out(header, parts), None)
    }

    /// The model of the example, changed, and written.
    fn model(rule: Rule, edit: impl FnOnce(&mut selvedge_tools::model::MaterialModel)) -> Case {
        let mut model = example_model();
        edit(&mut model);
        Case::new(rule, write_material(&model), None)
    }

    fn first(&self) -> Option<Finding> {
        let mut first = First::default();
        selvedge::validate(&self.file, self.dictionary.as_deref(), &self.limits, &mut first);
        first.0
    }
}

#[allow(clippy::too_many_lines)]
fn cases() -> Vec<Case> {
    let good = example();
    let at = |kind, instance| place(&good, kind, instance).0;
    let entry = |kind, instance| place(&good, kind, instance).1;
    let (split, dictionary) = write_split(&example_model());
    let mut cases = vec![
        Case::new(Rule::HeaderTooShort, good[..100].to_vec(), Some(0)),
        Case::patch(Rule::Magic, 4, 0x0a0d_0a1a),
        Case::patch(Rule::MajorVersion, 8, 2),
        Case::patch(Rule::FileLength, 12, word(&good, 12) + 16),
        Case::patch(Rule::SectionCount, 24, 0),
        Case::patch(Rule::Content, 16, 2),
        Case::patch(Rule::Method, 20, 9),
        Case::patch(Rule::ImageSize, 36, 16_385),
        Case::patch(Rule::DirectionCount, 40, 1025),
        Case::patch(Rule::LevelCount, 48, 4),
        Case::patch(Rule::BlockEdge, 52, 0x0111),
        Case::patch(Rule::LayerCount, 52, 0x0002),
        Case::patch(Rule::ChannelState, 56, 0x0003_0102),
        Case::patch(Rule::Transfer, 60, 2),
        Case::patch(Rule::TransferParameter, 64, 0x3f80_0001),
        Case::patch(Rule::ColourMatrix, 68, 0x8000),
        Case::patch(Rule::HeaderReserved, 120, 1),
        Case::patch(Rule::SectionKind, entry(4, 0), 6),
        Case::patch(Rule::SectionOrder, entry(3, 0), 1),
        Case::patch(Rule::SectionOffset, entry(1, 0) + 4, word(&good, entry(1, 0) + 4) + 16),
        Case::patch(Rule::SectionLength, entry(1, 0) + 8, word(&good, entry(1, 0) + 8) + 2),
        Case::patch(Rule::SectionPadding, at(4, 0) + 76, 0x0100_0000),
        Case::patch(Rule::SectionMissing, entry(1, 0), 0x0001_0001),
        Case::patch(Rule::SectionForeign, entry(5, 0), 0x0001_0005),
        Case::patch_in(Rule::MetadataLength, 1, 0, 8, 0xffff),
        Case::patch_in(Rule::MetadataValue, 1, 0, 2, 9),
        Case::patch(Rule::StatedOperations, 28, word(&good, 28) + 1),
        Case::patch_in(Rule::DirectionsCounts, 3, 0, 0, 4),
        Case::patch_in(Rule::DirectionPoint, 3, 0, 12, 8000),
        Case::patch_in(Rule::DirectionCosine, 3, 0, 9, 0x7fff),
        Case::patch_in(Rule::TriangleReciprocal, 3, 0, 20, 0x8639),
        Case::patch_in(Rule::GridStarts, 3, 0, 38, 1),
        Case::patch_in(Rule::GridCandidate, 3, 0, 48, 7),
        Case::patch_in(Rule::HullEdge, 3, 0, 30, 9 | 11 << 16),
        Case::patch_in(Rule::TableHeader, 4, 0, 1, 12),
        Case::patch_in(Rule::TableEntry, 4, 0, 5, 0x8000_0000),
        Case::patch_in(Rule::FactorCounts, 0x110, 0, 0, 0),
        Case::patch_in(Rule::FactorOffset, 0x110, 0, 5, 12),
        Case::patch_in(Rule::FactorEntry, 0x110, 0, 6, 0x8000),
        Case::patch_in(Rule::AtomsCounts, 0x112, 0, 0, 2),
        Case::patch_in(Rule::AtomColumn, 0x112, 0, 4, 5 << 4),
        Case::patch_in(Rule::AtomQuantiser, 0x112, 0, 5, 0x7d00_4000),
        Case::patch_in(Rule::CoefficientsHeader, 0x113, 0, 0, 0x0002_0011),
        Case::patch_in(Rule::LargestCount, 0x113, 0, 3, 3),
        Case::patch_in(Rule::RecordPlace, 0x113, 0, 5, 24),
        many_low_bits(),
        Case::patch_in(Rule::StreamEnd, 0x113, 0, 7, word(&good, at(0x113, 0) + 28) | 1 << 31),
        Case::resize(Rule::MetadataText, 1, 0, |bytes| bytes[36] = 0xff),
        Case::resize(Rule::DirectionsLength, 3, 0, |bytes| bytes.extend([0; 4])),
        Case::resize(Rule::TableLength, 4, 1, |bytes| bytes.truncate(72)),
        Case::resize(Rule::FactorLength, 0x110, 0, |bytes| bytes.extend([0; 4])),
        Case::resize(Rule::AtomsLength, 0x112, 0, |bytes| bytes.extend([0; 4])),
        Case::resize(Rule::CoefficientsLength, 0x113, 0, |bytes| bytes.extend([0; 4])),
        Case::resize(Rule::SpatialCounts, 0x111, 0, |bytes| {
            let row = [0x7fff_7fff, 0x8001_7fff, 0x7fff, 0x4000];
            *bytes = words_to_bytes(&[&[2, 0, 2, 1, 10, 12, 2, 1, 14, 16][..], &row, &row].concat());
        }),
        // One candidate fewer, everything else in order.
        Case::resize(Rule::GridComplete, 3, 0, |bytes| {
            let mut words: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
            words[4] -= 1;
            words[46] -= 1;
            words[47] -= 1;
            words.pop();
            *bytes = words_to_bytes(&words);
        }),
        // The second triangle of two that differ only in order.
        Case::resize(Rule::TriangleOrder, 3, 0, |bytes| bytes[72..96].rotate_left(12)),
        Case::resize(Rule::TriangleShape, 3, 0, |bytes| {
            bytes[74] = 2;
            bytes[76] = 1;
        }),
        // A square turned through clockwise has edges of the same lengths.
        Case::resize(Rule::HullConvex, 3, 0, |bytes| {
            bytes[128] = 4;
            bytes[144] = 2;
        }),
        // Two triangles that overlap and leave a gap, with a grid that is right for them.
        Case::resize(Rule::Cover, 3, 0, |bytes| {
            let points = example_model().lights;
            let triangulation = with_grid(&points, vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [1, 2, 3]], vec![1, 2, 3, 4], 3);
            *bytes = directions_part(0, &points, &triangulation).bytes;
        }),
        Case::resize(Rule::AtomOrder, 0x112, 0, |bytes| bytes[16..32].rotate_left(8)),
        Case::model(Rule::RecordPositions, |model| {
            model.channels[0].ensemble.as_mut().expect("full").coefficients[0][0].records[0].coefficients[1].0 = 3;
        }),
        Case::model(Rule::RecordSum, |model| {
            let ensemble = model.channels[0].ensemble.as_mut().expect("full");
            ensemble.atoms[0].iter_mut().for_each(|atom| (atom.base, atom.step, atom.shift) = (-32_767, 0, 0));
            ensemble.coefficients[0][0].records[0].coefficients = vec![(0, 0), (1, 0), (2, 0)];
        }),
        Case { limits: Limits { bytes: 100, ..Limits::NONE }, ..Case::new(Rule::LimitBytes, good.clone(), Some(12)) },
        Case { limits: Limits { operations: 10, ..Limits::NONE }, ..Case::new(Rule::LimitOperations, good.clone(), Some(28)) },
        Case { limits: Limits { texels: 5, ..Limits::NONE }, ..Case::new(Rule::LimitTexels, good.clone(), Some(32)) },
        crowded_cell(),
        many_zeros(),
        Case::new(Rule::ExternalMissing, split.clone(), None),
        Case { dictionary: Some(dictionary.clone()), ..Case::new(Rule::ExternalUnwanted, good.clone(), None) },
    ];
    // No repair: the checksums are what is wrong.
    let mut file = good.clone();
    file[124] ^= 1;
    cases.push(Case::new(Rule::HeaderChecksum, file, Some(124)));
    let mut file = good.clone();
    file[at(4, 0) + 20] ^= 1;
    cases.push(Case::new(Rule::SectionChecksum, file, Some(entry(4, 0) + 12)));
    let mut file = good.clone();
    file.extend([0; 16]);
    let length = file.len() as u32;
    set_word(&mut file, 12, length);
    repair_header_checksum(&mut file);
    cases.push(Case::new(Rule::FileEnd, file, None));
    // Files of two parts.
    let mut file = dictionary.clone();
    set_word(&mut file, 32, 2);
    repair_checksums(&mut file);
    cases.push(Case::new(Rule::DictionaryHeader, file, Some(32)));
    let mut other = dictionary.clone();
    let last = other.len() - 1;
    other[last] ^= 1;
    cases.push(Case { dictionary: Some(other), ..Case::new(Rule::ExternalDigest, split.clone(), None) });
    let rename = |dictionary: &[u8], tail: u32| {
        let (header, mut parts) = take_apart(&split);
        let external: &mut Part = parts.iter_mut().find(|p| p.kind == 2).expect("named");
        external.bytes[..32].copy_from_slice(&selvedge::sha256(dictionary));
        external.bytes[32..].copy_from_slice(&words_to_bytes(&[dictionary.len() as u32, tail, 0, 0]));
        lay_out(header, parts)
    };
    cases.push(Case { dictionary: Some(dictionary.clone()), ..Case::new(Rule::ExternalLength, rename(&dictionary, 1), None) });
    let mut model = example_model();
    model.lights.truncate(3);
    let (_, smaller) = write_split(&shrink(model));
    cases.push(Case { dictionary: Some(smaller.clone()), ..Case::new(Rule::ExternalFit, rename(&smaller, 0), None) });
    cases
}

/// A set of directions whose one cell lists all of its 288 triangles.
fn crowded_cell() -> Case {
    let mut model = example_model();
    model.lights = (0..169).map(|i| [i % 13 * 900 - 5000, i / 13 * 900 - 5000]).collect();
    let sparse = triangulate(&model.lights, None);
    let crowded = with_grid(&model.lights, sparse.triangles, sparse.hull, 1);
    let (header, mut parts) = take_apart(&write_material(&model));
    parts.iter_mut().find(|p| p.kind == 3).expect("there").bytes = directions_part(0, &model.lights, &crowded).bytes;
    Case::new(Rule::GridCell, lay_out(header, parts), None)
}

/// A record of one coefficient whose position is written as 99 zeros and a one.
fn many_zeros() -> Case {
    let mut model = example_model();
    let ensemble = model.channels[0].ensemble.as_mut().expect("full");
    ensemble.dictionaries[0].view = FactorModel { columns: 100, entries: vec![1; 500] };
    ensemble.atoms[0] = (0..100).map(|view| AtomModel { view, step: 9, ..AtomModel::default() }).collect();
    ensemble.coefficients[0][0].records.iter_mut().for_each(|record| record.coefficients = vec![(99, 0)]);
    let (header, mut parts) = take_apart(&write_material(&model));
    // Count 1, shift 3, no low bits, a value of four bits: 14 bits, then the high part.
    let record = 1u128 | 3 << 1 | 1 << (14 + 99);
    let words = [4 | 1 << 16, 2, 228, 1, 0, 114];
    let stream: Vec<u8> = (0..2).fold(vec![0u8; 32], |mut stream, i| {
        (0..114).filter(|bit| record >> bit & 1 == 1).for_each(|bit| stream[(i * 114 + bit) / 8] |= 1 << ((i * 114 + bit) % 8));
        stream
    });
    parts.iter_mut().find(|p| p.kind == 0x113).expect("there").bytes = [words_to_bytes(&words), stream].concat();
    Case::new(Rule::RecordZeros, lay_out(header, parts), None)
}

/// The example with records of 13 low bits, one more than there may be.
fn many_low_bits() -> Case {
    let (header, mut parts) = take_apart(&example());
    // Count 1 of two bits, shift 0, 13 low bits, all of them and a value of four bits zero, then a one: 29 bits.
    let record = 1u64 | 13 << 7 | 1 << 28;
    let words = [4 | 2 << 16, 2, 58, 2, 0, 29];
    let stream = (record | record << 29).to_le_bytes().to_vec();
    parts.iter_mut().find(|p| p.kind == 0x113).expect("there").bytes = [words_to_bytes(&words), stream].concat();
    Case::new(Rule::RecordHeader, lay_out(header, parts), None)
}

/// The example with tables for three directions.
fn shrink(mut model: selvedge_tools::model::MaterialModel) -> selvedge_tools::model::MaterialModel {
    for channel in &mut model.channels {
        for table in [&mut channel.mean, &mut channel.scale].into_iter().flatten() {
            table.entries.truncate(9);
        }
        for dictionary in channel.ensemble.iter_mut().flat_map(|e| e.dictionaries.iter_mut()) {
            dictionary.light.entries.truncate(6);
            dictionary.view.entries.truncate(3);
        }
    }
    model
}

#[test]
fn every_rule_can_be_broken() {
    selvedge::open(&example(), &Limits::NONE).expect("the example is legal");
    let mut seen = BTreeMap::new();
    for case in cases() {
        let first = case.first().unwrap_or_else(|| panic!("{:?}: nothing was found", case.rule));
        assert_eq!(first.rule, case.rule, "{first}");
        assert!((first.offset as usize) <= case.file.len().max(case.dictionary.as_ref().map_or(0, Vec::len)), "{first}");
        if let Some(offset) = case.offset {
            assert_eq!(first.offset as usize & !3, offset & !3, "{first}");
        }
        // The decoder says the same; a dictionary is no material, so only its own check can speak.
        if case.rule != Rule::DictionaryHeader {
            let error = selvedge::open_with(&case.file, case.dictionary.as_deref(), &case.limits).expect_err("refused");
            assert_eq!(error, first);
        }
        seen.insert(case.rule, ());
    }
    let missing: Vec<_> = Rule::ALL.iter().filter(|rule| !seen.contains_key(rule)).collect();
    assert!(missing.is_empty(), "no case for {missing:?}");
}

/// What every answer to a file must be: an error inside the file, or a material that answers.
fn open_and_use(file: &[u8], dictionary: Option<&[u8]>) -> Option<Finding> {
    let limits = Limits { bytes: 1 << 24, operations: 1 << 24, texels: 1 << 20 };
    match selvedge::open_with(file, dictionary, &limits) {
        Err(finding) => {
            let part = if finding.part == selvedge::Part::File { file } else { dictionary.unwrap_or(&[]) };
            assert!(finding.offset as usize <= part.len().max(128), "{finding}");
            let mut first = First::default();
            selvedge::validate(file, dictionary, &limits, &mut first);
            assert_eq!(first.0.map(|f| f.rule), Some(finding.rule));
            Some(finding)
        }
        Ok(material) => {
            let mut random = Random::new(file.len() as u64);
            for _ in 0..4 {
                let mut direction =
                    || selvedge::Direction { x_q18: random.word() as i32, y_q18: random.range(-262_144, 262_144) as i32, z_q15: random.word() as i32 };
                let (light, view) = (direction(), direction());
                material.trilinear(random.word() >> 12, random.word(), random.word(), light, view);
                material.point(random.word(), random.word() >> 22, random.word(), random.word() >> 22);
            }
            material.metadata();
            None
        }
    }
}

#[test]
fn truncated_at_every_byte() {
    let file = example();
    for length in 0..file.len() {
        assert!(open_and_use(&file[..length], None).is_some(), "{length}");
        // With the length stated as it is, as far as the header is there.
        let mut shorter = file[..length].to_vec();
        if length >= 128 {
            set_word(&mut shorter, 12, length as u32);
            repair_checksums(&mut shorter);
            assert!(open_and_use(&shorter, None).is_some(), "{length}");
        }
    }
}

#[test]
fn every_bit_flipped() {
    let (split, dictionary) = write_split(&example_model());
    let mut legal = 0;
    for (file, dictionary) in [(example(), None), (split, Some(dictionary))] {
        for bit in 0..file.len() * 8 {
            let mut flipped = file.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            // Only the minor version and nothing else may change unseen, and that needs the checksum.
            assert!(open_and_use(&flipped, dictionary.as_deref()).is_some(), "bit {bit}");
            repair_checksums(&mut flipped);
            legal += open_and_use(&flipped, dictionary.as_deref()).is_none() as usize;
        }
    }
    println!("{legal} of the flips with repaired checksums are legal files");
    assert!(legal > 1000);
}

#[test]
fn absurd_values_in_every_field() {
    let mut random = Random::new(3);
    for seed in [0u64, 1, 2, 3] {
        let file = if seed == 0 { example() } else { write_material(&extreme_model(seed)) };
        let step = (file.len() / 4 / setting("SELVEDGE_FIELDS", 700)).max(1);
        for at in (0..file.len() / 4).filter(|at| *at < 512 || at % step == 0).map(|at| at * 4) {
            let old = word(&file, at);
            let any = random.word();
            for value in [0, 1, old.wrapping_add(1), old.wrapping_sub(1), 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x8000, 0xffff, any, old ^ 0x8000_8000] {
                let mut changed = file.clone();
                set_word(&mut changed, at, value);
                repair_checksums(&mut changed);
                open_and_use(&changed, None);
            }
        }
    }
}

/// Many bytes at once, with checksums repaired.
#[test]
fn random_damage() {
    let mut legal = 0;
    let count = setting("SELVEDGE_DAMAGE", 30_000);
    let files: Vec<Vec<u8>> = (0..40).map(|seed| write_material(&extreme_model(seed))).filter(|file| file.len() < 40_000).chain([example()]).collect();
    let mut random = Random::new(11);
    for i in 0..count {
        let mut file = files[i % files.len()].clone();
        for _ in 0..random.range(1, 6) {
            let at = random.range(0, file.len() as i64 - 1) as usize;
            file[at] = random.word() as u8;
        }
        repair_checksums(&mut file);
        legal += open_and_use(&file, None).is_none() as usize;
    }
    println!("{legal} of {count} damaged files are legal");
    assert!(legal > 0);
}

/// Taking a file apart and laying it out again gives the same bytes.
#[test]
fn layout_is_canonical() {
    for seed in 0..60 {
        let file = write_material(&extreme_model(seed));
        let (header, parts) = take_apart(&file);
        assert!(lay_out(header, parts) == file, "{seed}");
    }
}

#[test]
fn extreme_files_are_legal_and_rich() {
    let mut seen = std::collections::BTreeSet::new();
    for seed in 0..200 {
        let file = write_material(&extreme_model(seed));
        let material = selvedge::open(&file, &Limits::NONE).unwrap_or_else(|finding| panic!("{seed}: {finding}"));
        let header = material.header();
        seen.extend([format!("edge {}", header.edge), format!("layers {}", header.layer_count), format!("transfer {}", header.transfer)]);
        seen.extend(header.states.map(|state| format!("state {state}")));
        seen.insert(format!("levels {}", header.level_count > 1));
    }
    for wanted in ["edge 1", "edge 16", "layers 1", "layers 8", "transfer 0", "transfer 1", "state 0", "state 1", "state 2", "levels true"] {
        assert!(seen.contains(wanted), "no {wanted}");
    }
}
