//! `twincast`: arguments, then the library, then an exit code.

fn main() -> std::process::ExitCode {
    twincast::cli::main()
}
