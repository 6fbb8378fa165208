//! One animation of a file, and what it says at a time.

use std::collections::{HashMap, HashSet};

use super::Animated;
use super::curve::Curve;
use crate::error::{Result, Warning};
use crate::io::Animation;
use crate::io::gltf::document::Document;
use crate::io::gltf::schema;
use crate::math::{DQuat, DVec3};

/// One animation.
pub(super) struct Clip<'a> {
    document: &'a Document<'a>,
    index: usize,
    source: &'a schema::Animation,
}

impl<'a> Clip<'a> {
    /// The animation that is asked for, by its name, or its number where none has that name; none where no animation is.
    ///
    /// # Errors
    /// Where there is no such animation, or there are several and it is not said which, with those that there are.
    pub(super) fn choose(document: &'a Document<'a>, wish: &Animation) -> Result<Option<Self>> {
        if wish.name.is_none() && wish.time.is_none() {
            return Ok(None);
        }
        let all = &document.root.animations;
        let told = |message: String| {
            let name = |(i, one): (usize, &schema::Animation)| match one.name.as_str() {
                "" => i.to_string(),
                name => format!("{name:?}"),
            };
            let names: Vec<_> = all.iter().enumerate().map(name).collect();
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            document.error("/animations", format!("{message}; the file has {known}"))
        };
        let index = match &wish.name {
            Some(name) => {
                let named = all.iter().position(|one| one.name == *name);
                let found = named.or_else(|| name.parse().ok().filter(|&number| number < all.len()));
                found.ok_or_else(|| told(format!("no animation {name:?}")))?
            }
            None if all.len() == 1 => 0,
            None if all.is_empty() => return Err(told("a time of an animation is asked for".into())),
            None => return Err(told("it has to be said which animation is meant (--animation)".into())),
        };
        Ok(Some(Self { document, index, source: &all[index] }))
    }

    /// What it says of nodes, by their index, at a time in seconds. Before its first key and after its last one it stands still.
    pub(super) fn at(&self, time: f64, warnings: &mut Vec<Warning>) -> Result<HashMap<usize, Animated>> {
        let Self { document, index, source } = self;
        let mut nodes: HashMap<usize, Animated> = HashMap::new();
        let mut known_times = HashSet::new();
        let mut unknown = 0;
        for (c, channel) in source.channels.iter().enumerate() {
            let pointer = format!("/animations/{index}/channels/{c}");
            let Some(node) = channel.target.node else {
                unknown += 1;
                continue;
            };
            let all = &document.root.nodes;
            document.check_index(&format!("{pointer}/target/node"), node, all.len(), "node")?;
            let path = channel.target.path.as_str();
            if all[node].matrix.is_some() && path != "weights" {
                let message = format!("node {node} has a matrix, so that its {path} cannot be animated");
                return Err(document.error(format!("{pointer}/target/path"), message));
            }
            let samplers = &source.samplers;
            document.check_index(&format!("{pointer}/sampler"), channel.sampler, samplers.len(), "sampler")?;
            let place = format!("/animations/{index}/samplers/{}", channel.sampler);
            let mut curve =
                |kind: &str| Curve::new(document, &samplers[channel.sampler], kind, &place, &mut known_times);
            let animated = nodes.entry(node).or_default();
            match path {
                "translation" => animated.translation = Some(DVec3::from(curve("VEC3")?.vector(time)?)),
                "scale" => animated.scale = Some(DVec3::from(curve("VEC3")?.vector(time)?)),
                "rotation" => animated.rotation = Some(DQuat::from_array(curve("VEC4")?.rotation(time)?)),
                "weights" => animated.weights = Some(curve("SCALAR")?.weights(time)?),
                _ => unknown += 1,
            }
        }
        if unknown > 0 {
            let message = format!("{unknown} channels animate something other than nodes, and are left out");
            warnings.push(document.warning(format!("/animations/{index}/channels"), message));
        }
        Ok(nodes)
    }
}
