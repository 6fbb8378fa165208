//! `twincast`: arguments, then the library, then an exit code.

fn main() {
    twincast::cli::main()
}
