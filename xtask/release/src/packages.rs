//! Libraries that are linked into the program or a firmware.

use crate::compile::host;
use anyhow::{Context, Result};
use cargo_metadata::{CargoOpt, DependencyKind, Metadata, MetadataCommand, Package, PackageId};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;
use xtask::firmware::{BROWSER, TARGET};

/// Third-party packages that are linked into the program or a firmware, sorted by name and version.
///
/// # Errors
/// Cargo cannot read the checkout.
pub fn linked(checkout: &Path) -> Result<Vec<Package>> {
    let mut packages = BTreeMap::new();
    let program = ["ddfeed/full", "firmware/board-mains"];
    let roots = [
        ("ddfeed", host()?),
        ("firmware", TARGET.to_owned()),
        ("scope", BROWSER.to_owned()),
    ];
    for (root, triple) in roots {
        let metadata = MetadataCommand::new()
            .manifest_path(checkout.join("Cargo.toml"))
            .features(CargoOpt::SomeFeatures(program.map(String::from).to_vec()))
            .other_options(["--locked", "--filter-platform", &triple].map(String::from))
            .exec()
            .with_context(|| format!("cargo cannot read {}", checkout.display()))?;
        for package in reached(&metadata, root)? {
            packages.insert((package.name.to_string(), package.version.clone()), package);
        }
    }
    Ok(packages.into_values().collect())
}

/// The packages that `root` needs when it runs: no build script's, no test's.
fn reached(metadata: &Metadata, root: &str) -> Result<Vec<Package>> {
    let resolve = metadata
        .resolve
        .as_ref()
        .context("cargo resolved no dependencies")?;
    let nodes: HashMap<&PackageId, _> = resolve.nodes.iter().map(|node| (&node.id, node)).collect();
    let start = metadata
        .packages
        .iter()
        .find(|package| package.name.as_str() == root);
    let mut waiting = vec![
        &start
            .with_context(|| format!("the workspace has no package {root}"))?
            .id,
    ];
    let mut seen = HashSet::new();
    while let Some(id) = waiting.pop() {
        if seen.insert(id) {
            let normal = |kinds: &[cargo_metadata::DepKindInfo]| {
                kinds.iter().any(|kind| kind.kind == DependencyKind::Normal)
            };
            let dependencies = nodes.get(id).map_or(&[][..], |node| &node.deps);
            waiting.extend(
                dependencies
                    .iter()
                    .filter(|dep| normal(&dep.dep_kinds))
                    .map(|dep| &dep.pkg),
            );
        }
    }
    let third_party = |package: &&Package| package.source.is_some() && seen.contains(&package.id);
    Ok(metadata
        .packages
        .iter()
        .filter(third_party)
        .cloned()
        .collect())
}
