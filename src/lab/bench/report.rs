//! What a benchmark found: as JSON, and as a table for people.

use std::fmt;

use serde::Serialize;

use super::rays::Kind;
use crate::lab::{Class, Tally};

/// The figures of one scene. Serialises as the document of `bench --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the scene.
    pub scene: String,
    /// Primitives as placed.
    pub triangles: u64,
    /// Threads that built and traced.
    pub threads: usize,
    /// The processor, in its own words.
    pub processor: String,
    /// Instructions that the engines may use at most.
    pub isa: &'static str,
    /// Camera rays to a side, before they are made whole tiles.
    pub size: usize,
    /// How often everything was measured.
    pub repeat: usize,
    /// One for each engine and mode.
    pub builds: Vec<BuildRow>,
    /// One for each engine, mode, width and kind of ray.
    pub traversal: Vec<TraversalRow>,
    /// One for each kind of ray.
    pub ratios: Vec<Ratio>,
    /// What became of comparing the answers, where there was something to compare.
    pub answers: Vec<Verdict>,
}

/// Smallest, middle and largest of what was measured again and again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The smallest.
    pub min: f64,
    /// The middle one; of an even number, the mean of the two in the middle.
    pub median: f64,
    /// The largest.
    pub max: f64,
}

/// Building.
#[derive(Clone, Debug, Serialize)]
pub struct BuildRow {
    /// `native` or `embree`.
    pub backend: &'static str,
    /// As the engine was set up.
    pub mode: &'static str,
    /// Millions of stored triangles a second.
    pub mtris_per_s: Spread,
    /// Bytes of the trees for each stored triangle, without the mesh itself.
    pub bytes_per_triangle: f64,
    /// The surface area heuristic's cost of the tree; none where it is not known.
    pub sah_cost: Option<f64>,
}

/// Tracing one kind of ray.
#[derive(Clone, Debug, Serialize)]
pub struct TraversalRow {
    /// `native` or `embree`.
    pub backend: &'static str,
    /// As the engine was set up.
    pub mode: &'static str,
    /// Rays that travel together.
    pub width: usize,
    /// What the rays are for.
    pub kind: Kind,
    /// Millions of rays a second.
    pub mrays_per_s: Spread,
    /// Rays that were traced in each turn.
    pub rays: u64,
    /// Rays that hit something.
    pub hits: u64,
    /// The rate of each turn, in order.
    #[serde(skip)]
    pub turns: Vec<f64>,
}

/// Native's rate over Embree's, each at the width with its best median: the median over the turns of the ratios within
/// a turn.
#[derive(Clone, Debug, Serialize)]
pub struct Ratio {
    /// What the rays are for.
    pub kind: Kind,
    /// Over the mode `robust`; none where that was not measured.
    pub over_embree_robust: Option<f64>,
    /// Over the mode `fast`.
    pub over_embree_fast: Option<f64>,
}

/// How native's answers stand to Embree's, on the rays of one kind.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Verdict {
    /// What the rays are for.
    pub kind: Kind,
    /// [`Class::Agree`].
    pub agree: u64,
    /// [`Class::Tie`].
    pub tie: u64,
    /// [`Class::Boundary`].
    pub boundary: u64,
    /// [`Class::NativeWrong`].
    pub native_wrong: u64,
    /// [`Class::EmbreeWrong`].
    pub embree_wrong: u64,
}

impl Verdict {
    /// The counts of `tally`.
    pub(super) fn new(kind: Kind, tally: &Tally) -> Self {
        let count = |class| tally.count(class);
        Self {
            kind,
            agree: count(Class::Agree),
            tie: count(Class::Tie),
            boundary: count(Class::Boundary),
            native_wrong: count(Class::NativeWrong),
            embree_wrong: count(Class::EmbreeWrong),
        }
    }
}

impl Spread {
    /// Of one or more numbers.
    pub fn of(samples: &[f64]) -> Self {
        let mut sorted = samples.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |i: usize| sorted.get(i).copied().unwrap_or(f64::NAN);
        let last = sorted.len().saturating_sub(1);
        Self { min: at(0), median: at(last / 2).midpoint(at(last.div_ceil(2))), max: at(last) }
    }
}

impl Ratio {
    /// The ratios of one kind of ray, between native's mode `default` and two of Embree's.
    pub fn new(kind: Kind, rows: &[TraversalRow]) -> Self {
        let best = |backend: &str, mode: &str| {
            let rows = rows.iter().filter(|row| row.kind == kind && row.backend == backend && row.mode == mode);
            rows.max_by(|a, b| a.mrays_per_s.median.total_cmp(&b.mrays_per_s.median))
        };
        let native = best("native", "default");
        let over = |mode: &str| {
            let pairs = native?.turns.iter().zip(&best("embree", mode)?.turns);
            Some(Spread::of(&pairs.map(|(a, b)| a / b).collect::<Vec<_>>()).median)
        };
        Self { kind, over_embree_robust: over("robust"), over_embree_fast: over("fast") }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:9.3}{:9.3}{:9.3}", self.median, self.min, self.max)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let threads = if self.threads == 1 { "thread" } else { "threads" };
        writeln!(f, "{}: {} triangles, {} {threads}", self.scene, self.triangles, self.threads)?;
        writeln!(
            f,
            "\n  {:<22}{:>9}{:>9}{:>9}{:>12}{:>10}",
            "build, Mtri/s", "median", "min", "max", "B/triangle", "SAH cost"
        )?;
        for BuildRow { backend, mode, mtris_per_s, bytes_per_triangle, sah_cost } in &self.builds {
            write!(f, "  {:<22}{mtris_per_s}{bytes_per_triangle:12.1}", format!("{backend} {mode}"))?;
            writeln!(f, "{}", sah_cost.map(|cost| format!("{cost:10.3}")).unwrap_or_default())?;
        }
        for Ratio { kind, over_embree_robust, over_embree_fast } in &self.ratios {
            let head = format!("{}, Mray/s", kind.name());
            writeln!(f, "\n  {head:<16}{:>6}{:>9}{:>9}{:>9}{:>12}", "width", "median", "min", "max", "hits")?;
            for TraversalRow { backend, mode, width, mrays_per_s, hits, .. } in
                self.traversal.iter().filter(|row| row.kind == *kind)
            {
                writeln!(f, "  {:<16}{width:>6}{mrays_per_s}{hits:>12}", format!("{backend} {mode}"))?;
            }
            for (name, ratio) in [("robust", over_embree_robust), ("fast", over_embree_fast)] {
                if let Some(ratio) = ratio {
                    writeln!(f, "  {:<22}{ratio:9.2}", format!("over embree {name}"))?;
                }
            }
            for Verdict { agree, tie, boundary, native_wrong, embree_wrong, .. } in
                self.answers.iter().filter(|answers| answers.kind == *kind)
            {
                writeln!(
                    f,
                    "  answers: {agree} agree, {tie} tie, {boundary} boundary, {native_wrong} native_wrong, {embree_wrong} embree_wrong"
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(backend: &'static str, mode: &'static str, width: usize, turns: &[f64]) -> TraversalRow {
        let mrays_per_s = Spread::of(turns);
        TraversalRow { backend, mode, width, kind: Kind::Primary, mrays_per_s, rays: 9, hits: 0, turns: turns.to_vec() }
    }

    #[test]
    fn spreads() {
        assert_eq!(Spread::of(&[3.0, 1.0, 2.0]), Spread { min: 1.0, median: 2.0, max: 3.0 });
        assert_eq!(Spread::of(&[4.0, 1.0]), Spread { min: 1.0, median: 2.5, max: 4.0 });
        assert_eq!(Spread::of(&[5.0]), Spread { min: 5.0, median: 5.0, max: 5.0 });
        assert!(Spread::of(&[]).median.is_nan());
    }

    #[test]
    fn ratios_are_taken_turn_by_turn_at_the_best_widths() {
        let rows = [
            row("native", "default", 1, &[1.0, 9.0, 1.0]),
            row("native", "default", 8, &[4.0, 2.0, 6.0]),
            row("native", "other", 8, &[100.0; 3]),
            row("embree", "robust", 1, &[2.0, 2.0, 2.0]),
            row("embree", "robust", 8, &[1.0, 1.0, 1.0]),
        ];
        let ratio = Ratio::new(Kind::Primary, &rows);
        // 4/2, 2/2, 6/2.
        assert_eq!((ratio.over_embree_robust, ratio.over_embree_fast), (Some(2.0), None));
        assert_eq!(Ratio::new(Kind::Shadow, &rows).over_embree_robust, None);
    }
}
