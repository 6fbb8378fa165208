//! One pixel, and why it is as it is: as text, or as JSON.

use std::fmt::{self, Write};

use clap::Args;

use super::common::needs;
use super::engine::BackendArg;
use super::say;
use crate::error::{Error, Result};
use crate::render::{Explanation, HitTrail, LightTrail, RayTrail, Renderer, SampleTrail};
use crate::trace::World;
use crate::trace::accel::{Accel, Options as AccelOptions};
use crate::trace::bvh::{Bvh, Steps};

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "One pixel")]
pub(super) struct ExplainArgs {
    /// Render this pixel alone and print its linear colour; column and row, from 0 at the top left
    #[arg(long, value_name = "X,Y", value_parser = parse_place,
        conflicts_with_all = ["output", "stats", "reference", "print_camera", "crop", "noise", "display_server", "frames", "threshold"])]
    pixel: Option<[u32; 2]>,

    /// Print its rays, what they hit, every light's share, and how much of the native tree each ray enters
    #[arg(long, requires = "pixel")]
    explain: bool,

    /// Print it as JSON, with --explain
    #[arg(long, requires = "explain")]
    json: bool,
}

impl ExplainArgs {
    /// An error where it is not said which pixel, or of two engines by which.
    pub(super) fn check(&self, backend: BackendArg) -> Result<()> {
        needs(("--explain", self.explain), ("--pixel", self.is_wanted()))?;
        if self.is_wanted() && backend == BackendArg::Both {
            return Err(Error::Usage("--pixel takes one backend: native or embree".to_owned()));
        }
        Ok(())
    }

    /// Whether a pixel is wanted in place of a picture.
    pub(super) const fn is_wanted(&self) -> bool {
        self.pixel.is_some()
    }

    /// Prints the pixel that is asked for.
    pub(super) fn run(
        &self,
        world: &World,
        renderer: &Renderer<'_>,
        backend: BackendArg,
        (accel, options): &(Accel, AccelOptions),
    ) -> Result<()> {
        let Some(pixel) = self.pixel else { return Ok(()) };
        let [width, height] = renderer.size();
        if pixel[0] >= width || pixel[1] >= height {
            let [x, y] = pixel;
            return Err(Error::Usage(format!("--pixel {x},{y}: the picture has {width}x{height}, counted from 0")));
        }
        let explanation = match backend {
            BackendArg::Native if *accel == Accel::Bvh => {
                let bvh = Bvh::build(world);
                renderer.explain(&bvh, pixel, Some(&|ray| bvh.steps(ray)))
            }
            BackendArg::Native => renderer.explain(&accel.build(world, options), pixel, None),
            #[cfg(feature = "embree")]
            BackendArg::Embree => {
                let embree = crate::trace::embree::Embree::new(world, &Default::default())?;
                renderer.explain(&embree, pixel, None)
            }
            #[cfg(not(feature = "embree"))]
            BackendArg::Embree => unreachable!("it is not in this build, which was checked"),
            BackendArg::Both => unreachable!("there is one, which was checked"),
        };
        match (self.explain, self.json) {
            (false, _) => {
                let [r, g, b, a] = explanation.value;
                say(format_args!("{r} {g} {b} {a}"))
            }
            (true, false) => say(Told(&explanation)),
            // Many fields within others: for people, too.
            (true, true) => {
                let text = serde_json::to_string_pretty(&explanation);
                say(text.map_err(|error| Error::output("<stdout>", error.to_string()))?)
            }
        }
    }
}

/// For people.
struct Told<'a>(&'a Explanation);

impl fmt::Display for Told<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Explanation { pixel: [x, y], value: [r, g, b, a], samples } = self.0;
        write!(f, "pixel {x},{y}: {r} {g} {b}, coverage {a}")?;
        for (sample, number) in samples.iter().zip(0..) {
            let SampleTrail { film: [x, y], weight, value: [r, g, b, _], rays } = sample;
            write!(f, "\nsample {number} at {x:.3},{y:.3}, weight {weight}: {r} {g} {b}")?;
            rays.iter().try_for_each(|ray| write_ray(f, ray))?;
        }
        Ok(())
    }
}

fn write_ray(f: &mut fmt::Formatter<'_>, ray: &RayTrail) -> fmt::Result {
    let indent = "  ".repeat(ray.depth as usize + 1);
    let RayTrail { number, origin, direction, time, weight, hit, own, lights, steps, .. } = ray;
    let (origin, direction, weight) = (Row(origin), Row(direction), Row(weight));
    write!(f, "\n{indent}ray {number} from {origin} along {direction}, time {time}, share {weight}")?;
    if let Some(Steps { nodes, objects, blocks, shapes }) = steps {
        write!(f, "; enters {nodes} nodes, {objects} objects, {blocks} blocks of triangles, {shapes} shapes")?;
    }
    match hit {
        None => write!(f, "\n{indent}  leaves the scene")?,
        Some(hit) => write_hit(f, &indent, hit)?,
    }
    write!(f, "\n{indent}  by itself {}", Row(own))?;
    for light in lights {
        let LightTrail { light: number, kind, direction, distance, radiance, cosine, .. } = light;
        let far = distance.map_or("infinitely far".to_owned(), |distance| format!("{distance} m away"));
        let (direction, radiance) = (Row(direction), Row(radiance));
        write!(f, "\n{indent}  light {number} ({kind}) along {direction}, {far}: {radiance}, cosine {cosine:.6}")?;
        let LightTrail { diffuse, highlight, glossy, fog, share, visibility, contribution, .. } = light;
        let lobes = [("diffuse", diffuse), ("highlight", highlight), ("glossy", glossy)];
        let mut words = String::new();
        for (name, value) in lobes.into_iter().filter(|(_, value)| **value != [0.0; 3]) {
            write!(words, "{name} {}, ", Row(value))?;
        }
        if *fog != [1.0; 3] {
            write!(words, "fog and absorption leave {}, ", Row(fog))?;
        }
        write!(f, "\n{indent}    gives {}: {words}counts {share}, free {visibility}", Row(contribution))?;
    }
    Ok(())
}

fn write_hit(f: &mut fmt::Formatter<'_>, indent: &str, hit: &HitTrail) -> fmt::Result {
    let HitTrail { distance, instance, instance_name, geometry, primitive, parameters: [u, v], .. } = hit;
    write!(f, "\n{indent}  meets instance {instance} {instance_name:?}, geometry {geometry}, primitive {primitive} ")?;
    write!(f, "after {distance} m, u {u:.6}, v {v:.6}")?;
    let side = if hit.front { "front" } else { "back" };
    let (position, normal, shading) = (Row(&hit.position), Row(&hit.normal), Row(&hit.shading_normal));
    write!(f, "\n{indent}  at {position}, {side}, normal {normal}, shading normal {shading}, ")?;
    write!(f, "material {} {:?}", hit.material, hit.material_name)
}

/// Numbers side by side.
struct Row<'a, T>(&'a [T]);

impl<T: fmt::Display> fmt::Display for Row<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, number) in self.0.iter().enumerate() {
            write!(f, "{}{number}", if i > 0 { "," } else { "" })?;
        }
        Ok(())
    }
}

/// Column and row.
fn parse_place(text: &str) -> std::result::Result<[u32; 2], String> {
    let place = text.split_once(',').and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    place.ok_or_else(|| "expected column and row, as in 320,200".to_owned())
}
