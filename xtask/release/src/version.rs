//! The version that the changelog describes.

use anyhow::{Result, bail, ensure};

/// Checks that the newest section of `changelog` with a number is `version`, and that nothing waits above it.
///
/// # Errors
/// Version and changelog disagree.
pub fn released(changelog: &str, version: &str) -> Result<()> {
    let mut waiting = false;
    for line in changelog.lines() {
        match line
            .strip_prefix("## [")
            .and_then(|rest| rest.split_once(']'))
        {
            Some(("Unreleased", _)) => waiting = false,
            Some((number, date)) => {
                ensure!(
                    number == version,
                    "CHANGELOG.md has {number} as its newest version, but Cargo.toml has {version}: make both equal"
                );
                ensure!(
                    date.trim_start_matches([' ', '-']).len() == "2026-01-31".len(),
                    "CHANGELOG.md has no date for {number}: write `## [{number}] - YYYY-MM-DD`"
                );
                ensure!(
                    !waiting,
                    "CHANGELOG.md has entries under [Unreleased]: move them to [{version}], or raise the version in Cargo.toml"
                );
                return Ok(());
            }
            None => waiting |= line.starts_with("- "),
        }
    }
    bail!(
        "CHANGELOG.md has no version with a number, but Cargo.toml has {version}: add `## [{version}] - YYYY-MM-DD`, \
         or build with --snapshot"
    )
}

#[cfg(test)]
mod tests {
    use super::released;

    fn refused(changelog: &str) -> String {
        released(changelog, "0.2.0").unwrap_err().to_string()
    }

    #[test]
    fn version_and_changelog_agree() {
        let changelog = "# Changelog\n\n## [Unreleased]\n\n## [0.2.0] - 2026-11-26\n\n- Moves.\n\n## [0.1.0] - 2026-01-01\n";
        released(changelog, "0.2.0").unwrap();
    }

    #[test]
    fn each_disagreement_is_named() {
        assert!(refused("## [0.1.0] - 2026-01-01\n").contains("0.1.0 as its newest"));
        assert!(
            refused("## [Unreleased]\n- New.\n## [0.2.0] - 2026-01-01\n").contains("[Unreleased]")
        );
        assert!(refused("## [0.2.0]\n").contains("no date"));
        assert!(refused("## [Unreleased]\n- New.\n").contains("no version with a number"));
    }
}
