//! The highlights of Phong (1975, *Illumination for computer generated pictures*) and Blinn (1977, *Models of light
//! reflection for computer synthesized pictures*), classic and energy-conserving.
//!
//! The classic highlight is ks cos^n: no cosine of the light, and no scale, so that wide ones send on more than they
//! get. The energy-conserving one is pi f cos with f scaled so that straight on exactly ks is sent on, and nowhere
//! more: (n + 2) / (2 pi) for Phong's (Lafortune and Willems 1994), (n + 2) (n + 4) / (8 pi (2^(-n/2) + n)) for Blinn's
//! (Giesen 2009, *Derivation of the Phong and Blinn-Phong normalization factors*).

use super::warp;
use crate::math::{DVec2, DVec3, Vec3};
use crate::scene::{Material, Specular};

/// The highest exponent for which f32 gives a power to a thousandth.
const MAX_IN_F32: f32 = 1e4;

/// The highlight of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Highlight {
    pub(super) color: Vec3,
    shininess: f32,
    model: Specular,
    /// Of an energy-conserving one, pi times the factor of f; none for the classic.
    scale: Option<f32>,
}

impl Highlight {
    pub(super) fn new(material: &Material) -> Self {
        let Material { specular: color, model, .. } = *material;
        Self { color, shininess: material.exponent(), model, scale: material.highlight_scale() }
    }

    /// pi f cos, for light at `cosine` to the normal.
    pub(super) fn value(&self, normal: DVec3, to_viewer: DVec3, l: DVec3, cosine: f64) -> Vec3 {
        let base = match self.model {
            Specular::Phong => (normal * (2.0 * cosine) - l).dot(to_viewer),
            Specular::BlinnPhong => (l + to_viewer).normalize_or_zero().dot(normal),
        };
        let base = base.clamp(0.0, 1.0);
        // In f32 the base's rounding would count: it is raised with it.
        let height = if self.shininess <= MAX_IN_F32 {
            libm::powf(base as f32, self.shininess)
        } else {
            libm::pow(base, self.shininess.into()) as f32
        };
        self.color * self.scale.map_or(height, |scale| scale * height * cosine as f32)
    }

    /// How much of even light it sends on where it is met head-on, in units of its colour; nowhere more.
    pub(super) fn share(&self) -> f32 {
        let n = self.shininess;
        match (self.scale, self.model) {
            (Some(_), _) => 1.0,
            // The integrals of cos^n over the hemisphere, over pi: of the angle to the normal, and of half of it.
            (None, Specular::Phong) => 2.0 / (n + 1.0),
            (None, Specular::BlinnPhong) => 8.0 / (n + 2.0) * (1.0 - libm::exp2f(-(n + 2.0) / 2.0)),
        }
    }

    /// About how much of all light it sends on: what samples are divided by.
    pub(super) fn albedo(&self) -> f32 {
        let share = match (self.scale, self.model) {
            (Some(_), _) => 1.0,
            (None, Specular::Phong) => 2.0 / (self.shininess + 1.0),
            (None, Specular::BlinnPhong) => (8.0 / (self.shininess + 1.0)).min(2.0),
        };
        self.color.max_element() * share
    }

    /// A direction that is likely where the highlight is high; may lie below the surface.
    pub(super) fn sample(&self, normal: DVec3, to_viewer: DVec3, xi: DVec2) -> DVec3 {
        let n = f64::from(self.shininess);
        match self.model {
            Specular::Phong => warp::power(normal * (2.0 * normal.dot(to_viewer)) - to_viewer, n, xi),
            Specular::BlinnPhong => {
                let half = warp::power(normal, n, xi);
                half * (2.0 * half.dot(to_viewer)) - to_viewer
            }
        }
    }

    /// The pdf of [`Highlight::sample`].
    pub(super) fn pdf(&self, normal: DVec3, to_viewer: DVec3, l: DVec3) -> f64 {
        let n = f64::from(self.shininess);
        match self.model {
            Specular::Phong => warp::power_pdf((normal * (2.0 * normal.dot(l)) - l).dot(to_viewer), n),
            Specular::BlinnPhong => {
                let half = (l + to_viewer).normalize_or_zero();
                let cosine = half.dot(to_viewer);
                if cosine > 0.0 { warp::power_pdf(half.dot(normal), n) / (4.0 * cosine) } else { 0.0 }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However sharp, an energy-conserving highlight sends on its colour where the viewer looks straight at it, and
    /// nowhere more: the mean of what samples are worth, in a white surround.
    #[test]
    fn sharp_highlights_make_no_energy() {
        const SIDE: i32 = 64;
        let normal = DVec3::new(0.3, 0.9, -0.2).normalize();
        let aslant = (normal + DVec3::new(0.5, 0.0, 0.3)).normalize();
        for model in [Specular::Phong, Specular::BlinnPhong] {
            for shininess in [1e2, 1e4, 1.1e4, 1e6, 1e8, 1e10, 3e38] {
                let material =
                    Material { specular: Vec3::ONE, shininess, model, energy_conserving: true, ..Material::default() };
                let highlight = Highlight::new(&material);
                let sent_on = |to_viewer: DVec3| {
                    let xi = (0..SIDE * SIDE)
                        .map(|k| (DVec2::new((k % SIDE).into(), (k / SIDE).into()) + 0.5) / f64::from(SIDE));
                    let worth = xi.map(|xi| {
                        let l = highlight.sample(normal, to_viewer, xi);
                        let pdf = highlight.pdf(normal, to_viewer, l);
                        let value = f64::from(highlight.value(normal, to_viewer, l, l.dot(normal)).x);
                        if pdf > 0.0 { value / (pdf * std::f64::consts::PI) } else { 0.0 }
                    });
                    worth.sum::<f64>() / f64::from(SIDE * SIDE)
                };
                let straight = sent_on(normal);
                assert!((straight - 1.0).abs() < 5e-3, "{model:?} {shininess}: {straight}");
                let aslant = sent_on(aslant);
                assert!(aslant < 1.0 + 5e-3 && aslant > 0.5, "{model:?} {shininess}: {aslant}");
            }
        }
    }
}
