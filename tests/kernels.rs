//! Whether kernels are compiled for the instruction sets that they are for, which no other test would notice.
//!
//! A closure or a function that is not inlined into a kernel is compiled for what every processor has, and then each of
//! its vector instructions is a call of a function: among things that move, that once took half of all the time.

use std::process::{Command, Stdio};

use crate::skip::skip;

/// What kernels are inlined into.
const KERNELS: &str = "twincast_core::trace::bvh::simd::isa::";

#[test]
fn nothing_but_kernels_calls_vector_instructions() {
    if !cfg!(target_arch = "x86_64") {
        skip("kernels have instruction sets of their own on x86-64 alone");
        return;
    }
    let listing = Command::new("objdump")
        .args(["--disassemble", "--no-show-raw-insn", "--demangle", env!("CARGO_BIN_EXE_twincast")])
        .stderr(Stdio::null())
        .output();
    let Ok(listing) = listing else {
        skip("there is no objdump (Debian: apt-get install binutils)");
        return;
    };
    let text = String::from_utf8_lossy(&listing.stdout);
    let (mut function, mut kernels, mut outside) = ("", 0, Vec::new());
    for line in text.lines() {
        if line.ends_with(">:") {
            function = line;
            kernels += usize::from(line.contains(KERNELS));
        } else if line.contains("call")
            && ["core_arch::x86::avx", "core_arch::x86::fma"].iter().any(|set| line.contains(set))
            // Others have kernels of their own.
            && !function.contains(KERNELS)
            && !function.contains("memchr::")
            && outside.last() != Some(&function)
        {
            outside.push(function);
        }
    }
    assert!(kernels > 10, "{kernels} kernels: are there symbols in the program?");
    assert!(outside.is_empty(), "compiled without their instruction set: {outside:#?}");
}
