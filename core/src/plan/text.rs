//! A plan in words: one line.

use std::fmt;

use super::{Levels, Lighting, Plan};
use crate::scene::Integrator;

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let levels = match self.levels {
            Levels::One => "one level",
            Levels::Two => "two levels (instances)",
        };
        let lights = match &self.lighting {
            Lighting::None => "no light".to_owned(),
            Lighting::Lights(lights) if lights.is_empty() && self.integrator == Integrator::Path => {
                "light of what glows".to_owned()
            }
            Lighting::Lights(lights) if lights.is_empty() => "no light".to_owned(),
            Lighting::Headlight => "a headlight without shadows".to_owned(),
            Lighting::Lights(lights) if lights.len() == 1 => "1 light with shadows".to_owned(),
            Lighting::Lights(lights) => format!("{} lights with shadows", lights.len()),
        };
        write!(f, "{} ({}): {} primitives on {levels}, {lights}", self.integrator, self.why, self.primitives)?;
        for part in self.parts() {
            write!(f, ", {part}")?;
        }
        if self.idle_emitters {
            write!(f, ", what glows lights nothing else (that takes paths)")?;
        }
        if self.depth > 0 {
            match self.integrator {
                Integrator::RayCast | Integrator::Whitted => {
                    write!(f, ", mirrored and refracted rays to depth {}", self.depth)?;
                }
                Integrator::Path => write!(f, ", paths scattered up to {} times", self.depth)?,
            }
        }
        write!(f, ", {} {}", self.materials, if self.materials == 1 { "material" } else { "materials" })
    }
}
