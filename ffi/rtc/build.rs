//! Gives the library the soname of the one that it stands in for.

fn main() {
    let is_set = |feature: &str| std::env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let soname = if is_set("V4") { "libembree4.so.4" } else { "libembree3.so.3" };
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,{soname}");
    println!("cargo::rerun-if-changed=build.rs");
}
