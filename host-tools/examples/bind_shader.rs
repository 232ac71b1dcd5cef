//! Assembles the kernel for a file, prints what a host binds, and dispatches a query on an adapter, if there
//! is one.
//!
//!     cargo run -p selvedge-tools --example bind_shader -- decoder-core/tests/data/carpet07-excerpt.selv

use selvedge::{FilteredQuery, Limits, Selvedge};
use selvedge_shaders::{ANSWER_WORDS, ENTRIES, QUERY_WORDS, Request, assemble};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: bind_shader FILE.selv")?;
    let bytes = std::fs::read(path)?;
    let material = selvedge::open(&bytes, &Limits::default())?;

    // The functions of this material's method and one entry point: compilers see nothing else.
    let request = Request::for_materials(&[*material.material()], &["filtered"])?;
    let wgsl = assemble(&request);
    println!("{} lines of WGSL, methods {:?}", wgsl.lines().count(), names(&request));
    let entry = ENTRIES.iter().find(|entry| entry.name == "filtered").ok_or("no such entry point")?;
    println!("entry point {}, workgroups of {:?}", entry.name, entry.workgroup);

    // Binding 0 has the files, here one from word 0 on; binding 1 a record for each, which knows where.
    // A window may read one word past the end of the last file.
    let record = material.material_at(0, 0).to_words();
    println!("binding 0, read:       {} bytes, then 16 of zero: the file", bytes.len());
    println!("binding 1, read:       {} words: its record", record.len());
    println!("binding 2, read:       {QUERY_WORDS} words a query");
    println!("binding 3, read_write: {ANSWER_WORDS} words an answer");

    let light = [0.3, 0.1, 0.948];
    let query = FilteredQuery::from_f32([0.25, 0.75], light, [0.0, 0.0, 1.0]);
    let expected = material.filtered(query.u_q32, query.v_q32, query.light, query.view);
    println!("CPU:    {:?}", expected.to_f32());
    dispatch(&material, &query)
}

/// Names of the methods that a request has.
fn names(request: &Request) -> Vec<&'static str> {
    request.methods.iter().map(|method| method.name).collect()
}

#[cfg(feature = "gpu")]
fn dispatch(material: &Selvedge<'_>, query: &FilteredQuery) -> Result<(), Box<dyn Error>> {
    use selvedge_tools::gpu::runner::{Gpu, Query, direction_words};
    let Some(gpu) = Gpu::any()? else {
        println!("no adapter was found");
        return Ok(());
    };
    let loaded = gpu.load(std::slice::from_ref(material));
    let query = Query {
        u: query.u_q32,
        v: query.v_q32,
        light: direction_words(query.light),
        view: direction_words(query.view),
        ..Query::default()
    };
    // The same bits as the CPU's, on every adapter.
    let answer = gpu.answer(&loaded, "filtered", &[query])?[0];
    println!("kernel: {:?}, on {}", answer.rgb.map(f32::from_bits), gpu.description);
    Ok(())
}

#[cfg(not(feature = "gpu"))]
fn dispatch(_: &Selvedge<'_>, _: &FilteredQuery) -> Result<(), Box<dyn Error>> {
    println!("this build is without the feature `gpu`: nothing is dispatched");
    Ok(())
}
