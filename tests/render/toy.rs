//! A tracer that owes nothing to those under test: every primitive for every ray, in f64.

use twincast::math::{DAffine3, DVec3};
use twincast::trace::{Part, Placement, Primitives};
use twincast::{Hit, Ray, Tracer, World};

/// Every primitive for every ray.
pub struct Toy<'a>(pub &'a World);

impl Tracer for Toy<'_> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<(f64, Hit)> = None;
        self.each_part(|part, placement| {
            let instance = placement.map_or(part.instance, |p| p.instance);
            let local = Local::new(ray, placement);
            for primitive in 0..part.primitives.len() {
                let Some(t) = local.meet(part, primitive) else { continue };
                let hit =
                    Hit { t: t as f32, u: 0.0, v: 0.0, primitive: primitive as u32, geometry: part.geometry, instance };
                if best.is_none_or(|(nearest, other)| (t, hit.id()) < (nearest, other.id())) {
                    best = Some((t, hit));
                }
            }
        });
        best.map(|(_, hit)| hit)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}

impl Toy<'_> {
    fn each_part(&self, mut visit: impl FnMut(&Part, Option<&Placement>)) {
        let world = self.0;
        world.parts[world.fixed.clone()].iter().for_each(|part| visit(part, None));
        for placement in &world.placements {
            let parts = &world.parts[world.objects[placement.object as usize].clone()];
            parts.iter().for_each(|part| visit(part, Some(placement)));
        }
    }
}

/// A ray as an object sees it.
struct Local<'a> {
    ray: &'a Ray,
    origin: DVec3,
    direction: DVec3,
}

impl<'a> Local<'a> {
    fn new(ray: &'a Ray, placement: Option<&Placement>) -> Self {
        let to_object = placement.map_or(DAffine3::IDENTITY, |p| p.at(ray.time).to_object);
        let origin = to_object.transform_point3(ray.origin.as_dvec3());
        Self { ray, origin, direction: to_object.transform_vector3(ray.direction.as_dvec3()) }
    }

    fn meet(&self, part: &Part, primitive: usize) -> Option<f64> {
        match &part.primitives {
            Primitives::Triangles { positions, triangles } => {
                let [a, b, c] = triangles[primitive];
                let from_origin = |corner: u32| positions[corner as usize].as_dvec3() - self.origin;
                let t = triangle(self.direction, from_origin(a), from_origin(b), from_origin(c))?;
                (t >= f64::from(self.ray.tmin) && t <= f64::from(self.ray.tmax)).then_some(t)
            }
            Primitives::Shapes(shapes) => {
                let local = Ray { origin: self.origin.as_vec3(), direction: self.direction.as_vec3(), ..*self.ray };
                shapes[primitive].intersect(&local).map(|hit| hit.t)
            }
        }
    }
}

/// By areas: the three signed volumes that the ray spans with the edges. Corners are as seen from its origin. Without
/// arrays that are mapped: the closures were called, and took half of the time of all tests of pictures.
fn triangle(direction: DVec3, a: DVec3, b: DVec3, c: DVec3) -> Option<f64> {
    let (of_a, of_b, of_c) = (direction.dot(c.cross(b)), direction.dot(a.cross(c)), direction.dot(b.cross(a)));
    let inside = (of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0) || (of_a <= 0.0 && of_b <= 0.0 && of_c <= 0.0);
    let sum = of_a + of_b + of_c;
    if !inside || sum == 0.0 {
        return None;
    }
    let point = (a * of_a + b * of_b + c * of_c) / sum;
    Some(point.dot(direction) / direction.length_squared())
}
