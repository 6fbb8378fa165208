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
            for primitive in 0..part.primitives.len() {
                let Some(t) = meet(ray, part, placement, primitive) else { continue };
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

fn meet(ray: &Ray, part: &Part, placement: Option<&Placement>, primitive: usize) -> Option<f64> {
    let to_object = placement.map_or(DAffine3::IDENTITY, |p| p.at(ray.time).to_object);
    let origin = to_object.transform_point3(ray.origin.as_dvec3());
    let direction = to_object.transform_vector3(ray.direction.as_dvec3());
    match &part.primitives {
        Primitives::Triangles { positions, triangles } => {
            let corners = triangles[primitive].map(|i| positions[i as usize].as_dvec3());
            let t = triangle(origin, direction, corners)?;
            (t >= f64::from(ray.tmin) && t <= f64::from(ray.tmax)).then_some(t)
        }
        Primitives::Shapes(shapes) => {
            let local = Ray { origin: origin.as_vec3(), direction: direction.as_vec3(), ..*ray };
            shapes[primitive].intersect(&local).map(|hit| hit.t)
        }
    }
}

/// By areas: the three signed volumes that the ray spans with the edges.
fn triangle(origin: DVec3, direction: DVec3, corners: [DVec3; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|p| p - origin);
    let volumes = [direction.dot(c.cross(b)), direction.dot(a.cross(c)), direction.dot(b.cross(a))];
    let inside = volumes.iter().all(|&v| v >= 0.0) || volumes.iter().all(|&v| v <= 0.0);
    let sum: f64 = volumes.iter().sum();
    if !inside || sum == 0.0 {
        return None;
    }
    let point = (a * volumes[0] + b * volumes[1] + c * volumes[2]) / sum;
    Some(point.dot(direction) / direction.length_squared())
}
