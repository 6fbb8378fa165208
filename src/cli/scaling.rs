//! `twincast bench --scaling`: time against the number of triangles, for every accelerator.

use super::bench::BenchArgs;
use super::threads::pool;
use super::{interrupt, outputs, progress, say_report};
use crate::error::Result;
use crate::lab::bench::{Scaling, processor, scaling_chart};
use crate::memory::process;

/// As far as it goes where nothing else is asked for.
const MAX_TRIANGLES: u64 = 1_000_000;

pub(super) fn run(args: &BenchArgs) -> Result<()> {
    let cancel = interrupt::install()?;
    outputs::check(&[], &args.chart, [])?;
    let bar = progress::spinner("measuring", args.json);
    let on_step = |what: &str| bar.set_message(what.to_owned());
    let max_memory = args.max_memory.or_else(|| process::available().map(|bytes| bytes / 4 * 3));
    let scaling =
        Scaling { max: args.max.unwrap_or(MAX_TRIANGLES), max_memory, cancel: Some(cancel), on_step: Some(&on_step) };
    let pool = pool(args.threads)?;
    let report = pool.install(|| scaling.run());
    bar.finish_and_clear();
    let report = report?;
    if let Some(path) = &args.chart {
        let threads = pool.current_num_threads();
        let notes = [format!("{}; builds on {threads} threads, rays on one", processor())];
        outputs::write_text(path, &scaling_chart(&report, &notes))?;
    }
    say_report(args.json, &report)
}
