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
    /// The animations that are asked for, by their names, or their numbers where none has that name.
    ///
    /// # Errors
    /// Where there is no such animation, or there are several and it is not said which, with those that there are.
    pub(super) fn choose(document: &'a Document<'a>, wish: &Animation) -> Result<Vec<Self>> {
        if wish.names.is_empty() && wish.time.is_none() {
            return Ok(Vec::new());
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
        let mut chosen = Vec::new();
        for name in &wish.names {
            let named = all.iter().position(|one| one.name == *name);
            match named.or_else(|| name.parse().ok().filter(|&number| number < all.len())) {
                Some(index) => chosen.push(index),
                None if name == "all" && !all.is_empty() => chosen.extend(0..all.len()),
                None => return Err(told(format!("no animation {name:?}"))),
            }
        }
        if wish.names.is_empty() {
            match all.len() {
                0 => return Err(told("a time of an animation is asked for".into())),
                1 => chosen.push(0),
                _ => {
                    return Err(told(
                        "it has to be said which animations are meant (by name or number, or all)".into(),
                    ));
                }
            }
        }
        Ok(chosen.into_iter().map(|index| Self { document, index, source: &all[index] }).collect())
    }

    /// Adds what it says of nodes, by their index, at a time in seconds, in place of what was said before. Before its
    /// first key and after its last one it stands still.
    pub(super) fn add(
        &self,
        time: f64,
        nodes: &mut HashMap<usize, Animated>,
        warnings: &mut Vec<Warning>,
    ) -> Result<()> {
        let Self { document, index, source } = self;
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
        Ok(())
    }
}
