//! Engines timed against each other: the same rays, in one process, in turn.
//!
//! | file | idea |
//! | --- | --- |
//! | `subject` | the scenes: a file on a floor, or a mesh made by rule |
//! | `rays` | camera, diffuse and shadow rays, as `benches/embree_ref.cpp` makes them |
//! | `pixel_loop` | camera rays made within the time, by the renderer's own loop |
//! | `run`, `answers` | builds and passes over the rays, in turn; answers compared first |
//! | `report` | rates, ratios, the table |
//! | `chart`, `svg` | the rates as a picture |
//! | `machine` | what they were measured on |
//!
//! Rates move by 15 % from run to run on a shared machine, so only ratios within a run count: every engine is timed
//! within the same second as its rivals, again and again, and a ratio is the median of those of each turn. Timing one
//! engine after the other would be simpler, and charges whatever else the machine does to one of them.
//!
//! What Embree reaches here is itself held to what a plain C++ client gets out of it (`make bench-fair`): beating a
//! weakened Embree would prove nothing.

mod answers;
mod chart;
mod machine;
mod pixel_loop;
mod rays;
mod report;
mod run;
mod scaling;
mod scaling_chart;
mod subject;

pub use chart::chart;
pub use machine::processor;
pub use rays::{BLOCK, Kind, RaySet, SIDE, View};
pub use report::{BuildRow, Ratio, Report, Spread, TraversalRow};
pub use run::{AnyTracer, Build, Built, Contender, Setup, WIDTHS};
pub use scaling::{Family, Point, Scaling, ScalingReport, Swept};
pub use scaling_chart::scaling_chart;
pub use subject::Subject;
