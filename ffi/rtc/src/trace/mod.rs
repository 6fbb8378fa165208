//! What a ray does in a committed scene.
//!
//! | file | idea |
//! | --- | --- |
//! | `cast` | one ray: the triangles, then everything else, nearest hit or any hit |
//! | `offer` | what is found is held against masks and filters, and written where the caller wants it |
//! | `user` | the caller's own primitives |
//! | `round` | points and round curves |
//! | `lanes` | rays as the caller lays them out: one, packets, streams |
//! | `packet` | several rays at a time |
//! | `company` | the same among instances |
//! | `point` | what is near a point |
//! | `collide` | what of two scenes may touch |

mod cast;
mod collide;
mod company;
mod lanes;
mod offer;
mod packet;
mod point;
mod round;
mod user;

pub use cast::cast_one;
#[cfg(feature = "v4")]
pub use cast::{cast_inside, within};
pub use collide::collide;
pub use lanes::Packed;
#[cfg(feature = "v3")]
pub use lanes::{Pointers, Spare};
pub use offer::Target;
pub use packet::{intersect_lanes, occluded_lanes};
pub use point::point_query;
pub use user::{UserCall, run_filters};

use crate::abi::{RTCContext, RTCFilterFunctionN, RTCIntersectFunctionN};

/// What goes with a query.
#[derive(Clone, Copy, Debug)]
pub struct Query {
    /// The caller's, or one of our own; never null.
    pub context: *mut RTCContext,
    /// The filter that comes with the query.
    pub filter: RTCFilterFunctionN,
    /// Whether it is run for all geometries: always in version 3.
    pub filters_all: bool,
    /// The callback of user geometry that comes with the query.
    pub user: RTCIntersectFunctionN,
}
