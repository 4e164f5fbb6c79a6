//! Tests on what is not the project's own: recordings and measured data beside it, compilers and sources that a machine
//! may not have. Where it is missing the test is ignored, by name and with what it needs; it never passes.
//!
//! A test target with `harness = false` lists its tests; each is given the folder that it needs:
//!
//! ```no_run
//! use std::path::Path;
//!
//! fn the_models_load(recordings: &Path) {
//!     assert!(recordings.join("open-01").exists());
//! }
//!
//! given::shared_tests! {
//!     "recordings" => the_models_load;
//! }
//! ```
#![forbid(unsafe_code)]

pub mod pages;

use libtest_mimic::{Arguments, Trial};
use std::path::{Path, PathBuf};

/// The variable that says where the shared data are, if they are not beside the project.
pub const VARIABLE: &str = "DDFEED_SHARED";

/// The folder of the shared data: `../shared`, or where [`VARIABLE`] points. It need not be there.
#[must_use]
pub fn shared() -> PathBuf {
    if let Some(folder) = std::env::var_os(VARIABLE) {
        return PathBuf::from(folder);
    }
    // Cargo runs a test in its package's folder.
    let here = std::env::current_dir().unwrap_or_default();
    let root = here
        .ancestors()
        .find(|folder| folder.join("Cargo.lock").is_file());
    root.unwrap_or(&here).join("../shared")
}

/// A test that needs something given.
pub struct Test {
    name: &'static str,
    needs: String,
    folder: Option<PathBuf>,
    run: fn(&Path),
}

impl Test {
    /// A test on the folder `what` of the shared data.
    #[must_use]
    pub fn on_shared(what: &str, name: &'static str, run: fn(&Path)) -> Self {
        let folder = shared().join(what);
        Self::new(
            format!("../shared/{what}, or {VARIABLE}"),
            folder.is_dir().then_some(folder),
            name,
            run,
        )
    }

    /// A test on `folder`, and if there is none, on nothing: `needs` says what is missing.
    #[must_use]
    pub fn new(needs: String, folder: Option<PathBuf>, name: &'static str, run: fn(&Path)) -> Self {
        Self {
            name,
            needs,
            folder,
            run,
        }
    }
}

impl From<Test> for Trial {
    fn from(test: Test) -> Self {
        let Test {
            name,
            needs,
            folder,
            run,
        } = test;
        let Some(folder) = folder else {
            // What runs with --ignored fails: it has shown nothing.
            let error = format!("{needs} is not there");
            let trial = Trial::test(name, || Err(error.into()));
            return trial
                .with_kind(format!("needs {needs}"))
                .with_ignored_flag(true);
        };
        Trial::test(name, move || {
            run(&folder);
            Ok(())
        })
    }
}

/// Runs the tests as the standard harness does, with its arguments, and ends the process.
pub fn run(tests: impl IntoIterator<Item = Test>) -> ! {
    let trials = tests.into_iter().map(Trial::from).collect();
    libtest_mimic::run(&Arguments::from_args(), trials).exit()
}

/// The main function of a test target: for each folder of the shared data the tests that need it.
#[macro_export]
macro_rules! shared_tests {
    ($($what:literal => $($test:ident),+;)+) => {
        fn main() {
            $crate::run([$($($crate::Test::on_shared($what, stringify!($test), $test),)+)+])
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_test_without_what_it_needs_is_ignored_by_name() {
        let trial = |folder| Trial::from(Test::new("the moon".into(), folder, "a_landing", |_| ()));
        let missing = trial(None);
        assert!(missing.has_ignored_flag());
        assert_eq!(
            (missing.name(), missing.kind()),
            ("a_landing", "needs the moon")
        );
        assert!(!trial(Some(PathBuf::from("."))).has_ignored_flag());
    }
}
