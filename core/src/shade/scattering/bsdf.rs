//! All lobes of a surface together, for integrators that follow one of them at random.
//!
//! A lobe is chosen by about how much light it sends on, a direction by the lobe's own pdf; the pdf of the result is
//! the sum over all lobes, so that directions that several lobes can give are not noisier than others (Veach and Guibas
//! 1995, *Optimally combining sampling techniques for Monte Carlo rendering*: the balance heuristic).

use std::f64::consts::PI;

use super::{Shading, SpecularDirection, SpecularDirections, warp};
use crate::math::{DVec2, DVec3, Vec3};

/// What of the light from a direction goes to the viewer, and how likely that direction is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfValue {
    /// pi f cos, linear RGB.
    pub share: Vec3,
    /// Of [`Bsdf::sample`], per steradian.
    pub pdf: f64,
}

/// Where a path goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit vector away from the surface.
    pub direction: DVec3,
    /// f cos over the pdf: what the radiance from there is multiplied by.
    pub weight: Vec3,
    /// Per steradian; none for a direction that no other could have been.
    pub pdf: Option<f64>,
    /// See [`SpecularDirection::scale`].
    pub scale: f32,
}

/// A surface with everything it does with light.
pub struct Bsdf<'a> {
    shading: &'a Shading,
    ways: SpecularDirections,
    gloss: Option<f64>,
    /// How likely each is chosen: Lambert's, the highlight, mirrored, refracted. They sum up to 1.
    chances: [f64; 4],
}

impl<'a> Bsdf<'a> {
    /// None where nothing is sent on.
    pub fn new(shading: &'a Shading, ways: SpecularDirections, gloss: Option<f32>) -> Option<Self> {
        let share = |way: &Option<SpecularDirection>| way.map_or(0.0, |way| way.share.max_element());
        let albedo =
            [shading.diffuse.max_element(), shading.highlight.albedo(), share(&ways.mirrored), share(&ways.refracted)];
        let sum: f32 = albedo.iter().sum();
        let chances = albedo.map(|albedo| f64::from(albedo) / f64::from(sum));
        (sum > 0.0).then_some(Self { shading, ways, gloss: gloss.map(f64::from), chances })
    }

    /// Whether any direction at all has a value; else only exact ways lead on.
    pub fn has_values(&self) -> bool {
        self.chances[0] + self.chances[1] > 0.0 || self.gloss.is_some()
    }

    /// Whether light from below has a value.
    pub fn go_through(&self) -> bool {
        self.gloss.is_some() && self.ways.refracted.is_some()
    }

    /// Whether there are several, of which [`Bsdf::sample`] follows one.
    pub fn is_choice(&self) -> bool {
        self.chances.iter().filter(|&&chance| chance > 0.0).count() > 1
    }

    /// For light along `to_light`. A light that cannot be seen is seen in no mirror either, however blunt: highlights
    /// alone show it, and its pdf is that of directions among them.
    pub fn eval(&self, to_light: DVec3, can_be_seen: bool) -> BsdfValue {
        let Shading { normal, horizon, to_viewer, highlight, .. } = self.shading;
        let [diffuse, shiny, mirrored, refracted] = self.chances;
        let mut value = BsdfValue { share: Vec3::ZERO, pdf: 0.0 };
        let front = self.shading.faces(to_light);
        if front {
            value.share = self.shading.value(to_light);
            value.pdf = diffuse * warp::cosine_pdf(normal.dot(to_light));
            if shiny > 0.0 {
                value.pdf += shiny * highlight.pdf(*normal, *to_viewer, to_light);
            }
        }
        let Some(gloss) = self.gloss.filter(|_| can_be_seen) else { return value };
        let behind = normal.dot(to_light) < 0.0 && horizon.dot(to_light) < 0.0;
        for (way, chance, on_its_side) in
            [(&self.ways.mirrored, mirrored, front), (&self.ways.refracted, refracted, behind)]
        {
            if let (Some(way), true) = (way, on_its_side) {
                let pdf = warp::power_pdf(way.direction.dot(to_light), gloss);
                value.share += way.share * (way.scale * (PI * pdf) as f32);
                value.pdf += chance * pdf;
            }
        }
        value
    }

    /// The share of [`Bsdf::eval`] by what it is: diffuse, reflected, transmitted.
    pub fn parts(&self, to_light: DVec3, can_be_seen: bool) -> [Vec3; 3] {
        let whole = self.eval(to_light, can_be_seen).share;
        if !self.shading.faces(to_light) {
            return [Vec3::ZERO, Vec3::ZERO, whole];
        }
        let diffuse = self.shading.lobes(to_light)[0];
        // A way through is behind the surface, where nothing else is.
        [diffuse, (whole - diffuse).max(Vec3::ZERO), Vec3::ZERO]
    }

    /// A direction to go on in: `choice` (from 0 to below 1) chooses the lobe, `xi` (in the unit square) the
    /// direction. None where that leads nowhere.
    pub fn sample(&self, choice: f64, xi: DVec2) -> Option<BsdfSample> {
        let Shading { normal, to_viewer, highlight, .. } = self.shading;
        let mut rest = choice;
        let last = self.chances.iter().rposition(|&chance| chance > 0.0)?;
        let lobe = self.chances.iter().position(|&chance| {
            rest -= chance;
            rest < 0.0
        });
        let lobe = lobe.map_or(last, |lobe| lobe.min(last));
        let (direction, scale) = match lobe {
            0 => (warp::cosine(*normal, xi), 1.0),
            1 => (highlight.sample(*normal, *to_viewer, xi), 1.0),
            _ => {
                let way = if lobe == 2 { self.ways.mirrored? } else { self.ways.refracted? };
                let Some(gloss) = self.gloss else {
                    let weight = way.share * (way.scale / self.chances[lobe] as f32);
                    return Some(BsdfSample { direction: way.direction, weight, pdf: None, scale: way.scale });
                };
                (warp::power(way.direction, gloss, xi), way.scale)
            }
        };
        let BsdfValue { share, pdf } = self.eval(direction, true);
        if pdf <= 0.0 || share == Vec3::ZERO {
            return None;
        }
        let weight = share * (1.0 / (PI * pdf)) as f32;
        Some(BsdfSample { direction, weight, pdf: Some(pdf), scale })
    }
}

impl SpecularDirection {
    /// A direction near this one, spread by `gloss` as `xi` chooses; none where it would be on the other side of the
    /// surface. The share stays: all that is lost is what goes there.
    pub fn spread(&self, gloss: f32, xi: DVec2, shading: &Shading) -> Option<DVec3> {
        let side = |direction: DVec3| (shading.normal.dot(direction), shading.horizon.dot(direction));
        let spread = warp::power(self.direction, f64::from(gloss), xi);
        let crosses = shading.horizon.dot(self.direction) < 0.0;
        let (a, b) = side(spread);
        let stays = if crosses { a < 0.0 && b < 0.0 } else { a > 0.0 && b > 0.0 };
        stays.then_some(spread)
    }
}
