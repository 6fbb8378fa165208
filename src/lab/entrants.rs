//! Every way to search a scene, as what the comparison of all and the scaling chart go through.

use crate::error::Result;
use crate::trace::World;
use crate::trace::accel::{Accel, Built, Options};

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entrant {
    /// One of this program.
    Accel(Accel),
    /// Embree, robust.
    #[cfg(feature = "embree")]
    Embree,
}

impl Entrant {
    /// All that are in this build; brute force first, for the others are held against it.
    pub fn all() -> Vec<Self> {
        let others = Accel::ALL.into_iter().filter(|&accel| accel != Accel::Brute).map(Self::Accel);
        let all = [Self::Accel(Accel::Brute)].into_iter().chain(others);
        #[cfg(feature = "embree")]
        let all = all.chain([Self::Embree]);
        all.collect()
    }

    /// As in the reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accel(accel) => accel.name(),
            #[cfg(feature = "embree")]
            Self::Embree => "embree",
        }
    }

    /// Whether it is this program's own.
    pub const fn is_native(self) -> bool {
        matches!(self, Self::Accel(_))
    }

    /// Whether its hits are those of brute force to the bit.
    pub fn is_exact(self, options: &Options) -> bool {
        match self {
            Self::Accel(accel) => options.are_exact_for(accel),
            #[cfg(feature = "embree")]
            Self::Embree => false,
        }
    }

    /// Builds it.
    ///
    /// # Errors
    /// Those of Embree.
    pub fn build(self, world: &World, options: &Options) -> Result<Built> {
        match self {
            Self::Accel(accel) => Ok(accel.build(world, options)),
            #[cfg(feature = "embree")]
            Self::Embree => {
                use crate::trace::embree::{Embree, Options};
                let options = Options { threads: Some(rayon::current_num_threads()), ..Options::default() };
                let embree = Embree::new(world, &options)?;
                Ok(Built { bytes: embree.bytes(), notes: Vec::new(), tracer: Box::new(embree) })
            }
        }
    }
}
