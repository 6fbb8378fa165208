//! Long renders that are interrupted: what is known so far is written to a file now and then, and read to go on from.
//!
//! The file is an OpenEXR picture that any viewer shows, of the render as far as it is, with the undivided sums beside
//! it as 32-bit channels. It is written beside its place and renamed, so that whenever the process is killed there is a
//! whole one, the last or the one before. In the header stands what the render was of; a file of another scene, other
//! settings, or by another program is refused, for what went on from it would be a mixture.

use std::path::Path;
use std::time::{Duration, Instant};

use super::Renderer;
use super::canvas::Canvas;
use super::identity::identity;
use crate::error::{Error, Result};
use crate::image::{self, Channel, Channels, Metadata, WriteOptions};
use crate::math::Vec4;

/// How a render is kept, and gone on with.
///
/// What goes wrong with the file is [`Error::Output`] where it is written; [`Error::Input`] where it is to be read and
/// is missing, broken or of another render.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoint<'a> {
    /// The file, with the suffix `.exr`.
    pub path: &'a Path,
    /// How often it is written, and whenever the render is interrupted; none where it is gone on from and no more.
    /// Where writing takes long it is written less often, so that it takes a fifth of the time at most.
    pub every: Option<Duration>,
    /// Whether to go on from what it holds.
    pub resume: bool,
    /// The engine, which must be the same one all the time.
    pub engine: &'a str,
}

/// Prefix of the header's entries.
const OWN: &str = "twincast/";
/// The entry that holds the number of samples with which the present round began.
const ROUND: &str = "round";

/// Whether a file is a checkpoint, of whatever render.
pub(crate) fn is_checkpoint(path: &Path) -> bool {
    let is_own = |name: &str| name.strip_prefix(OWN) == Some(ROUND);
    image::read_metadata(path).is_ok_and(|metadata| metadata.texts.iter().any(|(name, _)| is_own(name)))
}

/// Writes checkpoints.
pub(super) struct Keeper<'k> {
    path: &'k Path,
    every: Duration,
    /// When the last one was finished, and how long that took.
    last: Instant,
    took: Duration,
    identity: Vec<(&'static str, String)>,
}

impl Keeper<'_> {
    /// Writes, if the last time is long enough ago.
    pub(super) fn write_if_due(&mut self, canvas: &Canvas, done: u32) -> Result<()> {
        if !is_due(self.last.elapsed(), self.every, self.took) {
            return Ok(());
        }
        let begun = Instant::now();
        self.write(canvas, done)?;
        (self.last, self.took) = (Instant::now(), begun.elapsed());
        Ok(())
    }

    /// Writes what is known within the round that began with `done` samples.
    pub(super) fn write(&self, canvas: &Canvas, done: u32) -> Result<()> {
        let mut texts: Vec<_> = self.identity.iter().map(|(key, text)| (format!("{OWN}{key}"), text.clone())).collect();
        texts.push((format!("{OWN}{ROUND}"), done.to_string()));
        let metadata = Metadata { texts, ..Metadata::default() };
        image::write_channels(self.path, &canvas.image(), &planes(canvas), &metadata, &WriteOptions::default())
    }
}

/// Rendering takes so many times as long as writing checkpoints, at least: nobody renders on meanwhile.
const RENDERED: u32 = 4;

/// Whether one is due so long after the last one, which took so long to write.
fn is_due(since: Duration, every: Duration, took: Duration) -> bool {
    since >= every.max(took.saturating_mul(RENDERED))
}

impl Renderer<'_> {
    /// The canvas to go on with, which is as empty as the one given where nothing is to be resumed; the samples with
    /// which the round begins; and what writes checkpoints.
    pub(super) fn open_checkpoint<'k>(
        &self,
        checkpoint: &Checkpoint<'k>,
        mut canvas: Canvas,
    ) -> Result<(Canvas, u32, Option<Keeper<'k>>)> {
        let Checkpoint { path, every, resume, engine } = *checkpoint;
        let identity = identity(self, engine);
        let mut done = 0;
        if resume {
            done = same_render(path, &identity)?;
            if done > self.most_samples() {
                let message =
                    format!("says that {done} samples of a pixel are done, of {} at most", self.most_samples());
                return Err(Error::input(path, "", message + "; begin anew instead of resuming"));
            }
            let channels = image::read_channels(path)?;
            let broken = || Error::input(path, "", "is no whole checkpoint: begin anew instead of resuming");
            fill(&mut canvas, &channels).ok_or_else(broken)?;
            // A pixel that goes on has the samples with which the round began, or those with which it ends.
            let ends = [done, self.next_round(done, true)];
            let mut going_on = canvas.counts.iter().zip(&canvas.active).filter(|(_, active)| **active);
            if !going_on.all(|(count, _)| ends.contains(count)) {
                return Err(broken());
            }
        }
        let keeper = every.map(|every| Keeper { path, every, last: Instant::now(), took: Duration::ZERO, identity });
        Ok((canvas, done, keeper))
    }
}

/// Whether a checkpoint is of this render; the samples with which its round began.
fn same_render(path: &Path, identity: &[(&'static str, String)]) -> Result<u32> {
    let refuse = |message: String| Error::input(path, "", message);
    if !path.exists() {
        return Err(refuse("there is no checkpoint to resume: begin anew".to_owned()));
    }
    let Metadata { texts, .. } = image::read_metadata(path)?;
    let entry = |key: &str| {
        let found = texts.iter().find(|(name, _)| name.strip_prefix(OWN) == Some(key));
        found.map(|(_, text)| text.as_str()).ok_or_else(|| refuse("is not a checkpoint of a render".to_owned()))
    };
    for (key, own) in identity {
        let found = entry(key)?;
        if found != own {
            // Of long entries only what differs.
            let differing = found.split("; ").zip(own.split("; ")).find(|(a, b)| a != b);
            let (found, own) = differing.unwrap_or((found, own.as_str()));
            // Digests and what has parts are for comparing, not for reading: there the name has to do.
            let is_readable = *key != "scene" && ![found, own].iter().any(|entry| entry.contains(['(', '{']));
            let name = own.split(|c: char| !c.is_ascii_lowercase() && c != ' ').next().unwrap_or_default().trim();
            let difference = match is_readable {
                true => format!("{key}: {found}, and here {own}"),
                false if *key == "settings" => format!("{key}: another {name}"),
                false => (*key).to_owned(),
            };
            return Err(refuse(format!("is of another render, by its {difference}; begin anew instead of resuming")));
        }
    }
    entry(ROUND)?.parse().map_err(|_| refuse("does not say how far it is".to_owned()))
}

/// Everything about a canvas.
fn planes(canvas: &Canvas) -> Vec<Channel> {
    let mut channels = Vec::new();
    let mut colours = |name: &str, values: &[Vec4]| {
        for (axis, component) in ["R", "G", "B", "A"].into_iter().enumerate() {
            channels.push(Channel::float(format!("{name}.{component}"), values.iter().map(|v| v[axis]).collect()));
        }
    };
    colours("sum", &canvas.sums);
    if !canvas.firsts.is_empty() {
        colours("first", &canvas.firsts);
    }
    channels.push(Channel::float("weight", canvas.weights.clone()));
    channels.push(Channel::uint("count", canvas.counts.clone()));
    channels.push(Channel::uint("active", canvas.active.iter().map(|&active| active.into()).collect()));
    let stride = canvas.beside.len() / canvas.sums.len();
    for k in 0..stride {
        channels.push(Channel::float(
            format!("beside.{k}"),
            canvas.beside.iter().skip(k).step_by(stride).copied().collect(),
        ));
    }
    for (name, coverage) in [("object", &canvas.objects), ("material", &canvas.materials)] {
        for k in 0..coverage.iter().map(Vec::len).max().unwrap_or(0) {
            // No id is 0.
            let of = |covers: &super::aov::Coverage| covers.get(k).copied().unwrap_or_default();
            channels.push(Channel::uint(format!("{name}{k}.id"), coverage.iter().map(|c| of(c).0).collect()));
            channels.push(Channel::float(format!("{name}{k}.share"), coverage.iter().map(|c| of(c).1).collect()));
        }
    }
    channels
}

/// Puts everything into a canvas that [`planes`] made of one like it; none where something is missing.
fn fill(canvas: &mut Canvas, channels: &Channels) -> Option<()> {
    if (channels.width, channels.height) != (canvas.window.width, canvas.window.height) {
        return None;
    }
    let colours = |name: &str, values: &mut [Vec4]| {
        for (axis, component) in ["R", "G", "B", "A"].into_iter().enumerate() {
            let plane = channels.floats(&format!("{name}.{component}"))?;
            values.iter_mut().zip(plane).for_each(|(value, &x)| value[axis] = x);
        }
        Some(())
    };
    colours("sum", &mut canvas.sums)?;
    if !canvas.firsts.is_empty() {
        colours("first", &mut canvas.firsts)?;
    }
    canvas.weights.copy_from_slice(channels.floats("weight")?);
    canvas.counts.copy_from_slice(channels.uints("count")?);
    canvas.active.iter_mut().zip(channels.uints("active")?).for_each(|(active, &n)| *active = n != 0);
    let stride = canvas.beside.len() / canvas.sums.len();
    for k in 0..stride {
        let plane = channels.floats(&format!("beside.{k}"))?;
        canvas.beside.iter_mut().skip(k).step_by(stride).zip(plane).for_each(|(value, &x)| *value = x);
    }
    for (name, coverage) in [("object", &mut canvas.objects), ("material", &mut canvas.materials)] {
        for k in 0.. {
            let Some(ids) = channels.uints(&format!("{name}{k}.id")) else { break };
            let shares = channels.floats(&format!("{name}{k}.share"))?;
            for ((covers, &id), &share) in coverage.iter_mut().zip(ids).zip(shares) {
                covers.extend((id != 0).then_some((id, share)));
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writing_takes_a_fifth_of_the_time_at_most() {
        let seconds = Duration::from_secs;
        assert!(is_due(seconds(60), seconds(60), seconds(1)) && !is_due(seconds(59), seconds(60), seconds(1)));
        assert!(is_due(seconds(80), seconds(60), seconds(20)) && !is_due(seconds(79), seconds(60), seconds(20)));
        assert!(is_due(seconds(0), seconds(0), seconds(0)) && !is_due(seconds(3), seconds(0), seconds(1)));
    }
}
