//! Time of all hypotheses on one recording and its check, without reading the files.

use criterion::{Criterion, criterion_group, criterion_main};
use plant::model::Model;
use plant::recording::Recording;
use std::path::PathBuf;

fn recording(criterion: &mut Criterion) {
    let shared = std::env::var_os("DDFEED_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let folder = shared.join("recordings/open-01");
    let (Ok(model), Ok(fit), Ok(check)) = (
        Model::load(&folder.join("model.toml")),
        Recording::load(&folder.join("fit.csv.gz")),
        Recording::load(&folder.join("check.csv.gz")),
    ) else {
        eprintln!("recording: skipped, {} is not there", folder.display());
        return;
    };
    let mut group = criterion.benchmark_group("identify");
    group.sample_size(10);
    group.bench_function("open-01, all hypotheses", |b| {
        b.iter(|| {
            identify::analysis::analyse(&model, &fit, &check)
                .effects
                .len()
        });
    });
    group.finish();
}

criterion_group!(benches, recording);
criterion_main!(benches);
