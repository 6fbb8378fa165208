//! Many frames of an animation in one run: a picture each, under numbered names.
//!
//! Every frame is a whole run of its own, from reading the file on: meshes that are deformed have another shape in
//! each, and no frame depends on those before it. Pictures appear when they are finished, so those that are there need
//! no second rendering.

use std::path::{Path, PathBuf};

use clap::Args;

use super::render::RenderArgs;
use super::{interrupt, say};
use crate::error::{Error, Result};

/// Which frames.
#[derive(Clone, Debug, Args)]
pub(super) struct FrameArgs {
    /// Render frames A to B of an animation: frame N is what is to be seen N / --fps seconds from its start, and %04d
    /// in names of outputs stands for N
    #[arg(long, value_name = "A-B", value_parser = parse_frames, conflicts_with_all = ["time", "print_camera"], requires = "output")]
    frames: Option<[u32; 2]>,

    /// Leave out frames whose pictures and statistics are there
    #[arg(long, requires = "frames")]
    skip_existing: bool,
}

impl FrameArgs {
    pub(super) const fn are_given(&self) -> bool {
        self.frames.is_some()
    }
}

/// Has `render` make each frame.
pub(super) fn run(args: &RenderArgs, render: impl Fn(&RenderArgs) -> Result<()>) -> Result<()> {
    let [first, last] = args.frames.frames.unwrap_or_default();
    if first < last
        && let Some(path) = args.output.iter().chain(&args.stats).find(|path| numbered(path, 0) == **path)
    {
        let path = path.display();
        let message = format!("--frames: {path} would hold every frame in turn; put %04d into its name");
        return Err(Error::Usage(message));
    }
    let (mut failed, mut left_out) = (0, 0);
    for number in first..=last {
        let frame = frame(args, number);
        if args.frames.skip_existing && frame.output.iter().chain(&frame.stats).all(|path| path.is_file()) {
            left_out += 1;
            continue;
        }
        if !args.quiet {
            say(format_args!("{:<8}  {number} of {first}-{last}", "frame"))?;
        }
        match render(&frame) {
            // Of a frame that is not as it should be the next ones do not know.
            Err(Error::Check(message)) => {
                super::complain("error", &format_args!("frame {number}: {message}"));
                failed += 1;
            }
            rendered => rendered?,
        }
        interrupt::check()?;
    }
    if left_out > 0 && !args.quiet {
        say(format_args!(
            "{:<8}  {left_out} of {} frames were there and are left as they are",
            "kept",
            u64::from(last - first) + 1
        ))?;
    }
    match failed {
        0 => Ok(()),
        1 => Err(Error::Check("a frame is not as it should be".to_owned())),
        _ => Err(Error::Check(format!("{failed} frames are not as they should be"))),
    }
}

/// The arguments that render one frame.
fn frame(args: &RenderArgs, number: u32) -> RenderArgs {
    let mut frame = args.clone();
    frame.scene.time = Some(f64::from(number) / args.scene.fps);
    for path in frame.output.iter_mut().chain(&mut frame.stats).chain(&mut frame.reference) {
        *path = numbered(path, number);
    }
    frame.checkpoint.resume_if_kept(&frame.output);
    frame
}

/// The name with the number in place of `%d`, `%4d` or `%04d`, the last of them.
fn numbered(path: &Path, number: u32) -> PathBuf {
    // What is not UTF-8 has no number; names are not changed otherwise.
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return path.to_owned() };
    let mut places = name.match_indices('%').filter_map(|(start, _)| {
        let rest = &name[start + 1..];
        let digits = rest.find(|c: char| !c.is_ascii_digit())?;
        let width = if digits == 0 { 0 } else { rest[..digits].parse::<usize>().ok().filter(|width| *width <= 20)? };
        rest[digits..].starts_with('d').then_some((start, start + 1 + digits + 1, width))
    });
    match places.next_back() {
        None => path.to_owned(),
        Some((start, end, width)) => path.with_file_name(format!("{}{number:0width$}{}", &name[..start], &name[end..])),
    }
}

/// A first and a last frame, or one alone.
fn parse_frames(text: &str) -> std::result::Result<[u32; 2], String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let frames = first.trim().parse().ok().zip(last.trim().parse().ok()).filter(|(first, last)| first <= last);
    frames.map(|(first, last)| [first, last]).ok_or_else(|| "expected two numbers of frames, as in 0-47".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_numbered() {
        for (name, expected) in [
            ("a.%04d.png", "a.0012.png"),
            ("out/%d.exr", "out/12.exr"),
            ("%3d%02d.png", "%3d12.png"),
            ("50%.png", "50%.png"),
            ("a.png", "a.png"),
            ("%04x.png", "%04x.png"),
            ("%999999999999999999999d.png", "%999999999999999999999d.png"),
        ] {
            assert_eq!(numbered(Path::new(name), 12), Path::new(expected), "{name}");
        }
    }

    #[test]
    fn ranges_of_frames() {
        assert_eq!((parse_frames("0-47"), parse_frames("7")), (Ok([0, 47]), Ok([7, 7])));
        for bad in ["", "-", "3-", "-3", "5-4", "1-2-3", "a-b"] {
            assert!(parse_frames(bad).is_err(), "{bad:?}");
        }
    }
}
