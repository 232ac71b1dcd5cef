//! The order of products, timed before it was frozen (10.7; docs/notes/product-order.md).
//!
//!     RUSTFLAGS="-C target-cpu=x86-64-v3" cargo bench -p selvedge-tools --bench product_order
//!
//! Synthetic records of 64 and 256 coefficients on 6 and 59 spatial atoms. Three orders, each checked
//! against binary64 first:
//!
//! * `shared`: `round(u3 u4)` to 16 bits, then one product with a 16-bit coefficient and the atom's shift;
//!   sums per spatial atom, then x, then y. This is the normative order.
//! * `nested`: `M(M(c, u3), u4)` with a 31-bit coefficient, the same sums.
//! * `flat`: `M(M(M(c, u12), u3), u4)`, one sum.

use selvedge::kernel::fixed::{multiply_q15, round_shift};
use selvedge_tools::math::random::Random;
use std::hint::black_box;
use std::time::Instant;
use wgpu::util::DeviceExt as _;

const LANES: usize = 8;
const ROWS: usize = 151;
const COLUMNS: usize = 32;
const EDGE: usize = 10;
type Lanes = [i32; LANES];

/// One coefficient: spatial atom, light and view column, value in 16 bits with a shift, and in 31 bits.
#[derive(Clone, Copy)]
struct Term {
    x: usize,
    y: usize,
    light: usize,
    view: usize,
    shift: u32,
    short: i32,
    long: i32,
}

struct Case {
    terms: Vec<Term>,
    /// Rows of the light, view, x and y factors.
    tables: [Vec<i32>; 4],
}

fn case(count: usize, atoms: usize) -> Case {
    let mut random = Random::new(count as u64);
    let mut spatial: Vec<(usize, usize)> =
        (0..atoms).map(|_| (random.range(0, 9) as usize, random.range(0, 9) as usize)).collect();
    spatial.sort_by_key(|&(x, y)| (y, x));
    spatial.dedup();
    let mut terms: Vec<Term> = (0..count)
        .map(|i| {
            let (x, y) = spatial[i * spatial.len() / count];
            // Magnitudes fall as those of measured coefficients do; the first is the largest.
            let value = (if i == 0 { 30_000.0 } else { 12_000.0 / (i as f64).powf(0.9) })
                * if random.once_in(2) { 1.0 } else { -1.0 };
            let shift =
                (0..=15u32).rev().find(|s| value.abs() * 2f64.powi(*s as i32) < 32_000.0).expect("some");
            let short = (value * 2f64.powi(shift as i32)).round() as i32;
            Term {
                x,
                y,
                light: random.range(0, 31) as usize,
                view: random.range(0, 31) as usize,
                shift,
                short,
                long: (short << 15) >> shift,
            }
        })
        .collect();
    terms.sort_by_key(|t| (t.y, t.x, t.light, t.view));
    let mut table = |rows: usize| {
        (0..rows * COLUMNS)
            .map(|_| random.range(-32_767, 32_767) as i32 * random.range(1, 8) as i32 / 8)
            .collect()
    };
    Case { terms, tables: [table(ROWS), table(ROWS), table(EDGE), table(EDGE)] }
}

/// A query: rows of light, view, x and y.
type Query = [usize; 4];

fn exact(case: &Case, q: Query) -> f64 {
    let u = |table: usize, row: usize, column: usize| {
        case.tables[table][row * COLUMNS + column] as f64 / 32_768.0
    };
    case.terms
        .iter()
        .map(|t| t.long as f64 * u(0, q[0], t.light) * u(1, q[1], t.view) * u(2, q[2], t.x) * u(3, q[3], t.y))
        .sum()
}

/// Columns of eight queries side by side.
struct Blended([[Lanes; COLUMNS]; 4]);

fn blend(case: &Case, queries: &[Query]) -> Blended {
    let mut blended = Blended([[[0; LANES]; COLUMNS]; 4]);
    for (lane, q) in queries.iter().enumerate() {
        for (table, &row) in q.iter().enumerate() {
            for column in 0..COLUMNS {
                blended.0[table][column][lane] = case.tables[table][row * COLUMNS + column];
            }
        }
    }
    blended
}

fn lanes(f: impl Fn(usize) -> i32) -> Lanes {
    std::array::from_fn(f)
}

fn grouped(case: &Case, b: &Blended, term: impl Fn(&Term, &Lanes, &Lanes) -> Lanes) -> Lanes {
    let (mut total, mut sum_y, mut sum_xy) = ([0; LANES], [0; LANES], [0; LANES]);
    let (mut x, mut y) = (0, 0);
    let close = |into: &mut Lanes, from: &mut Lanes, u: &Lanes| {
        *into = lanes(|i| into[i].wrapping_add(multiply_q15(from[i], u[i])));
        *from = [0; LANES];
    };
    for t in &case.terms {
        if (t.x, t.y) != (x, y) {
            close(&mut sum_y, &mut sum_xy, &b.0[2][x]);
            x = t.x;
            if t.y != y {
                close(&mut total, &mut sum_y, &b.0[3][y]);
                y = t.y;
            }
        }
        let product = term(t, &b.0[0][t.light], &b.0[1][t.view]);
        sum_xy = lanes(|i| sum_xy[i].wrapping_add(product[i]));
    }
    close(&mut sum_y, &mut sum_xy, &b.0[2][x]);
    close(&mut total, &mut sum_y, &b.0[3][y]);
    total
}

fn shared(case: &Case, b: &Blended) -> Lanes {
    grouped(case, b, |t, l, v| {
        lanes(|i| round_shift(t.short.wrapping_mul((l[i].wrapping_mul(v[i]) + 0x4000) >> 15), t.shift))
    })
}

fn nested(case: &Case, b: &Blended) -> Lanes {
    grouped(case, b, |t, l, v| lanes(|i| multiply_q15(multiply_q15(t.long, l[i]), v[i])))
}

fn flat(case: &Case, b: &Blended) -> Lanes {
    let mut total: Lanes = [0; LANES];
    for t in &case.terms {
        let (l, v, x, y) = (&b.0[0][t.light], &b.0[1][t.view], &b.0[2][t.x], &b.0[3][t.y]);
        total = lanes(|i| {
            let u12 = (x[i].wrapping_mul(y[i]) + 0x4000) >> 15;
            total[i].wrapping_add(multiply_q15(multiply_q15(multiply_q15(t.long, u12), l[i]), v[i]))
        });
    }
    total
}

/// An order of products for eight queries.
type Order = fn(&Case, &Blended) -> Lanes;
const ORDERS: [(&str, Order, &str); 3] =
    [("shared", shared, SHARED), ("nested", nested, NESTED), ("flat", flat, FLAT)];

const COMMON: &str = "
@group(0) @binding(0) var<storage, read> terms: array<vec4<i32>>;
@group(0) @binding(1) var<storage, read> tables: array<i32>;
@group(0) @binding(2) var<storage, read> queries: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> answers: array<i32>;
fn m(p: i32, u: i32) -> i32 { return (p >> 15u) * u + (((p & 0x7fff) * u + 0x4000) >> 15u); }
fn rs(p: i32, s: u32) -> i32 { if (s == 0u) { return p; } return (p >> s) + ((p >> (s - 1u)) & 1); }
";
const GROUPED: &str = "
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let q = queries[id.x];
    var total = 0; var sum_y = 0; var sum_xy = 0; var x = 0u; var y = 0u;
    for (var i = 0u; i < arrayLength(&terms); i++) {
        let t = terms[i];
        let tx = u32(t.x) & 31u; let ty = (u32(t.x) >> 5u) & 31u;
        if (tx != x || ty != y) { sum_y += m(sum_xy, tables[q.z + x]); sum_xy = 0; x = tx; }
        if (ty != y) { total += m(sum_y, tables[q.w + y]); sum_y = 0; y = ty; }
        let l = tables[q.x + ((u32(t.x) >> 10u) & 31u)]; let v = tables[q.y + ((u32(t.x) >> 15u) & 31u)];
        sum_xy += TERM;
    }
    sum_y += m(sum_xy, tables[q.z + x]);
    answers[id.x] = total + m(sum_y, tables[q.w + y]);
}
";
const SHARED: &str = "rs(t.y * ((l * v + 0x4000) >> 15u), u32(t.w))";
const NESTED: &str = "m(m(t.z, l), v)";
const FLAT: &str = "
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let q = queries[id.x];
    var total = 0;
    for (var i = 0u; i < arrayLength(&terms); i++) {
        let t = terms[i];
        let l = tables[q.x + ((u32(t.x) >> 10u) & 31u)]; let v = tables[q.y + ((u32(t.x) >> 15u) & 31u)];
        let u12 = (tables[q.z + (u32(t.x) & 31u)] * tables[q.w + ((u32(t.x) >> 5u) & 31u)] + 0x4000) >> 15u;
        total += m(m(m(t.z, u12), l), v);
    }
    answers[id.x] = total;
}
";

/// A device and its queue.
type Gpu = (wgpu::Device, wgpu::Queue);

/// The pipeline of a kernel: a whole one, or a term of the grouped sums.
fn pipeline_of(device: &wgpu::Device, body: &str) -> wgpu::ComputePipeline {
    let source = if body.contains("@compute") {
        format!("{COMMON}{body}")
    } else {
        format!("{COMMON}{}", GROUPED.replace("TERM", body))
    };
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    })
}

/// Buffers of the terms, the tables and the queries of a case.
fn inputs_of(device: &wgpu::Device, case: &Case, queries: &[Query]) -> [wgpu::Buffer; 3] {
    let terms: Vec<i32> = case
        .terms
        .iter()
        .flat_map(|t| {
            [(t.x | t.y << 5 | t.light << 10 | t.view << 15) as i32, t.short, t.long, t.shift as i32]
        })
        .collect();
    let starts: Vec<usize> =
        case.tables.iter().scan(0, |at, t| Some(std::mem::replace(at, *at + t.len()))).collect();
    let words: Vec<u32> =
        queries.iter().flat_map(|q| (0..4).map(|i| (starts[i] + q[i] * COLUMNS) as u32)).collect();
    let tables: Vec<i32> = case.tables.concat();
    let make = |contents: &[u8]| {
        let usage = wgpu::BufferUsages::STORAGE;
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
    };
    [
        make(bytemuck::cast_slice(&terms)),
        make(bytemuck::cast_slice(&tables)),
        make(bytemuck::cast_slice(&words)),
    ]
}

/// Seconds that a kernel takes for the queries, and its answers.
fn on_gpu((device, queue): &Gpu, case: &Case, queries: &[Query], body: &str) -> (f64, Vec<i32>) {
    let pipeline = pipeline_of(device, body);
    let size = (queries.len() * 4) as u64;
    let buffer = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let [terms, tables, words] = inputs_of(device, case, queries);
    let answers = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let back = buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
    let bound = [&terms, &tables, &words, &answers];
    let entries: Vec<wgpu::BindGroupEntry<'_>> = (0u32..)
        .zip(bound)
        .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
        .collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut best = f64::MAX;
    for run in 0..6 {
        let begin = Instant::now();
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(queries.len() as u32 / 64, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&answers, 0, &back, 0, size);
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely()).expect("done");
        // The first run compiles.
        if run > 0 {
            best = best.min(begin.elapsed().as_secs_f64());
        }
    }
    back.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    device.poll(wgpu::PollType::wait_indefinitely()).expect("done");
    let view = back.slice(..).get_mapped_range().expect("mapped");
    (best, bytemuck::cast_slice(&view).to_vec())
}

/// Random queries of the tables.
fn random_queries() -> Vec<Query> {
    let mut random = Random::new(1);
    let mut rows = |most: i64| random.range(0, most) as usize;
    (0..1 << 16).map(|_| [rows(150), rows(150), rows(9), rows(9)]).collect()
}

/// Signal to noise of an order against binary64, from units of 2^-15, decibels.
fn signal_to_noise(case: &Case, order: Order, blended: &[Blended], queries: &[Query]) -> f64 {
    let (mut signal, mut noise) = (0.0, 0.0);
    for (b, q) in blended.iter().zip(queries.chunks(LANES)) {
        for (lane, got) in order(case, b).iter().enumerate() {
            let wanted = exact(case, q[lane]);
            signal += wanted * wanted;
            noise += (*got as f64 - wanted).powi(2);
        }
    }
    10.0 * f64::log10(signal / noise)
}

/// Queries of which columns are blended beforehand.
const BLENDED: usize = 512;

/// Queries a second of an order on one core, in lanes: the median.
fn cpu_rate(case: &Case, order: Order, blended: &[Blended]) -> f64 {
    let mut rates: Vec<f64> = (0..15)
        .map(|_| {
            let begin = Instant::now();
            for _ in 0..40 {
                blended.iter().for_each(|b| {
                    black_box(order(black_box(case), b));
                });
            }
            40.0 * BLENDED as f64 / begin.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    rates[7]
}

fn main() {
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).ok();
    let gpu = adapter.as_ref().map(|a| {
        println!("adapter: {}", a.get_info().name);
        pollster::block_on(a.request_device(&wgpu::DeviceDescriptor {
            required_limits: wgpu::Limits::downlevel_defaults(),
            ..Default::default()
        }))
        .expect("device")
    });
    println!("target features: avx2 {}", cfg!(target_feature = "avx2"));
    for (count, atoms) in [(64, 6), (256, 59)] {
        let case = case(count, atoms);
        let queries = random_queries();
        let blended: Vec<Blended> = queries[..BLENDED].chunks(LANES).map(|q| blend(&case, q)).collect();
        for (name, order, kernel) in ORDERS {
            let quality = signal_to_noise(&case, order, &blended, &queries);
            let rate = cpu_rate(&case, order, &blended);
            let gpu_rate = gpu.as_ref().map(|gpu| {
                let (seconds, answers) = on_gpu(gpu, &case, &queries, kernel);
                for (b, (q, a)) in blended.iter().zip(queries.chunks(LANES).zip(answers.chunks(LANES))) {
                    assert_eq!(order(&case, b).as_slice(), a, "{name} {:?}", q[0]);
                }
                queries.len() as f64 / seconds / 1e6
            });
            println!(
                "{count:4} coefficients  {name:7} {quality:6.1} dB  CPU, 8 lanes {:6.2} M sums/s  \
                 kernel {:6.2} M/s",
                rate / 1e6,
                gpu_rate.unwrap_or(f64::NAN)
            );
        }
    }
}
