//! The smallest material that has every section: the worked example of the specification.

use crate::format::model::{
    AtomModel, AtomShifts, ChannelModel, CoefficientsModel, DictionaryModel, EnsembleModel, FactorModel,
    ListsModel, MaterialModel, MetadataModel, PairTableModel, RecordModel, TensorModel, TransferModel,
};

/// Three by two texels in blocks of two, five directions, one full channel and one mean, two levels.
pub fn example_model() -> MaterialModel {
    let factor = |columns: u32, entries: &[i16]| FactorModel { columns, entries: entries.to_vec() };
    let dictionary = DictionaryModel {
        light: factor(2, &[32767, 0, 24000, 20000, 24000, -20000, 16000, 32767, 16000, -32767]),
        view: factor(1, &[32767, 30000, 28000, 26000, 24000]),
        x: factor(2, &[32767, 32767, 32767, -32767]),
        y: factor(1, &[32767, 16384]),
    };
    let atom = |x: u32, light: u32, shift: u32, base: i16, step: u16| AtomModel {
        light,
        view: 0,
        x,
        y: 0,
        shift,
        base,
        step,
    };
    let record = |coefficients: &[(u32, u16)]| RecordModel {
        dictionary: 0,
        shift: 8,
        coefficients: coefficients.to_vec(),
    };
    let empty = RecordModel::default();
    let ensemble = EnsembleModel {
        dictionaries: vec![dictionary],
        atoms: vec![vec![atom(0, 0, 0, -16000, 32000), atom(0, 1, 2, -8000, 16000), atom(1, 0, 3, 0, 32767)]],
        coefficients: vec![
            vec![CoefficientsModel {
                value_bits: 4,
                records: vec![record(&[(0, 15), (2, 7)]), record(&[(1, 3)])],
            }],
            vec![CoefficientsModel { value_bits: 4, records: vec![empty] }],
        ],
    };
    let table = |base_q20: i32, shift: u32, step: i16| PairTableModel {
        base_q20,
        shift,
        entries: (0..25).map(|i| i * step - 400).collect(),
    };
    MaterialModel {
        size: [3, 2],
        level_count: 2,
        edge: 2,
        layer_count: 1,
        transfer: TransferModel::Log2 { offset: 0.000_976_562_5 },
        cosine_included: true,
        matrix_q13: [8192, 0, 9338, 8192, -3233, -4756, 8192, 16647, 0],
        metadata: MetadataModel {
            texel_nm: [50_000, 50_000],
            frame: 1,
            image_origin: 1,
            primaries: 1,
            texts: ["example".into(), "the specification".into(), "CC0-1.0".into()],
        },
        lights: vec![[0, 0], [8000, 0], [0, 8000], [-8000, 0], [0, -8000]],
        views: None,
        channels: [
            ChannelModel {
                mean: Some(table(-3 << 20, 4, 30)),
                scale: Some(PairTableModel { base_q20: 0, shift: 1, entries: vec![16384; 25] }),
                ensemble: Some(ensemble),
            },
            ChannelModel { mean: Some(table(0, 0, 5)), ..ChannelModel::default() },
            ChannelModel::default(),
        ],
        tensor: None,
        extras: vec![(0x8000, 0, b"any!".to_vec())],
    }
}

/// The smallest sparse tensor that has every section: the worked example of chapter 12.
///
/// Three by two texels, the directions of [`example_model`], two full channels and one mean, one level and
/// layer.
pub fn tensor_example_model() -> MaterialModel {
    let base = example_model();
    let mean = base.channels[1].mean.clone();
    let channel = || ChannelModel { mean: mean.clone(), ..ChannelModel::default() };
    let light = |[a, b, c]: [[i16; 2]; 3]| [[a[0], a[1], 0], [b[0], b[1], 0], [c[0], c[1], 0]];
    // Values have fourteen bits, since three light atoms need two for their number.
    let entry = |value: i16, index: u16| value as u16 & !3 | index;
    let fibres = [
        [entry(32764, 0), entry(-8000, 2)],
        [entry(12000, 1), entry(0, 0)],
        [entry(28000, 0), entry(-6000, 2)],
        [entry(16000, 1), entry(4000, 2)],
        [entry(24000, 0), entry(-4000, 2)],
        [entry(20000, 1), entry(3000, 2)],
        [entry(20000, 0), entry(-2000, 1)],
        [entry(24000, 1), entry(2000, 2)],
        [entry(16000, 0), entry(-1000, 1)],
        [entry(28000, 1), entry(1000, 2)],
    ];
    let tensor = TensorModel {
        channels: [true, true, false],
        light_atoms: 3,
        lights: [
            light([[511, 100], [300, -200], [0, 511]]),
            light([[400, 80], [511, -250], [60, 300]]),
            light([[300, 60], [-100, 511], [120, 200]]),
            light([[200, 40], [-512, 100], [180, 100]]),
            light([[100, 20], [250, -512], [240, -100]]),
        ]
        .concat(),
        entries: 2,
        atoms: vec![AtomShifts { angular: 13, gain: 1 }, AtomShifts { angular: 12, gain: 2 }],
        fibres: fibres.concat(),
        lists: vec![vec![ListsModel {
            value_bits: 6,
            shift: 11,
            lists: vec![
                vec![(0, 63), (1, 10)],
                vec![(1, 0)],
                vec![],
                vec![(0, 40)],
                vec![(0, 20), (1, 33)],
                vec![(1, 63)],
            ],
        }]],
    };
    MaterialModel {
        level_count: 1,
        edge: 1,
        channels: [channel(), channel(), channel()],
        tensor: Some(tensor),
        extras: Vec::new(),
        metadata: MetadataModel {
            texts: ["tensor example".into(), "the specification".into(), "CC0-1.0".into()],
            ..base.metadata
        },
        ..base
    }
}

/// The parts of a legal file by name: header, directory, and each section as kind and instance in hex.
pub fn parts(file: &[u8]) -> Vec<(String, Vec<u8>, usize)> {
    let opened = selvedge::open(file, &selvedge::Limits::NONE).expect("a legal file");
    let directory_end = 128 + opened.header().section_count as usize * 16;
    let mut parts = vec![
        ("header".to_owned(), file[..128].to_vec(), 0),
        ("directory".to_owned(), file[128..directory_end].to_vec(), 128),
    ];
    parts.extend(opened.sections().map(|section| {
        let range = section.offset as usize..(section.offset + section.length) as usize;
        (
            format!("section {:04x}.{:04x}", section.kind, section.instance),
            file[range.clone()].to_vec(),
            range.start,
        )
    }));
    parts
}

/// Sixteen bytes a line, behind the offset of the first.
pub fn hex_dump(bytes: &[u8], offset: usize) -> String {
    let line = |(i, line): (usize, &[u8])| {
        let words: Vec<String> = line
            .chunks(4)
            .map(|word| word.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" "))
            .collect();
        format!("{:06x}  {}\n", offset + i * 16, words.join("  "))
    };
    bytes.chunks(16).enumerate().map(line).collect()
}
