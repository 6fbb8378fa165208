//! Light from infinitely far, as a picture of the whole sphere.

use std::sync::Arc;

use crate::image::Image;
use crate::math::Vec4;

/// An equirectangular picture around the scene: light that comes from everywhere, and what is seen behind everything.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Radiance, linear RGB; alpha is not looked at. As an equirectangular camera that looks to -z takes it: the middle
    /// is -z, +x a quarter to the right of it, +y at the top.
    pub image: Arc<Image>,
    /// Multiplies the radiance; at least 0.
    pub intensity: f32,
    /// Turned about +y by this angle, counter-clockwise as seen from above; radians.
    pub rotation: f64,
}

impl Environment {
    /// The picture as it is.
    pub fn new(image: Image) -> Self {
        Self { image: Arc::new(image), intensity: 1.0, rotation: 0.0 }
    }

    /// Whether no light comes from it.
    pub fn is_black(&self) -> bool {
        let shines = |pixel: &Vec4| pixel.truncate().max_element() > 0.0;
        !(self.intensity > 0.0 && self.image.pixels.iter().any(shines))
    }
}
