//! Prints the worked example of the specification, part by part, as hex dumps: what `spec/` shows.
//!
//!     cargo run -p selvedge-tools --example spec_example

use selvedge_tools::format::write::write_material;
use selvedge_tools::methods::sparse_ensemble::example::example_model;

fn main() {
    let file = write_material(&example_model());
    let opened = selvedge::open(&file, &selvedge::Limits::NONE).expect("legal");
    println!("decode digest {}\n", selvedge_tools::format::bits::hex(&opened.decode_digest()));
    for (name, bytes, offset) in selvedge_tools::check::example::parts(&file) {
        println!("{name}\n{}", selvedge_tools::check::example::hex_dump(&bytes, offset));
    }
}
