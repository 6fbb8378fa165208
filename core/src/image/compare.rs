//! How two images differ, in numbers and as a picture.

use super::Image;
use crate::error::{Error, Result};
use crate::math::Vec4;

/// How two images of one size differ. Alpha counts as a channel; values are linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Pixels in each.
    pub pixels: u64,
    /// Those of them that are not equal in all four channels. NaN equals NaN, and 0 equals -0.
    pub differing: u64,
    /// The largest absolute difference of two samples; infinite where one is NaN and the other is not.
    pub max_abs: f64,
    /// Column and row of the first pixel where it is reached; None where nothing differs.
    pub max_at: Option<(u32, u32)>,
    /// Root of the mean squared difference over all samples.
    pub rmse: f64,
}

impl Image {
    /// Compares with an image of the same size.
    ///
    /// # Errors
    /// [`Error::Check`] where the sizes differ, and those of [`Image::check`].
    pub fn difference(&self, other: &Self) -> Result<Difference> {
        self.check_size(other)?;
        let mut d =
            Difference { pixels: self.pixels.len() as u64, differing: 0, max_abs: 0.0, max_at: None, rmse: 0.0 };
        let mut squares = 0.0;
        for (index, (&a, &b)) in self.pixels.iter().zip(&other.pixels).enumerate() {
            let deltas = absolute_difference(a, b);
            let largest = deltas.into_iter().fold(0.0, f64::max);
            if largest == 0.0 {
                continue;
            }
            d.differing += 1;
            squares += deltas.into_iter().map(|x| x * x).sum::<f64>();
            if largest > d.max_abs {
                d.max_abs = largest;
                let width = self.width as usize;
                d.max_at = Some(((index % width) as u32, (index / width) as u32));
            }
        }
        d.rmse = (squares / (4.0 * d.pixels.max(1) as f64)).sqrt();
        Ok(d)
    }

    /// The absolute difference, channel by channel, as an opaque picture. Where only alpha differs it is gray.
    ///
    /// # Errors
    /// [`Error::Check`] where the sizes differ, and those of [`Image::check`].
    pub fn difference_image(&self, other: &Self) -> Result<Self> {
        self.check_size(other)?;
        let pixel = |(&a, &b): (&Vec4, &Vec4)| {
            let [r, g, b, alpha] = absolute_difference(a, b).map(|x| x as f32);
            if r.max(g).max(b) == 0.0 { Vec4::new(alpha, alpha, alpha, 1.0) } else { Vec4::new(r, g, b, 1.0) }
        };
        let pixels = self.pixels.iter().zip(&other.pixels).map(pixel).collect();
        Ok(Self { width: self.width, height: self.height, pixels })
    }

    fn check_size(&self, other: &Self) -> Result<()> {
        self.check().and_then(|()| other.check())?;
        check_extents(self.extent(), other.extent())
    }

    pub(super) fn extent(&self) -> Extent {
        Extent { width: self.width, height: self.height, pixels: self.pixels.len() }
    }
}

/// The size of an image, and how many pixels are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    width: u32,
    height: u32,
    pixels: usize,
}

/// # Errors
/// [`Error::Check`] where they differ.
pub(super) fn check_extents(one: Extent, other: Extent) -> Result<()> {
    if one == other {
        return Ok(());
    }
    Err(Error::Check(format!(
        "the images differ in size: {} x {} and {} x {} pixels",
        one.width, one.height, other.width, other.height
    )))
}

/// In f64, where differences of f32 neither overflow nor vanish.
fn absolute_difference(a: Vec4, b: Vec4) -> [f64; 4] {
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(a[i]), f64::from(b[i]));
        // Before subtracting: equal infinities would give NaN.
        if a == b || (a.is_nan() && b.is_nan()) {
            0.0
        } else if a.is_nan() || b.is_nan() {
            f64::INFINITY
        } else {
            (a - b).abs()
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: &[[f32; 4]]) -> Image {
        Image { width: 2, height: pixels.len() as u32 / 2, pixels: pixels.iter().map(|&p| p.into()).collect() }
    }

    #[test]
    fn equal_images() {
        let a = image(&[[f32::NAN, 0.0, f32::INFINITY, 1.0], [1.0; 4]]);
        let b = image(&[[f32::NAN, -0.0, f32::INFINITY, 1.0], [1.0; 4]]);
        let d = a.difference(&b).unwrap();
        assert_eq!(d, Difference { pixels: 2, differing: 0, max_abs: 0.0, max_at: None, rmse: 0.0 });
    }

    #[test]
    fn counts_and_places() {
        let a = image(&[[0.0, 0.0, 0.0, 1.0], [1.0; 4], [1.0; 4], [0.5; 4]]);
        let b = image(&[[0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 0.0], [1.0; 4], [0.5, 0.5, 2.5, 0.5]]);
        let d = a.difference(&b).unwrap();
        assert_eq!((d.pixels, d.differing, d.max_abs, d.max_at), (4, 2, 2.0, Some((1, 1))));
        // (1 + 4) / 16 samples
        assert!((d.rmse - (5.0f64 / 16.0).sqrt()).abs() < 1e-15);
        let picture = a.difference_image(&b).unwrap();
        assert_eq!(picture, image(&[[0.0, 0.0, 0.0, 1.0], [1.0; 4], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 2.0, 1.0]]));
    }

    #[test]
    fn nan_against_a_number_is_infinite() {
        let a = image(&[[f32::NAN, 0.0, 0.0, 1.0], [1.0; 4]]);
        let b = image(&[[0.0, 0.0, 0.0, 1.0], [1.0; 4]]);
        let d = a.difference(&b).unwrap();
        assert_eq!((d.differing, d.max_abs, d.max_at), (1, f64::INFINITY, Some((0, 0))));
        assert_eq!(a.difference_image(&b).unwrap().pixels[0].x, f32::INFINITY);
    }

    #[test]
    fn sizes_must_agree() {
        let (a, b) = (image(&[[1.0; 4]; 2]), image(&[[1.0; 4]; 4]));
        assert_eq!(a.difference(&b).unwrap_err().exit_code(), 1);
        assert_eq!(a.difference_image(&b).unwrap_err().exit_code(), 1);
    }
}
