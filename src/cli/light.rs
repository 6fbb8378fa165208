//! Light in place of a scene's own.

use std::path::PathBuf;

use clap::Args;

use super::common::parse_vector;
use crate::error::Result;
use crate::image;
use crate::math::{DVec3, Vec3};
use crate::scene::{Environment, Light, Scene};

#[derive(Clone, Debug, Default, Args)]
pub(super) struct LightArgs {
    /// Light with hard shadows that comes from this direction, in place of the scene's lights
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_direction, allow_hyphen_values = true)]
    sun: Option<DVec3>,

    /// Picture of all that is around the scene, equirectangular: light, and what is seen behind everything, in place of
    /// the scene's
    #[arg(long, value_name = "FILE")]
    pub(super) environment: Option<PathBuf>,
}

impl LightArgs {
    /// Puts what is asked for into the scene.
    ///
    /// # Errors
    /// Those of a picture that cannot be read.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some(sun) = self.sun {
            scene.lights = vec![Light::Directional { direction: -sun, color: Vec3::ONE }];
        }
        if let Some(path) = &self.environment {
            scene.environment = Some(Environment::new(image::read_whole(path)?));
        }
        Ok(())
    }
}

/// As a unit vector.
fn parse_direction(text: &str) -> std::result::Result<DVec3, String> {
    let direction = parse_vector(text)?.try_normalize();
    direction.ok_or_else(|| "expected a direction, which is not zero".to_owned())
}
