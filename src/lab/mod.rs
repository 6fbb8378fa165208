//! What judges the rest.
//!
//! [`oracle`] answers exactly, slowly, and alone: it shares no code with any tracer. [`rounding`] says how far an
//! answer computed in f32 or f64 may be from that, and [`classify()`] puts both together: of two engines that differ on a
//! ray, which is wrong, if any. [`compare`] does so for every ray of a picture and for rays made to be difficult.
//! [`inspect`] looks for what is suspicious in a scene before anything is traced.

pub mod exact;
pub mod oracle;
pub mod rounding;
