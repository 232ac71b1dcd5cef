//! The smallest material that has every section of chapter 10: the worked example of the specification.

use crate::format::model::{ChannelModel, MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, DictionaryModel, EnsembleModel, EnsembleTexture, FactorModel, RecordModel,
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
            },
            ChannelModel { mean: Some(table(0, 0, 5)), ..ChannelModel::default() },
            ChannelModel::default(),
        ],
        texture: Box::new(EnsembleTexture { channels: [Some(ensemble), None, None] }),
        extras: vec![(0x8000, 0, b"any!".to_vec())],
    }
}
