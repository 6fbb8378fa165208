//! All that lights a scene: its lights, what is around it and, for a path tracer, what glows.
//!
//! Whitted's recursion asks each of them. A path tracer asks one that is chosen by about how much it gives in the
//! middle of the scene; a share of the choices is even, for the lights that matter elsewhere. What a scattered ray
//! finds glowing by itself has a pdf in the light's terms as well, so that the two estimates can be weighed against
//! each other.

use std::sync::Arc;

use super::emitters::{self, Emitters, Glowing, Seat};
use super::light::LightSource;
use super::{EnvironmentLight, SurfacePoint, area};
use crate::math::{Aabb, DVec2, DVec3, Vec3};
use crate::ray::Hit;
use crate::scene::{Light, Scene};
use crate::trace::World;

/// The share of choices that is even.
const EVEN: f64 = 0.2;

/// The lights of a render, in world coordinates.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    sources: Vec<LightSource>,
    /// Sums of the chances to be chosen, up to 1; empty where none are chosen.
    cumulative: Vec<f64>,
    glowing: Glowing,
    /// The number of the light that the patches are, and all their areas times their brightness.
    patches: Option<(u32, f64)>,
    /// The number of the environment.
    environment: Option<u32>,
    /// Whether scattered rays may end on each of them.
    can_be_found: Vec<bool>,
}

/// One of the lights.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a> {
    /// Which.
    pub source: &'a LightSource,
    /// Its number among [`Lights::sources`].
    pub index: u32,
    /// How likely it was.
    pub chance: f64,
    /// Whether scattered rays may end on it.
    pub can_be_found: bool,
}

/// What the light that a scattered ray finds at its end counts for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Found {
    /// No light stands for it: all of it counts.
    Alone,
    /// A light that is also asked directly, and how densely, per steradian: a share of it counts.
    Shared {
        /// Linear RGB.
        radiance: Vec3,
        /// Of the direct question.
        pdf: f64,
    },
    /// The light alone decides.
    Dark,
}

impl Lights {
    /// Lights that are all asked.
    pub fn all(sources: Vec<LightSource>) -> Self {
        Self { sources, ..Self::default() }
    }

    /// Lights of which one is chosen, beside an environment and what glows.
    pub fn chosen(
        scene: &Scene,
        world: &World,
        mut sources: Vec<LightSource>,
        environment: Option<&Arc<EnvironmentLight>>,
    ) -> Self {
        let Emitters { patches, glowing, covered } = emitters::find(scene, world, &mut sources);
        let total = patches.total();
        let patches = (total > 0.0).then(|| {
            sources.push(LightSource::patches(patches));
            (sources.len() as u32 - 1, total)
        });
        let environment = environment.map(|environment| {
            sources.push(LightSource::environment(Arc::clone(environment)));
            sources.len() as u32 - 1
        });
        let cumulative = chances(&sources, &world.bounds());
        let mut can_be_found = vec![false; sources.len()];
        let bodies = glowing.values().flat_map(emitters::Seats::bodies).filter(|&light| covered[light as usize]);
        for index in bodies.chain(patches.map(|(index, _)| index)).chain(environment) {
            can_be_found[index as usize] = true;
        }
        Self { sources, cumulative, glowing, patches, environment, can_be_found }
    }

    /// Every one of them.
    pub fn sources(&self) -> &[LightSource] {
        &self.sources
    }

    /// Whether [`Lights::choose`] has any choice.
    pub fn is_choice(&self) -> bool {
        self.sources.len() > 1
    }

    /// The light that `choice`, from 0 to below 1, chooses.
    pub fn choose(&self, choice: f64) -> Option<Chosen<'_>> {
        let index = self.cumulative.partition_point(|&sum| sum <= choice).min(self.sources.len().checked_sub(1)?);
        let (source, chance) = (&self.sources[index], self.chance(index as u32));
        Some(Chosen { source, index: index as u32, chance, can_be_found: self.can_be_found[index] })
    }

    /// What it counts for that a scattered ray from `from` found `hit`, which is `point`, glowing with `emission`.
    pub fn found(&self, hit: &Hit, point: &SurfacePoint, from: DVec3, emission: Vec3) -> Found {
        let seat = self.glowing.get(&(hit.instance, hit.geometry)).map_or(Seat::Alone, |s| s.of(hit.primitive));
        match (seat, self.patches) {
            (Seat::Patch(brightness), Some((index, total))) => {
                let offset = point.position - from;
                let squared = offset.length_squared();
                let cosine = offset.normalize_or_zero().dot(point.normal).abs();
                // What is rounded may start on the very patch that it finds: nobody asks for that direction.
                let pdf = if squared > 0.0 { brightness / total * squared / cosine } else { 0.0 };
                Found::Shared { radiance: emission, pdf: pdf * self.chance(index) }
            }
            (Seat::Alone, _) | (Seat::Patch(_), None) => Found::Alone,
            // Where bodies cover a part of a light, it is asked for all that it gives.
            (Seat::Body(index), _) if !self.can_be_found[index as usize] => Found::Dark,
            (Seat::Body(index), _) => match self.sources[index as usize].light() {
                Some(Light::Area { shape, radiance }) => match area::pdf(shape, from, point.position) {
                    Some(pdf) => Found::Shared { radiance: *radiance, pdf: pdf * self.chance(index) },
                    None => Found::Dark,
                },
                Some(Light::Directional { .. } | Light::Point { .. } | Light::Spot { .. }) | None => Found::Dark,
            },
        }
    }

    /// How densely an environment is asked along `direction`; 0 where it never is.
    pub fn environment_pdf(&self, environment: &EnvironmentLight, direction: DVec3) -> f64 {
        let chance = self.environment.map_or(0.0, |index| self.chance(index));
        chance * environment.pdf(direction).unwrap_or(0.0)
    }

    fn chance(&self, index: u32) -> f64 {
        let index = index as usize;
        self.cumulative[index] - if index == 0 { 0.0 } else { self.cumulative[index - 1] }
    }
}

/// Whether a scene has surfaces that glow and are no bodies of its lights.
pub fn has_emitters(scene: &Scene, world: &World, sources: &[LightSource]) -> bool {
    emitters::any(scene, world, sources)
}

/// Sums of how likely each is chosen, by what arrives from it at the middle of the scene and of its eighths.
fn chances(sources: &[LightSource], bounds: &Aabb) -> Vec<f64> {
    let (centre, half) = (bounds.centre().as_dvec3(), bounds.size().max(Vec3::ZERO).as_dvec3() / 4.0);
    let places: Vec<DVec3> = (0..8)
        .map(|i| centre + half * DVec3::new([-1.0, 1.0][i & 1], [-1.0, 1.0][i >> 1 & 1], [-1.0, 1.0][i >> 2 & 1]))
        .chain([centre])
        .filter(|place| place.is_finite())
        .collect();
    let gives = |source: &LightSource, place: &DVec3| {
        let arriving = source.sample(*place, DVec2::splat(0.5)).map_or(0.0, |light| light.color.max_element());
        f64::from(if arriving.is_finite() { arriving } else { 0.0 })
    };
    let weights: Vec<f64> = sources.iter().map(|source| places.iter().map(|p| gives(source, p)).sum()).collect();
    let (sum, count) = (weights.iter().sum::<f64>(), sources.len() as f64);
    let mut total = 0.0;
    let mut cumulative: Vec<f64> = weights
        .iter()
        .map(|weight| {
            let share = if sum > 0.0 { (1.0 - EVEN) * weight / sum + EVEN / count } else { 1.0 / count };
            total += share;
            total
        })
        .collect();
    if let Some(last) = cumulative.last_mut() {
        *last = 1.0;
    }
    cumulative
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Material};
    use crate::shade::Attributes;
    use crate::trace::bvh::Bvh;
    use crate::{Cuboid, Tracer};

    /// A ray may start, rounded, on the surface that it finds: its share is a number.
    #[test]
    fn what_is_found_where_a_ray_starts_counts_in_full() {
        let glowing = Material { emission: Vec3::ONE, ..Material::default() };
        let lamp = Cuboid::new(Vec3::ZERO, Vec3::ONE).expect("a box");
        let shapes = Geometry::Shapes { shapes: vec![lamp.into()], material: 0 };
        let scene = Scene::from_geometries(vec![shapes], vec![glowing]);
        let world = World::new(&scene).expect("a scene");
        let lights = Lights::chosen(&scene, &world, Vec::new(), None);
        let ray = world.ray(DVec3::new(0.3, 0.4, 3.0), Vec3::NEG_Z);
        let hit = Bvh::build(&world).closest(&ray).expect("a hit");
        let point = SurfacePoint::new(&scene, &world, &ray, &hit, Attributes::ALL);
        let found = |from| lights.found(&hit, &point, from, Vec3::ONE);
        assert_eq!(found(point.position), Found::Shared { radiance: Vec3::ONE, pdf: 0.0 });
        // Two squared over a cosine of 1, and six square metres.
        let Found::Shared { pdf, .. } = found(point.position + DVec3::Z * 2.0) else { panic!("a patch") };
        assert!((pdf - 4.0 / 6.0).abs() < 1e-6, "{pdf}");
    }

    #[test]
    fn lights_are_chosen_by_what_they_give_and_none_is_forgotten() {
        let sun = |color| {
            let light = Light::Directional { direction: DVec3::NEG_Y, color: Vec3::splat(color) };
            LightSource::new(&light, DVec3::ZERO)
        };
        let sources = vec![sun(3.0), sun(1.0), sun(0.0)];
        let bounds = Aabb::around([Vec3::ZERO, Vec3::ONE]);
        let can_be_found = vec![false; 3];
        let lights = Lights { cumulative: chances(&sources, &bounds), can_be_found, ..Lights::all(sources) };
        let each: Vec<f64> = (0..3).map(|i| lights.chance(i)).collect();
        for (chance, expected) in each.iter().zip([0.6, 0.2, 0.0]) {
            assert!((chance - expected - EVEN / 3.0).abs() < 1e-12, "{each:?}");
        }
        let chosen = |choice| lights.choose(choice).unwrap().chance;
        assert_eq!((chosen(0.0), chosen(0.6667), chosen(0.999_999)), (each[0], each[1], each[2]));
        assert!(Lights::default().choose(0.5).is_none());
    }
}
