//! What a person asks of a test.

/// A number that the environment sets.
pub fn asked(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |number| {
        number
            .parse()
            .unwrap_or_else(|_| panic!("{name} is {number}, expected a number"))
    })
}
