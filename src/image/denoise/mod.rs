//! Noise taken out of finished pictures, by Intel's Open Image Denoise: a network that was trained on path-traced ones.
//!
//! | file | what |
//! | --- | --- |
//! | `library` | finds the library at run time, and its functions by their names |
//! | `device` | one run of the network over pictures of one size |
//! | `absent` | stands for both in a build without the feature `oidn` |
//!
//! A picture is denoised as linear radiance, guided by albedo and normals of what its pixels show. These are averages
//! over samples, noisy wherever a lens, a shutter or thin things make them so. So each guide is denoised by itself
//! first, and the picture by guides that are declared clean, which is what the library's documentation recommends for
//! final pictures. Guides as they come, the simpler way, take a third of the time, and leave their noise in the picture
//! or blur what they were to keep.
//!
//! The library is opened when a picture is to be denoised, and a build needs nothing of it: Debian 12 has no package,
//! and who renders without denoising must not need one. The crate `oidn` links one version at build time. It runs on
//! the processor: a graphics card's results differ in their last bits, and would need other memory.

#[cfg(not(feature = "oidn"))]
mod absent;
#[cfg(feature = "oidn")]
mod device;
#[cfg(feature = "oidn")]
mod library;

use std::ffi::CStr;
use std::path::Path;

#[cfg(not(feature = "oidn"))]
use absent::Library;
#[cfg(feature = "oidn")]
use library::Library;

use super::{Channel, Image, Plane};
use crate::error::{Error, Result};
use crate::math::Vec4;

/// The environment variable that names the library, or the folder that it is in.
pub const VARIABLE: &str = "TWINCAST_OIDN";

/// Called with the part that is done, 0 to 1, from any thread; whether to go on.
pub type Watch<'a> = &'a (dyn Fn(f64) -> bool + Sync);

/// Three numbers for each pixel, row by row.
type Pixels = Vec<[f32; 3]>;

/// What tells the network where edges and patterns are; each for as many pixels as the picture has.
#[derive(Clone, Debug, PartialEq)]
pub struct Guides {
    /// Share of light that surfaces send on, 0 to 1, averaged with the picture's own samples and filter.
    pub albedo: Vec<[f32; 3]>,
    /// Shading normals, -1 to 1, averaged likewise; 0 where there is no surface.
    pub normal: Vec<[f32; 3]>,
}

impl Guides {
    /// The layers `albedo` and `normal`; none where one of them is missing.
    pub fn of_channels(channels: &[Channel]) -> Option<Self> {
        let plane = |name: String| match &channels.iter().find(|channel| channel.name == name)?.plane {
            Plane::Float(values) => Some(values),
            Plane::Uint(_) => None,
        };
        let layer = |name: &str, components: [&str; 3]| {
            let [x, y, z] = components.map(|component| plane(format!("{name}.{component}")));
            let pixels = x?.iter().zip(y?).zip(z?);
            Some(pixels.map(|((&x, &y), &z)| [x, y, z]).collect())
        };
        Some(Self { albedo: layer("albedo", ["R", "G", "B"])?, normal: layer("normal", ["X", "Y", "Z"])? })
    }
}

/// Open Image Denoise, found and ready.
#[derive(Debug)]
pub struct Denoiser(Library);

impl Denoiser {
    /// Opens the library that [`VARIABLE`] names, else the one that the system finds.
    ///
    /// # Errors
    /// [`Error::Unavailable`] where there is none, it is older than 1.4 or has no use for this processor, and in a
    /// build without the feature `oidn`.
    pub fn find() -> Result<Self> {
        let named = std::env::var_os(VARIABLE).filter(|path| !path.is_empty());
        Library::open(named.as_deref().map(Path::new)).map(Self)
    }

    /// Opens the library at this path, or in this folder.
    ///
    /// # Errors
    /// As of [`Denoiser::find`].
    pub fn open(path: &Path) -> Result<Self> {
        Library::open(Some(path)).map(Self)
    }

    /// Its name and version, as in `Open Image Denoise 2.3.0`.
    pub fn name(&self) -> String {
        let [major, minor, patch] = self.0.version();
        format!("Open Image Denoise {major}.{minor}.{patch}")
    }

    /// The picture without its noise, by as many threads as rayon's current pool has. Alpha stays, and so does what no
    /// surface covers at all.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `watch` says so; [`Error::Backend`] with the library's own words where it fails; and
    /// [`Error::Usage`] for guides of another size, and as of [`Image::check`].
    pub fn denoise(&self, image: &Image, guides: &Guides, watch: Watch<'_>) -> Result<Image> {
        image.check()?;
        let pixels = image.pixels.len();
        if guides.albedo.len() != pixels || guides.normal.len() != pixels {
            let (albedo, normal) = (guides.albedo.len(), guides.normal.len());
            let message = format!("{pixels} pixels to denoise by the albedo of {albedo} and the normals of {normal}");
            return Err(Error::Usage(message));
        }
        let device = self.0.device(rayon::current_num_threads())?;
        let size = [image.width, image.height];
        // Each of the three runs is a third of the work.
        let run = |part: f64, inputs: &[(&CStr, &Pixels)], flags: &[&CStr]| {
            device.run(size, inputs, flags, &|done| watch((part + done) / 3.0))
        };
        let albedo = run(0.0, &[(c"albedo", &guides.albedo)], &[])?;
        let normal = run(1.0, &[(c"normal", &guides.normal)], &[])?;
        let noisy: Pixels = image.pixels.iter().map(|pixel| pixel.truncate().to_array()).collect();
        let inputs = [(c"color", &noisy), (c"albedo", &albedo), (c"normal", &normal)];
        let clean = run(2.0, &inputs, &[c"hdr", c"cleanAux"])?;
        let joined = image.pixels.iter().zip(clean).map(|(noisy, [r, g, b])| match noisy.w {
            0.0 => *noisy,
            alpha => Vec4::new(r, g, b, alpha),
        });
        Ok(Image { pixels: joined.collect(), ..*image })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guides_are_the_layers_of_that_name() {
        let channel = |(k, name): (usize, &str)| Channel::float(name, vec![k as f32, 10.0 + k as f32]);
        let names = ["normal.X", "albedo.B", "depth.Z", "albedo.R", "albedo.G", "normal.Z", "normal.Y"];
        let all: Vec<_> = names.into_iter().enumerate().map(channel).collect();
        let guides = Guides::of_channels(&all).expect("both are there");
        assert_eq!(guides.albedo, [[3.0, 4.0, 1.0], [13.0, 14.0, 11.0]]);
        assert_eq!(guides.normal, [[0.0, 6.0, 5.0], [10.0, 16.0, 15.0]]);
        for missing in [0, 1, 3, 4, 5, 6] {
            let mut some = all.clone();
            some.remove(missing);
            assert_eq!(Guides::of_channels(&some), None);
        }
        let integer = Channel::uint("albedo.R", vec![1, 2]);
        assert_eq!(Guides::of_channels(&[&all[..3], &[integer], &all[4..]].concat()), None);
    }

    #[test]
    fn a_library_that_is_not_there_is_told_with_a_remedy() {
        let refused = Denoiser::open(Path::new("/no/such/libOpenImageDenoise.so.2")).expect_err("there is none");
        assert_eq!(refused.exit_code(), 5);
        let words = if cfg!(feature = "oidn") { ["/no/such/lib", VARIABLE] } else { ["--features", "oidn"] };
        assert!(words.iter().all(|words| refused.to_string().contains(words)), "{refused}");
    }
}
