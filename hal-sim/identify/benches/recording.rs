//! From the files of a recording to the missing effect: the shared recordings that take longest (two effects, one of a
//! current sensor) and the shortest (nothing missing), with and without reading them. Skipped where they are absent.

use criterion::{Criterion, criterion_group, criterion_main};
use plant::model::Model;
use plant::recording::Recording;
use std::path::Path;

fn read(folder: &Path) -> Option<(Model, Recording, Recording)> {
    Some((
        Model::load(&folder.join("model.toml")).ok()?,
        Recording::load(&folder.join("fit.csv.gz")).ok()?,
        Recording::load(&folder.join("check.csv.gz")).ok()?,
    ))
}

fn recording(criterion: &mut Criterion) {
    let shared = given::shared();
    let mut group = criterion.benchmark_group("identify");
    group.sample_size(10);
    for name in ["open-05", "open-01", "open-09"] {
        let folder = shared.join("recordings").join(name);
        let Some((model, fit, check)) = read(&folder) else {
            eprintln!("recording: skipped, {} is not there", folder.display());
            continue;
        };
        group.bench_function(format!("{name}, all hypotheses"), |b| {
            b.iter(|| {
                identify::analysis::analyse(&model, &fit, &check)
                    .effects
                    .len()
            });
        });
        group.bench_function(format!("{name}, from its files"), |b| {
            b.iter(|| {
                let (model, fit, check) = read(&folder).expect("it was there");
                identify::analysis::analyse(&model, &fit, &check)
                    .effects
                    .len()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, recording);
criterion_main!(benches);
