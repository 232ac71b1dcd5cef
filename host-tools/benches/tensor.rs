//! Speed of the sparse tensor's filtered samples on one core, against 36 separate taps in binary32, after
//! both were compared.
//!
//!     RUSTFLAGS="-C target-cpu=x86-64-v3" cargo bench -p selvedge-tools --no-default-features --bench tensor
//!
//! The taps are as the paper states them before its section 4.3 merges them: each of four texels times nine
//! pairs of directions evaluates equation 2 by itself, from the same file's numbers in binary32, with colours
//! side by side. Their directions are located beforehand, which is in their favour.

use selvedge::kernel::position::{Place, axis_at_position};
use selvedge::method::sparse_tensor::sparse_tensor_textures_q20;
use selvedge::{Direction, FilteredQuery, Limits, Located, Rgb, Selvedge, Taps};
use selvedge_tools::data::dataset::{Dataset, Sample};
use selvedge_tools::encode::goal::Target;
use selvedge_tools::format::model::MaterialModel;
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_tensor::encode::fit::{Shape, Training};
use selvedge_tools::methods::sparse_tensor::encode::{Options, encode};
use selvedge_tools::methods::sparse_tensor::model::tensor_of;
use selvedge_tools::synth::{Mesostructure, Request, synthesise};
use selvedge_tools::{data::transfer::Domain, math::pca::pca};
use std::hint::black_box;
use std::time::Instant;

/// Runs of each measurement, in turn; medians are printed with their range.
const RUNS: usize = 9;
const QUERIES: usize = 1 << 14;

/// Fused where the processor fuses.
#[inline(always)]
fn multiply_add(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(target_feature = "fma") { a.mul_add(b, c) } else { a * b + c }
}

/// The tensor in binary32.
struct Floats {
    width: u32,
    entries: usize,
    atoms: usize,
    light_atoms: usize,
    /// `[light][atom]`, three channels and padding.
    lights: Vec<[f32; 4]>,
    /// `[view][ABRDF atom][entry]`.
    fibres: Vec<(u32, f32)>,
    /// Every texel has as many, with zeros at the end.
    lists: Vec<(u32, f32)>,
    most: usize,
}

impl Floats {
    fn new(model: &MaterialModel) -> Floats {
        let tensor = tensor_of(model).expect("a sparse tensor");
        let layer = &tensor.lists[0][0];
        let most = layer.lists.iter().map(Vec::len).max().unwrap_or(0);
        let mask = (1u16 << (32 - (tensor.light_atoms - 1).leading_zeros())) - 1;
        let coefficient = |&(atom, value): &(u32, u16)| {
            let shifts = tensor.atoms[atom as usize];
            // 12.5 in floats: Q15 times the angular part, times eight, by all shifts, from Q20.
            let unit = 2f64.powi(3 - (shifts.angular + shifts.gain + layer.shift) as i32 - 20);
            (
                atom,
                (selvedge::method::sparse_tensor::list_coefficient(value as u32, layer.value_bits) as f64
                    * unit) as f32,
            )
        };
        let padded = |list: &Vec<(u32, u16)>| {
            let mut list: Vec<(u32, f32)> = list.iter().map(coefficient).collect();
            list.resize(most, (0, 0.0));
            list
        };
        Floats {
            width: model.size[0],
            entries: tensor.entries as usize,
            atoms: tensor.atoms.len(),
            light_atoms: tensor.light_atoms as usize,
            lights: tensor.lights.iter().map(|l| [l[0] as f32, l[1] as f32, l[2] as f32, 0.0]).collect(),
            fibres: tensor
                .fibres
                .iter()
                .map(|&entry| ((entry & mask) as u32, (entry & !mask) as i16 as f32))
                .collect(),
            lists: layer.lists.iter().flat_map(padded).collect(),
            most,
        }
    }

    /// Equation 2 at one texel and pair.
    #[inline(always)]
    fn tap(&self, texel: u32, light: u32, view: u32) -> [f32; 4] {
        let lights = &self.lights[light as usize * self.light_atoms..][..self.light_atoms];
        let mut sum = [0.0f32; 4];
        for &(atom, coefficient) in &self.lists[texel as usize * self.most..][..self.most] {
            let fibre =
                &self.fibres[(view as usize * self.atoms + atom as usize) * self.entries..][..self.entries];
            let mut angular = [0.0f32; 4];
            for &(index, value) in fibre {
                let l = lights[index as usize];
                (0..4).for_each(|c| angular[c] = multiply_add(value, l[c], angular[c]));
            }
            (0..4).for_each(|c| sum[c] = multiply_add(coefficient, angular[c], sum[c]));
        }
        sum
    }

    /// Thirty-six taps.
    fn filtered(&self, query: &FilteredQuery, light: Taps, view: Taps) -> [f32; 4] {
        let axis = |position: u32| {
            let axis = axis_at_position(1, 1 << 18, self.width, position);
            [(axis.first.block, axis.first.weight_a_q15), (axis.second.block, axis.second.weight_a_q15)]
        };
        let taps = |t: Taps| [(t.a, t.weight_a_q15), (t.b, t.weight_b_q15), (t.c, t.weight_c_q15)];
        let mut sum = [0.0f32; 4];
        for (y, weight_y) in axis(query.v_q32) {
            for (x, weight_x) in axis(query.u_q32) {
                for (v, weight_v) in taps(view) {
                    for (l, weight_l) in taps(light) {
                        let weight = weight_x as f32
                            * weight_y as f32
                            * weight_v as f32
                            * weight_l as f32
                            * 2f32.powi(-60);
                        let tap = self.tap(y * self.width + x, l, v);
                        (0..4).for_each(|c| sum[c] += weight * tap[c]);
                    }
                }
            }
        }
        sum
    }
}

fn direction(random: &mut Random) -> Direction {
    let unit = |word: u32| word as f32 / 4_294_967_296.0;
    let (z, azimuth) = (unit(random.word()), unit(random.word()) * std::f32::consts::TAU);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Direction::from_unit_vector([r * azimuth.cos(), r * azimuth.sin(), z])
}

fn line(name: &str, rates: &mut [f64]) -> f64 {
    rates.sort_by(f64::total_cmp);
    println!(
        "{name:44} {:8.3} M/s  (range {:.3} to {:.3})",
        rates[RUNS / 2] / 1e6,
        rates[0] / 1e6,
        rates[RUNS - 1] / 1e6
    );
    rates[RUNS / 2]
}

/// A material, the same in binary32, and random queries with their located light and view.
struct Bench<'a> {
    model: &'a MaterialModel,
    material: &'a Selvedge<'a>,
    floats: Floats,
    queries: Vec<FilteredQuery>,
    located: Vec<(Located, Located)>,
}

impl<'a> Bench<'a> {
    fn new(model: &'a MaterialModel, material: &'a Selvedge<'a>) -> Bench<'a> {
        let mut random = Random::new(9);
        let queries: Vec<FilteredQuery> = (0..QUERIES)
            .map(|_| FilteredQuery {
                u_q32: random.word(),
                v_q32: random.word(),
                light: direction(&mut random),
                view: direction(&mut random),
            })
            .collect();
        let located =
            queries.iter().map(|q| (material.locate_light(q.light), material.locate_view(q.view))).collect();
        Bench { model, material, floats: Floats::new(model), queries, located }
    }

    /// Axes of a query's position.
    fn place(&self, query: &FilteredQuery) -> Place {
        let m = self.material.material();
        let axis = |position: u32| axis_at_position(m.edge, m.edge_reciprocal_q18, m.width, position);
        Place { level: 0, x: axis(query.u_q32), y: axis(query.v_q32) }
    }

    /// How many ABRDF atoms the texels of a sample have.
    fn atoms_met(&self, place: &Place) -> usize {
        let lists = &tensor_of(self.model).expect("a tensor").lists[0][0].lists;
        let mut atoms = std::collections::BTreeSet::new();
        for y in [place.y.first.block, place.y.second.block] {
            for x in [place.x.first.block, place.x.second.block] {
                atoms.extend(lists[(y * self.material.material().width + x) as usize].iter().map(|c| c.0));
            }
        }
        atoms.len()
    }

    /// Asserts that the batch has the words of the plain path, and the taps the same but for rounding. Gives
    /// the largest difference, the largest texture, and ABRDF atoms of all samples.
    fn compare(&self, out: &[Rgb]) -> (f64, f64, usize) {
        let (material, mut worst, mut largest, mut met) = (self.material, 0.0f64, 0.0f64, 0usize);
        for ((query, rgb), &(light, view)) in self.queries.iter().zip(out).zip(&self.located) {
            assert_eq!(
                material.filtered(query.u_q32, query.v_q32, query.light, query.view),
                *rgb,
                "the batch is not the plain path"
            );
            let wanted = self.floats.filtered(query, light.taps, view.taps);
            let place = self.place(query);
            let got =
                sparse_tensor_textures_q20(material.words(), material.material(), &place, &light, &view);
            for (got, wanted) in [got.c0, got.c1, got.c2].into_iter().zip(wanted) {
                worst = worst.max((got as f64 / 1_048_576.0 - wanted as f64).abs());
                largest = largest.max(wanted.abs() as f64);
            }
            met += self.atoms_met(&place);
        }
        (worst, largest, met)
    }

    /// Times the batch, the plain path and the taps in turn.
    fn time(&self, scratch: &mut [i32], out: &mut [Rgb]) {
        let (material, queries) = (self.material, &self.queries);
        let mut rates = [(); 3].map(|()| Vec::new());
        for _ in 0..RUNS {
            let mut timed = |which: usize, run: &mut dyn FnMut()| {
                let begin = Instant::now();
                run();
                rates[which].push(queries.len() as f64 / begin.elapsed().as_secs_f64());
            };
            timed(0, &mut || material.sample_batch(queries, scratch, out).expect("buffers fit"));
            black_box(&*out);
            timed(1, &mut || {
                let plain = |q: &FilteredQuery| material.filtered(q.u_q32, q.v_q32, q.light, q.view);
                queries.iter().for_each(|q| _ = black_box(plain(q)))
            });
            timed(2, &mut || {
                let taps =
                    |q, light: &Located, view: &Located| self.floats.filtered(q, light.taps, view.taps);
                let all = queries.iter().zip(&self.located);
                all.for_each(|(q, (light, view))| _ = black_box(taps(q, light, view)))
            });
        }
        let [batch, plain, taps] = &mut rates;
        let (batch, plain, taps) = (
            line("merged list, batch", batch),
            line("merged list, one by one", plain),
            line("36 separate taps in binary32", taps),
        );
        println!("batch {:.2} times the taps, one by one {:.2} times", batch / taps, plain / taps);
    }
}

fn measure(data: &Dataset, light_atoms: usize, abrdf_atoms: usize) {
    let components = pca(data, Domain::Linear, 160).expect("data");
    let shape = Shape { light_atoms, abrdf_atoms, entries: 9, coefficients: 11 };
    let training = Training { iterations: 6, rounds: 1, seed: 1 };
    let options = Options { shape, target: Target::AsGiven, value_bits: Some(7), training };
    let encoded = encode(&components, &[], &options, |_, _, _| ()).expect("encoded");
    let material = selvedge::open(&encoded.bytes, &Limits::NONE).expect("legal");
    let bench = Bench::new(&encoded.model, &material);
    let count = bench.queries.len();
    let mut scratch = vec![0; material.batch_scratch_len(count)];
    let mut out = vec![Rgb::default(); count];
    material.sample_batch(&bench.queries, &mut scratch, &mut out).expect("buffers fit");
    let (worst, largest, met) = bench.compare(&out);
    println!(
        "{light_atoms} light atoms, {abrdf_atoms} ABRDF atoms, k1 9, k2 11; {} bytes; {:.1} ABRDF atoms a \
         sample; textures up to {largest:.3}, largest difference {worst:.6}",
        encoded.bytes.len(),
        met as f64 / count as f64
    );
    assert!(worst < 1e-3 * largest, "{worst} of {largest}");
    bench.time(&mut scratch, &mut out);
}

fn main() {
    // Cargo passes --bench; run as a test, there is nothing to do.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    println!("target features: avx2 {}", cfg!(target_feature = "avx2"));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cloth.selvset");
    let request = Request {
        kind: Mesostructure::Cloth,
        size: [64, 64],
        directions: 81,
        seed: 1,
        samples: 1,
        sample: Sample::Half,
    };
    synthesise(&request, &path, &|_, _| ()).expect("rendered");
    let data = Dataset::open(&path).expect("just written");
    measure(&data, 128, 128);
    measure(&data, 256, 256);
}
