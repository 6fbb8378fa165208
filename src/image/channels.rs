//! What a file holds for each pixel beside its colour: depth, names, light by where it was scattered.
//!
//! Only OpenEXR has room for it. The channels stand in one part beside R, G, B and A, under names whose layer comes
//! before a dot (`normal.X`), as compositors expect. One part a layer, the alternative, packs names apart from colours,
//! but fewer programs read files of several parts.

use crate::error::{Error, Result};

/// A named number for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Layer and component, as in `normal.X`; no other channel of the file has it.
    pub name: String,
    /// Row by row from the top, one for each pixel.
    pub plane: Plane,
}

/// The numbers of a channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Plane {
    /// IEEE binary32.
    Float(Vec<f32>),
    /// 32 bits without a sign: names, counts.
    Uint(Vec<u32>),
}

/// A file's channels, all of them: those of the colours as well.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// In no particular order.
    pub channels: Vec<Channel>,
}

impl Channel {
    /// Of floating values.
    pub fn float(name: impl Into<String>, values: Vec<f32>) -> Self {
        Self { name: name.into(), plane: Plane::Float(values) }
    }

    /// Of integers.
    pub fn uint(name: impl Into<String>, values: Vec<u32>) -> Self {
        Self { name: name.into(), plane: Plane::Uint(values) }
    }
}

impl Plane {
    /// How many pixels it is for.
    pub fn len(&self) -> usize {
        match self {
            Self::Float(values) => values.len(),
            Self::Uint(values) => values.len(),
        }
    }

    /// Whether it is for none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Four bytes a pixel, in the machine's order.
    #[cfg(feature = "oiio")]
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::Float(values) => bytemuck::cast_slice(values),
            Self::Uint(values) => bytemuck::cast_slice(values),
        }
    }
}

impl Channels {
    /// The floating values of a name; none where there is no such channel, or it holds integers.
    pub fn floats(&self, name: &str) -> Option<&[f32]> {
        match &self.find(name)?.plane {
            Plane::Float(values) => Some(values),
            Plane::Uint(_) => None,
        }
    }

    /// The integers of a name; none where there is no such channel, or it holds floating values.
    pub fn uints(&self, name: &str) -> Option<&[u32]> {
        match &self.find(name)?.plane {
            Plane::Uint(values) => Some(values),
            Plane::Float(_) => None,
        }
    }

    fn find(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.name == name)
    }
}

/// Whether channels go with a picture of so many pixels, and with each other.
///
/// # Errors
/// [`Error::Usage`] where a channel is for another number of pixels, has no name, or one that is taken.
pub(super) fn check(channels: &[Channel], pixels: usize) -> Result<()> {
    let mut taken = std::collections::BTreeSet::from(["R", "G", "B", "A"]);
    for Channel { name, plane } in channels {
        if plane.len() != pixels {
            let message = format!("channel {name:?} is for {} pixels, and the picture has {pixels}", plane.len());
            return Err(Error::Usage(message));
        }
        // 255 bytes is the format's limit.
        if name.is_empty() || name.len() > 255 || name.contains('\0') || !taken.insert(name) {
            let message = format!("channel {name:?}: names have 1 to 255 bytes, and no two channels have the same");
            return Err(Error::Usage(message));
        }
    }
    Ok(())
}
