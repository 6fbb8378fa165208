//! Light from infinitely far, all around, sampled where it is bright.
//!
//! Directions are chosen by a pdf that is constant within each pixel: rows by how bright they are, then a pixel of the
//! row (Pharr, Jakob and Humphreys 2016, *Physically Based Rendering* 14.2.4). The picture is interpolated between
//! pixels, so a pixel counts by the mean of the interpolation over it: then nothing bright has a pdf of 0, but for what
//! is below 2^-24 of its row.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use super::light::LightSample;
use crate::image::Image;
use crate::math::{DVec2, DVec3, Vec3};
use crate::scene::Environment;

/// An environment with the pdf of its light.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    image: Arc<Image>,
    intensity: f32,
    /// Sine and cosine of the rotation.
    turn: [f64; 2],
    /// Shares of the light up to each row, from 0 to 1.
    rows: Vec<f64>,
    /// For each row, the shares up to each of its pixels, from 0 to 1; `width + 1` of them.
    columns: Vec<f32>,
}

impl EnvironmentLight {
    /// Counts the light of each pixel.
    ///
    /// # Panics
    /// When it is asked for anything, where the picture has no pixels.
    pub fn new(environment: &Environment) -> Self {
        let Environment { image, intensity, rotation } = environment;
        let (width, height) = (image.width as usize, image.height as usize);
        let mut light = Self {
            image: Arc::clone(image),
            intensity: *intensity,
            turn: [libm::sin(*rotation), libm::cos(*rotation)],
            rows: vec![0.0],
            columns: Vec::with_capacity(height * (width + 1)),
        };
        for y in 0..height {
            let mut sums = vec![0.0];
            for x in 0..width {
                sums.push(sums[x] + f64::from(light.mean(x as i64, y as i64)));
            }
            let row = sums[width];
            // The area of a pixel shrinks with the circle of its latitude.
            let around = libm::sin((y as f64 + 0.5) / height as f64 * PI);
            light.rows.push(light.rows[y] + row * around);
            light.columns.extend(sums.iter().map(|sum| (sum / row.max(f64::MIN_POSITIVE)) as f32));
        }
        let all = light.rows[height].max(f64::MIN_POSITIVE);
        light.rows.iter_mut().for_each(|sum| *sum /= all);
        light
    }

    /// Linear RGB that is seen along `direction` (any length).
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let at = self.pixel(direction) - 0.5;
        let (left, top) = (at.x.floor(), at.y.floor());
        let (right, low) = ((at.x - left) as f32, (at.y - top) as f32);
        let row = |y: i64| {
            let (a, b) = (self.texel(left as i64, y), self.texel(left as i64 + 1, y));
            a * (1.0 - right) + b * right
        };
        (row(top as i64) * (1.0 - low) + row(top as i64 + 1) * low) * self.intensity
    }

    /// Light from a direction that `xi` chooses.
    pub(super) fn sample(&self, xi: DVec2) -> Option<LightSample> {
        let (y, down) = choose(self.rows.len(), |i| self.rows[i], xi.y);
        let row = self.row(y);
        let (x, right) = choose(row.len(), |i| f64::from(row[i]), xi.x);
        let size = DVec2::new(f64::from(self.image.width), f64::from(self.image.height));
        let to_light = self.direction(DVec2::new(x as f64 + right, y as f64 + down) / size);
        let pdf = self.pdf(to_light)?;
        let color = self.radiance(to_light) * (1.0 / (PI * pdf)) as f32;
        Some(LightSample { to_light, color, end: None, pdf: Some(pdf) })
    }

    /// How densely a direction is chosen, per steradian; none where it never is.
    pub fn pdf(&self, direction: DVec3) -> Option<f64> {
        let (width, height) = (f64::from(self.image.width), f64::from(self.image.height));
        let at = self.pixel(direction);
        let (x, y) = ((at.x.max(0.0) as usize).min(width as usize - 1), (at.y as usize).min(height as usize - 1));
        let row = self.row(y);
        let share = (self.rows[y + 1] - self.rows[y]) * f64::from(row[x + 1] - row[x]);
        let around = libm::sin(at.y / height * PI);
        let pdf = share * width * height / (TAU * PI * around);
        (pdf > 0.0 && pdf.is_finite()).then_some(pdf)
    }

    fn row(&self, y: usize) -> &[f32] {
        let length = self.image.width as usize + 1;
        &self.columns[y * length..(y + 1) * length]
    }

    /// Where in the picture a direction is, in pixels from its top left corner.
    fn pixel(&self, direction: DVec3) -> DVec2 {
        let [sine, cosine] = self.turn;
        let d = direction.normalize();
        let (x, z) = (d.x * cosine - d.z * sine, d.x * sine + d.z * cosine);
        let across = libm::atan2(x, -z) / TAU + 0.5;
        let down = 0.5 - libm::asin(d.y.clamp(-1.0, 1.0)) / PI;
        DVec2::new(across * f64::from(self.image.width), down * f64::from(self.image.height))
    }

    /// The direction of a point of the picture, in shares of its sides.
    fn direction(&self, at: DVec2) -> DVec3 {
        let (longitude, latitude) = ((at.x - 0.5) * TAU, (0.5 - at.y) * PI);
        let around = libm::cos(latitude);
        let (x, z) = (libm::sin(longitude) * around, -libm::cos(longitude) * around);
        let [sine, cosine] = self.turn;
        DVec3::new(x * cosine + z * sine, libm::sin(latitude), z * cosine - x * sine)
    }

    fn texel(&self, x: i64, y: i64) -> Vec3 {
        let (width, height) = (i64::from(self.image.width), i64::from(self.image.height));
        let index = y.clamp(0, height - 1) * width + x.rem_euclid(width);
        let color = self.image.pixels[index as usize].truncate();
        if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO }
    }

    /// The mean of the interpolated picture over a pixel, of its brightest channel at most.
    fn mean(&self, x: i64, y: i64) -> f32 {
        let weights = [0.125, 0.75, 0.125];
        let cells = (0..3).flat_map(|j| (0..3).map(move |i| (i, j)));
        cells
            .map(|(i, j)| self.texel(x + i - 1, y + j - 1).max_element() * weights[i as usize] * weights[j as usize])
            .sum()
    }
}

/// The step of rising shares, from 0 to 1, that holds `at`, and where in it.
fn choose(length: usize, share: impl Fn(usize) -> f64, at: f64) -> (usize, f64) {
    let (mut low, mut high) = (0, length - 1);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if share(middle) <= at { low = middle } else { high = middle }
    }
    let (from, to) = (share(low), share(low + 1));
    (low, if to > from { ((at - from) / (to - from)).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(pixel: impl Fn(u32, u32) -> Vec3, rotation: f64) -> EnvironmentLight {
        let (width, height) = (64, 32);
        let pixels = (0..width * height).map(|i| pixel(i % width, i / width).extend(1.0)).collect();
        let image = Image { width, height, pixels };
        EnvironmentLight::new(&Environment { rotation, ..Environment::new(image) })
    }

    fn sun(x: u32, y: u32) -> Vec3 {
        if (x, y) == (40, 7) { Vec3::splat(5000.0) } else { Vec3::new(0.5, 1.0, 0.25) * (y as f32 + 1.0) / 32.0 }
    }

    #[test]
    fn the_picture_is_that_of_an_equirectangular_camera() {
        let colors = |x: u32, y: u32| Vec3::new(x as f32, y as f32, 0.0);
        let middle = light(colors, 0.0).radiance(DVec3::NEG_Z);
        assert!((middle - Vec3::new(31.5, 15.5, 0.0)).length() < 1e-5, "{middle}");
        let right = light(colors, 0.0).radiance(DVec3::X);
        assert!((right - Vec3::new(47.5, 15.5, 0.0)).length() < 1e-5, "a quarter to the right: {right}");
        assert!(light(colors, 0.0).radiance(DVec3::Y).y < 1.0, "the first row is up");
        // Turned a quarter counter-clockwise from above, what was at -z is at -x.
        let turned = light(colors, PI / 2.0).radiance(DVec3::NEG_X);
        assert!((turned - middle).length() < 1e-4, "{turned}");
    }

    #[test]
    fn directions_have_their_pdf_and_give_the_whole_light() {
        let light = light(sun, 1.0);
        let side = 400;
        let xi = |k: i32| (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
        let (mut irradiance, mut area) = (0.0, 0.0);
        for k in 0..side * side {
            let arriving = light.sample(xi(k)).unwrap();
            let pdf = arriving.pdf.unwrap();
            assert!((light.pdf(arriving.to_light).unwrap() / pdf - 1.0).abs() < 1e-12);
            irradiance += f64::from(arriving.color.y) * PI;
            area += 1.0 / pdf;
        }
        let n = f64::from(side * side);
        // Against sums over the sphere, step by step; of the constant 1, its area.
        let (steps, mut expected) = (2000, 0.0);
        for j in 0..steps {
            let latitude = ((f64::from(j) + 0.5) / f64::from(steps) - 0.5) * PI;
            for i in 0..steps {
                let longitude = (f64::from(i) + 0.5) / f64::from(steps) * TAU;
                let d = DVec3::new(longitude.sin() * latitude.cos(), latitude.sin(), longitude.cos() * latitude.cos());
                expected += f64::from(light.radiance(d).y) * latitude.cos();
            }
        }
        expected *= TAU * PI / f64::from(steps * steps);
        assert!((irradiance / n / expected - 1.0).abs() < 0.01, "{} {expected}", irradiance / n);
        assert!((area / n / (2.0 * TAU) - 1.0).abs() < 0.05, "{}", area / n);
    }

    #[test]
    fn black_is_black() {
        let black = light(|_, _| Vec3::ZERO, 0.0);
        assert_eq!(black.pdf(DVec3::Y), None);
    }
}
