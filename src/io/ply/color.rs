//! Colours, which vertices and faces may have.

use super::header::{Element, Scalar};
use super::vertices::all;
use crate::image::srgb;
use crate::math::{Vec3, Vec4};

/// Which of an element's properties are its colour.
pub(super) struct Color {
    rgb: [(usize, Scalar); 3],
    alpha: Option<(usize, Scalar)>,
}

impl Color {
    /// None unless red, green and blue are there.
    pub(super) fn of(element: &Element) -> Option<Self> {
        let rgb = [["red", "r", "diffuse_red"], ["green", "g", "diffuse_green"], ["blue", "b", "diffuse_blue"]];
        let typed = |index: usize| (index, element.properties[index].scalar);
        Some(Self {
            rgb: all(rgb.map(|names| element.index(&names)))?.map(typed),
            alpha: element.index(&["alpha", "a", "diffuse_alpha"]).map(typed),
        })
    }

    /// Whether every channel is a byte.
    pub(super) fn is_bytes(&self) -> bool {
        self.rgb.iter().chain(&self.alpha).all(|(_, scalar)| *scalar == Scalar::U8)
    }

    /// All channels in one word, of a colour of bytes; by a function that gives the values of properties by their
    /// index.
    #[inline]
    pub(super) fn packed(&self, value: impl Fn(usize) -> f64) -> u32 {
        let [r, g, b] = self.rgb.map(|(index, _)| value(index) as u8);
        u32::from_le_bytes([r, g, b, self.alpha.map_or(u8::MAX, |(index, _)| value(index) as u8)])
    }

    /// The colour that a word holds, linear.
    pub(super) fn unpacked(word: u32) -> Vec4 {
        let [r, g, b, a] = word.to_le_bytes();
        Vec3::from([r, g, b].map(srgb::srgb_to_linear)).extend(f32::from(a) / 255.0)
    }

    /// Linear, with alpha, by a function that gives the values of properties by their index.
    pub(super) fn linear(&self, value: impl Fn(usize) -> f64) -> Vec4 {
        let alpha = self.alpha.map_or(1.0, |(index, scalar)| value(index) / scalar.full());
        Vec3::from(self.rgb.map(|(index, scalar)| channel(scalar, value(index)))).extend(alpha.clamp(0.0, 1.0) as f32)
    }
}

/// A colour channel as linear light: whole numbers are sRGB-encoded, floats linear already.
fn channel(scalar: Scalar, value: f64) -> f32 {
    match scalar {
        Scalar::U8 => srgb::srgb_to_linear(value as u8),
        Scalar::F32 | Scalar::F64 => (value / scalar.full()).max(0.0) as f32,
        _ => srgb::decode((value / scalar.full()).clamp(0.0, 1.0)) as f32,
    }
}
