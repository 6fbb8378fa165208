//! Finds the system libraries that the default features stand on, and builds the bridges to them.

#[cfg(feature = "embree")]
mod embree;
#[cfg(feature = "oiio")]
mod oiio;

fn main() {
    println!("cargo::rerun-if-changed=build");
    #[cfg(feature = "embree")]
    embree::build();
    #[cfg(feature = "oiio")]
    oiio::build();
}
