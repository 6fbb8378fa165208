//! Where light goes on from a surface: mirrored and refracted.
//!
//! T. Whitted (1980), *An improved illumination model for shaded display*: a surface adds shares of what the mirrored
//! and the refracted ray see to what lights give it. Under total internal reflection the refracted share is black, as
//! in Whitted's paper; nothing is moved to the mirrored share, for the two are the material's to choose.

use super::SurfacePoint;
use crate::math::DVec3;

/// The mirror image of `direction` (unit length) at `point`; never into the surface.
pub fn reflected(direction: DVec3, point: &SurfacePoint) -> DVec3 {
    let mirrored = mirror(direction, point.shading_normal);
    // A shading normal that leans away from the viewer would send the ray into the surface.
    if mirrored.dot(point.normal) > 0.0 { mirrored } else { mirror(direction, point.normal) }
}

/// Where `direction` (unit length) goes behind `point` by Snell's law, `ior` being the index of the inside relative to
/// the outside. None under total internal reflection.
pub fn refracted(direction: DVec3, point: &SurfacePoint, ior: f64) -> Option<DVec3> {
    // The normal is on the viewer's side, so what the ray enters is the inside where the front is seen.
    let eta = if point.front { 1.0 / ior } else { ior };
    let bent = bend(direction, point.shading_normal, eta)?;
    if bent.dot(point.normal) < 0.0 { Some(bent) } else { bend(direction, point.normal, eta) }
}

fn mirror(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - normal * (2.0 * direction.dot(normal))
}

fn bend(direction: DVec3, normal: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = -direction.dot(normal);
    let squared = 1.0 - eta * eta * (1.0 - cosine * cosine);
    (squared >= 0.0).then(|| direction * eta + normal * (eta * cosine - squared.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vec2, Vec4};

    fn point(shading_normal: DVec3, front: bool) -> SurfacePoint {
        SurfacePoint {
            t: 1.0,
            parameters: [0.0; 2],
            position: DVec3::ZERO,
            error: 0.0,
            normal: DVec3::Y,
            shading_normal,
            front,
            uv: Vec2::ZERO,
            color: Vec4::ONE,
            material: 0,
            time: 0.0,
        }
    }

    fn down(degrees: f64) -> DVec3 {
        DVec3::new(degrees.to_radians().sin(), -degrees.to_radians().cos(), 0.0)
    }

    #[test]
    fn angles_follow_the_laws() {
        for degrees in [0.0, 20.0, 45.0, 80.0] {
            let mirrored = reflected(down(degrees), &point(DVec3::Y, true));
            assert!((mirrored - down(degrees) * DVec3::new(1.0, -1.0, 1.0)).length() < 1e-15);
            let into = refracted(down(degrees), &point(DVec3::Y, true), 1.5).expect("into glass always");
            assert!((into.x - degrees.to_radians().sin() / 1.5).abs() < 1e-15 && into.y < 0.0, "Snell");
            assert!((into.length() - 1.0).abs() < 1e-15);
            let out = refracted(into, &point(DVec3::Y, false), 1.5).expect("the way back");
            assert!((out - down(degrees)).length() < 1e-14, "a pane leaves the direction as it was");
        }
        let critical = (1.0f64 / 1.5).asin().to_degrees();
        assert!(refracted(down(critical - 0.01), &point(DVec3::Y, false), 1.5).is_some());
        assert!(refracted(down(critical + 0.01), &point(DVec3::Y, false), 1.5).is_none());
        assert_eq!(
            refracted(down(30.0), &point(DVec3::Y, true), 1.0),
            Some(down(30.0)),
            "no bend without a difference"
        );
    }

    #[test]
    fn leaning_normals_never_send_a_ray_to_the_wrong_side() {
        for lean in [-80.0, -40.0, 40.0, 80.0f64] {
            let normal = DVec3::new(lean.to_radians().sin(), lean.to_radians().cos(), 0.0);
            for degrees in [-85.0, -30.0, 30.0, 85.0] {
                assert!(reflected(down(degrees), &point(normal, true)).y > 0.0);
                assert!(refracted(down(degrees), &point(normal, true), 1.5).is_none_or(|d| d.y < 0.0));
            }
        }
    }
}
