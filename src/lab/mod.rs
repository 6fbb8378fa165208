//! What judges the rest.
//!
//! [`oracle`] answers exactly, slowly, and alone: it shares no code with any tracer. [`rounding`] says how far an
//! answer computed in f32 or f64 may be from that, and [`classify_closest`] puts both together: of two engines that
//! differ on a ray, which is wrong, if any. [`compare`] does so for every ray of a picture and for rays made to be
//! difficult. [`all`] does so for every accelerator at once. [`stress`] runs every method on the cases that are known
//! to be hard, and [`tree`] is the oracle at a pace for that. [`inspect`] says what a scene holds, and [`suspicious`]
//! what about it looks like a mistake, before anything is traced; [`mod@bench`] times the engines against each other.

pub mod all;
pub mod bench;
pub mod chart;
mod classify;
pub mod compare;
mod drawing;
mod entrants;
pub mod exact;
pub(crate) mod exact_shapes;
pub mod hex;
pub mod inspect;
pub mod oracle;
mod paired;
mod pixels;
pub mod rays;
pub mod rounding;
pub mod savings;
#[cfg(test)]
mod shape_tests;
pub mod stress;
pub mod suspicious;
pub mod tree;

pub use classify::{Answers, Class, classify_closest, classify_named, classify_occluded, is_boundary, ulps};
pub use compare::{Comparison, Report, Setup};
pub use entrants::Entrant;
pub use paired::{Asked, Difference, Paired, Tally};
pub use pixels::{PixelReport, explain_pixels};
