//! The program `selvedge`; see [`selvedge_tools::cli`].

fn main() -> std::process::ExitCode {
    selvedge_tools::cli::main()
}
