//! A plan as a document: what is in the scene, and what follows from it.

use std::fmt;

use serde::Serialize;

use super::{BuildChoice, Census, Levels, Lighting, Plan, Rays, Reduction};
use crate::shade::Attributes;

/// What a render would do, and why. Serialises as the document of `plan --json`.
#[derive(Clone, Debug, Serialize)]
pub struct PlanReport {
    /// The scene's name.
    pub scene: String,
    /// What is in it.
    pub census: Census,
    /// How it is searched.
    pub accelerator: &'static str,
    /// How the native tree is built.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub build: Option<Build>,
    /// Levels of tracing.
    pub levels: u32,
    /// How far light is followed.
    pub integrator: &'static str,
    /// Why that far.
    pub why: &'static str,
    /// As of [`Plan`].
    pub idle_emitters: bool,
    /// How often rays are sent on.
    pub depth: u32,
    /// Lights that are asked, the one that the viewer carries among them.
    pub lights: u64,
    /// Whether shadow rays are traced.
    pub shadows: bool,
    /// What is computed at each hit, and for each ray.
    pub parts: Vec<&'static str>,
    /// The rays to expect, if all hit.
    pub rays: Rays,
    /// What of the complete model is left out.
    pub left_out: Vec<LeftOut>,
    /// The plan in words.
    #[serde(skip)]
    pub words: String,
}

/// How the native tree is built.
#[derive(Clone, Debug, Serialize)]
pub struct Build {
    /// The preset.
    pub preset: &'static str,
    /// Why.
    pub why: String,
    /// Bytes that the process will hold at most, estimated.
    pub memory: u64,
}

/// A reduction.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LeftOut {
    /// Its name.
    pub name: &'static str,
    /// What is not done.
    pub what: &'static str,
}

impl PlanReport {
    /// Of a plan, what it left out, and how the scene is to be searched.
    pub fn new(
        scene: String,
        census: Census,
        plan: &Plan,
        left_out: &[Reduction],
        (accelerator, build): (&'static str, Option<&BuildChoice>),
        rays: Rays,
    ) -> Self {
        let lights = match &plan.lighting {
            Lighting::None => 0,
            Lighting::Headlight => 1,
            Lighting::Lights(lights) => lights.len() as u64,
        };
        let left_out = left_out.iter().map(|reduction| LeftOut { name: reduction.name(), what: reduction.words() });
        Self {
            scene,
            census,
            accelerator,
            build: build.map(|build| Build {
                preset: build.preset.name(),
                why: build.why.clone(),
                memory: build.memory,
            }),
            levels: match plan.levels {
                Levels::One => 1,
                Levels::Two => 2,
            },
            integrator: plan.integrator.name(),
            why: plan.why,
            idle_emitters: plan.idle_emitters,
            depth: plan.depth,
            lights,
            shadows: plan.shadows(),
            parts: plan.parts(),
            rays,
            left_out: left_out.collect(),
            words: plan.to_string(),
        }
    }
}

impl Plan {
    /// What is computed beyond hits and flat, matte light, in a word or two each.
    pub(super) fn parts(&self) -> Vec<&'static str> {
        let Attributes { normals, uvs, colors } = self.attributes;
        let parts = [
            (normals, "smooth normals"),
            (uvs, "textures"),
            (colors, "vertex colours"),
            (self.motion, "motion"),
            (self.ambient, "ambient light"),
            (self.environment, "an environment"),
            (self.fog.is_some(), "fog"),
            (self.alpha, "alpha"),
            (self.normal_maps, "normal maps"),
        ];
        parts.into_iter().filter(|(on, _)| *on).map(|(_, name)| name).collect()
    }
}

impl fmt::Display for PlanReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Census { kinds, stored, placed, instances, moving, materials, lights, .. } = &self.census;
        let kinds: Vec<String> = kinds.iter().map(|(kind, count)| format!("{kind}: {count}")).collect();
        writeln!(f, "{:<11} {}", "scene", self.scene)?;
        writeln!(f, "{:<11} {placed} placed ({}), {stored} stored", "primitives", kinds.join(", "))?;
        writeln!(f, "{:<11} {instances}, of which {moving} move", "instances")?;
        let m = materials;
        writeln!(
            f,
            "{:<11} {} used: {} lit, {} mirrors or glass, {} with textures, {} not all there, {} glowing",
            "materials", m.used, m.lit, m.sending_on, m.textured, m.alpha, m.glowing
        )?;
        writeln!(
            f,
            "{:<11} {}, of which {} black and {} out of reach",
            "lights", lights.given, lights.black, lights.out_of_reach
        )?;
        writeln!(f, "{:<11} {}", "plan", self.words)?;
        let build = self.build.as_ref().map(|build| format!(", {} build: {}", build.preset, build.why));
        writeln!(f, "{:<11} {}{}", "accelerator", self.accelerator, build.unwrap_or_default())?;
        let Rays { camera, sent_on, shadow } = self.rays;
        writeln!(f, "{:<11} up to about {camera} camera + {sent_on} sent on + {shadow} shadow", "rays")?;
        for LeftOut { name, what } in &self.left_out {
            writeln!(f, "{:<11} {name}: {what}", "left out")?;
        }
        Ok(())
    }
}
