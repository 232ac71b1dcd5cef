//! The smallest sparse tensor that has every section: the worked example of chapter 12.

use crate::format::model::{ChannelModel, MaterialModel, MetadataModel};
use crate::methods::sparse_ensemble;
use crate::methods::sparse_tensor::model::{AtomShifts, ListsModel, TensorModel};

/// The smallest sparse tensor that has every section: the worked example of chapter 12.
///
/// Three by two texels, the directions of [`sparse_ensemble::example::example_model`], two full channels and one mean, one level and
/// layer.
pub fn example_model() -> MaterialModel {
    let base = sparse_ensemble::example::example_model();
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
        texture: Box::new(tensor),
        extras: Vec::new(),
        metadata: MetadataModel {
            texts: ["tensor example".into(), "the specification".into(), "CC0-1.0".into()],
            ..base.metadata
        },
        ..base
    }
}
