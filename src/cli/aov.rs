//! What a render writes beside the picture: flags, and whether there is a file that holds it.

use std::path::PathBuf;

use clap::Args;

use crate::error::{Error, Result};
use crate::image;
use crate::render::Aov;

#[derive(Clone, Debug, Args)]
pub(super) struct AovArgs {
    /// What OpenEXR outputs hold beside the colours: depth, position, normal, uv, primitive, geometry, instance,
    /// albedo, samples, time, crypto-object, crypto-material, light by its paths, or all
    ///
    /// Light is that which came by certain paths: emission, direct, indirect (these three make up the picture),
    /// diffuse, specular, transmission (with emission so do these); or as an expression: LDE was scattered once,
    /// diffusely, before it came to the eye; caustics=L[ST]+DE gives it a name. D is diffuse, S reflected, T
    /// transmitted, . any of them; * + ? | ( ) [ ] as usual.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = parse)]
    aov: Vec<Wanted>,
}

/// One, or all.
#[derive(Clone, Debug)]
struct Wanted(Vec<Aov>);

impl AovArgs {
    /// Everything that was asked for, once.
    pub(super) fn aovs(&self) -> Vec<Aov> {
        let mut all: Vec<Aov> = Vec::new();
        for aov in self.aov.iter().flat_map(|wanted| &wanted.0) {
            if !all.contains(aov) {
                all.push(aov.clone());
            }
        }
        all
    }

    /// An error where something is asked for and none of the outputs holds it.
    pub(super) fn check(&self, outputs: &[PathBuf]) -> Result<()> {
        if self.aov.is_empty() || outputs.iter().any(|path| image::holds_channels(path)) {
            return Ok(());
        }
        Err(Error::Usage("--aov needs an output that holds it: name an OpenEXR file with --output FILE.exr".to_owned()))
    }
}

fn parse(text: &str) -> std::result::Result<Wanted, String> {
    if text.trim() == "all" {
        return Ok(Wanted(Aov::all()));
    }
    text.parse().map(|aov| Wanted(vec![aov]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_twice_is_told_once() {
        let args = AovArgs { aov: ["depth", "all", "LDE", "LDE"].map(|text| parse(text).unwrap()).to_vec() };
        assert_eq!(args.aovs().len(), Aov::all().len() + 1);
        assert!(args.check(&["a.png".into()]).is_err() && args.check(&["a.png".into(), "b.EXR".into()]).is_ok());
        assert!(parse("colour").is_err());
    }
}
