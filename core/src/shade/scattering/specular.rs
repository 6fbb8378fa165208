//! Where light goes on from a surface: mirrored and refracted, and how it is divided between the two.
//!
//! With [`Interface::Shares`] the material says how (Whitted 1980, *An improved illumination model for shaded
//! display*): under total internal reflection the refracted share is black, as in Whitted's paper; nothing is moved to
//! the mirrored share, for the two are the material's to choose. With the other two, Fresnel's equations say it, and
//! what cannot be refracted is mirrored.

use super::fresnel;
use crate::math::{DVec3, Vec3};
use crate::scene::{Interface, Material};
use crate::shade::SurfacePoint;

/// One way on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularDirection {
    /// Unit vector away from the surface.
    pub direction: DVec3,
    /// Of the light that arrives from there, what goes to the viewer.
    pub share: Vec3,
    /// Radiance grows by this, the square of the relative index of refraction, where it enters what is seen; 1
    /// otherwise, and for materials that choose their shares.
    pub scale: f32,
}

/// Both ways on from a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpecularDirections {
    /// On the viewer's side.
    pub mirrored: Option<SpecularDirection>,
    /// Behind the surface.
    pub refracted: Option<SpecularDirection>,
}

impl SpecularDirections {
    /// Those of light that is seen along `direction` (unit length).
    pub fn new(material: &Material, point: &SurfacePoint, direction: DVec3) -> Self {
        if !material.sends_on() {
            return Self::default();
        }
        let mirrored = mirrored_share(material, point, direction);
        let ior = f64::from(material.ior);
        let whole = if material.energy_conserving { material.conserving_scale() } else { 1.0 };
        let (reflected_share, transmitted_share, scale) = match material.interface {
            Interface::Shares => (material.reflection * whole, material.transmission * whole, 1.0),
            Interface::Fresnel | Interface::Thin => {
                let eta = if point.front { 1.0 / ior } else { ior };
                let scale = if material.interface == Interface::Fresnel { eta * eta } else { 1.0 };
                let through = material.transmission * (whole * (1.0 - mirrored) as f32);
                (material.reflection * mirrored as f32, through, scale as f32)
            }
        };
        let refraction = || match material.interface {
            Interface::Shares | Interface::Fresnel => refracted(direction, point, ior),
            Interface::Thin => Some(direction),
        };
        let way = |share: Vec3, direction: &dyn Fn() -> Option<DVec3>, scale| {
            if share == Vec3::ZERO {
                return None;
            }
            direction().map(|direction| SpecularDirection { direction, share, scale })
        };
        Self {
            mirrored: way(reflected_share, &|| Some(reflected(direction, point)), 1.0),
            refracted: way(transmitted_share, &refraction, scale),
        }
    }
}

/// What share of light the interface mirrors to who looks along `direction`; 0 where the material chooses.
pub(super) fn mirrored_share(material: &Material, point: &SurfacePoint, direction: DVec3) -> f64 {
    let cosine = -direction.dot(point.shading_normal);
    // A shading normal that leans away from the viewer has no angle that could be meant.
    let cosine = if cosine > 0.0 { cosine } else { -direction.dot(point.normal) };
    let ior = f64::from(material.ior);
    match material.interface {
        Interface::Shares => 0.0,
        Interface::Fresnel => fresnel::reflectance(cosine, if point.front { ior } else { 1.0 / ior }),
        Interface::Thin => fresnel::pane_reflectance(cosine, ior),
    }
}

/// The mirror image of `direction` (unit length) at `point`; never into the surface.
fn reflected(direction: DVec3, point: &SurfacePoint) -> DVec3 {
    let mirrored = mirror(direction, point.shading_normal);
    // A shading normal that leans away from the viewer would send the ray into the surface.
    if mirrored.dot(point.horizon) > 0.0 { mirrored } else { mirror(direction, point.horizon) }
}

/// Where `direction` (unit length) goes behind `point` by Snell's law, `ior` being the index of the inside relative to
/// the outside. None under total internal reflection.
fn refracted(direction: DVec3, point: &SurfacePoint, ior: f64) -> Option<DVec3> {
    // The normal is on the viewer's side, so what the ray enters is the inside where the front is seen.
    let eta = if point.front { 1.0 / ior } else { ior };
    let bent = bend(direction, point.shading_normal, eta)?;
    if bent.dot(point.horizon) < 0.0 { Some(bent) } else { bend(direction, point.horizon, eta) }
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
            lift: DVec3::ZERO,
            horizon: DVec3::Y,
            front,
            uv: Vec2::ZERO,
            second_uv: Vec2::ZERO,
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
