//! Gives the library the soname of the one that it stands in for, and says whether hits number the instances of an
//! array.

fn main() {
    let is_set = |feature: &str| std::env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let soname = if is_set("V4") { "libembree4.so.4" } else { "libembree3.so.3" };
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,{soname}");
    println!("cargo::rustc-check-cfg=cfg(instance_primitives)");
    if is_set("V4") && !is_set("COMPACT_RAY_HIT") {
        println!("cargo::rustc-cfg=instance_primitives");
    }
    println!("cargo::rerun-if-changed=build.rs");
}
