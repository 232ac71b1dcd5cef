//! lab
use selvedge_tools::synth::*;
use selvedge_tools::*;
use std::path::Path;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let t = std::time::Instant::now();
    match args[1].as_str() {
        "synth" => {
            let size: usize = args[3].parse().unwrap();
            let request = Request {
                kind: args[2].parse().unwrap_or_else(|_| panic!()),
                size: [size, size],
                directions: args[4].parse().unwrap(),
                seed: args[5].parse().unwrap(),
                samples: 4,
                sample: dataset::Sample::Half,
            };
            let s = synthesise(&request, Path::new(&args[6]), &|_, _| ()).unwrap();
            println!("{s:?} {:?}", t.elapsed());
        }
        "enc" => {
            let data = dataset::Dataset::open(Path::new(&args[2])).unwrap();
            let e = data.statistics().log_offset();
            let prepared = encode::prepare(vec![&data], model::TransferModel::Log2 { offset: e }, &|_, _| ()).unwrap();
            println!("prepared {:?} raw {}", t.elapsed(), data.description().half_bytes());
            let edges: Vec<usize> = args[3].split(',').map(|e| e.parse().unwrap()).collect();
            for edge in edges {
                let ensembles = prepared.own_ensembles(edge);
                for goal in args[4].split(',') {
                    let goal =
                        if let Some(r) = goal.strip_prefix('r') { encode::Goal::Rms(r.parse().unwrap()) } else { encode::Goal::Size(goal.parse().unwrap()) };
                    let options = encode::Options { edge, goal, ..Default::default() };
                    let t = std::time::Instant::now();
                    let encoded = match encode::encode(&prepared, &ensembles, &options, &|_, _| ()) {
                        Ok(e) => e,
                        Err(e) => {
                            println!("{edge} {goal:?} {e}");
                            continue;
                        }
                    };
                    let took = t.elapsed();
                    let file = selvedge::open(&encoded.bytes, &selvedge::Limits::NONE).unwrap();
                    let m = if args.len() > 5 {
                        measure::compare(measure::Source::Data(&data), measure::Source::File(&file, 0), data.description(), e, None, &|_, _| ()).unwrap()
                    } else {
                        Default::default()
                    };
                    let bits: Vec<u32> = encoded.model.channels.iter().map(|c| c.ensemble.as_ref().map_or(0, |e| e.coefficients[0][0].value_bits)).collect();
                    let atoms: Vec<usize> =
                        encoded.model.channels.iter().map(|c| c.ensemble.as_ref().map_or(0, |e| e.atoms.iter().map(Vec::len).sum())).collect();
                    let cols: Vec<[u32; 2]> = encoded
                        .model
                        .channels
                        .iter()
                        .map(|c| {
                            c.ensemble
                                .as_ref()
                                .map_or([0, 0], |e| [e.dictionaries.iter().map(|d| d.light.columns).sum(), e.dictionaries.iter().map(|d| d.view.columns).sum()])
                        })
                        .collect();
                    println!(
                        "edge {edge} {goal:?}: bytes {} predicted {:.4} log {:.4} lin {:.5} psnr {:.2} T {:.3} coefs {:?} bits {bits:?} atoms {atoms:?} cols {cols:?} ops {} {:?}",
                        encoded.bytes.len(),
                        encoded.predicted_rms,
                        m.log_rms,
                        m.linear_rms,
                        m.psnr_db,
                        encoded.threshold,
                        encoded.coefficients,
                        file.header().operations,
                        took
                    );
                    use std::collections::BTreeMap;
                    let mut kinds: BTreeMap<u32, usize> = BTreeMap::new();
                    for s in file.sections() {
                        *kinds.entry(s.kind).or_default() += s.length as usize;
                    }
                    println!("   {kinds:x?}");
                }
            }
        }
        _ => {}
    }
}
