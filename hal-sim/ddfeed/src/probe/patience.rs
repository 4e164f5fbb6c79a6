//! Work with a probe is done in a thread of its own, for a probe may never answer.

use anyhow::{Context, Error, Result, anyhow};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

/// How long probes may take to be listed.
pub const LIST: Duration = Duration::from_millis(1500);
/// A probe or chip that has not said anything for so long does not. With [`LIST`] less than five seconds.
pub const ANSWER: Duration = Duration::from_secs(3);

enum Event<E, T> {
    Said(E),
    Done(Result<T>),
}

/// Does `work`, for as long as it goes on saying something to `each` at least every `patience`.
///
/// # Errors
/// What `work` or `each` returns; or that `work` fell silent, in the words of `silent`, which hears whether it ever said something.
/// It is left to itself.
fn run<E: Send + 'static, T: Send + 'static>(
    patience: Duration,
    work: impl FnOnce(&dyn Fn(E)) -> Result<T> + Send + 'static,
    mut each: impl FnMut(E) -> Result<()>,
    silent: impl FnOnce(bool) -> Error,
) -> Result<T> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        // The receiver is gone once it has lost patience; then nobody is left to tell.
        let done = work(&|said| {
            let _ = sender.send(Event::Said(said));
        });
        let _ = sender.send(Event::Done(done));
    });
    let mut heard = false;
    loop {
        match receiver.recv_timeout(patience) {
            Ok(Event::Said(said)) => {
                heard = true;
                each(said)?;
            }
            Ok(Event::Done(done)) => return done,
            Err(RecvTimeoutError::Timeout) => return Err(silent(heard)),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(silent(heard)).context("the probe's driver gave up");
            }
        }
    }
}

/// It was to do `what`, and says nothing any more.
fn stuck(what: &str, patience: Duration) -> Error {
    anyhow!(
        "could not {what}: no answer within {:.1} s; unplug the probe and plug it in again",
        patience.as_secs_f64()
    )
}

/// Does `work` within `patience`.
pub fn watch<E: Send + 'static, T: Send + 'static>(
    what: &str,
    patience: Duration,
    work: impl FnOnce(&dyn Fn(E)) -> Result<T> + Send + 'static,
) -> Result<T> {
    run(patience, work, |_| Ok(()), |_| stuck(what, patience))
}

/// Does `work`, which may take long but must say something at least every [`ANSWER`].
pub fn watch_each<E: Send + 'static, T: Send + 'static>(
    what: &str,
    work: impl FnOnce(&dyn Fn(E)) -> Result<T> + Send + 'static,
    each: impl FnMut(E) -> Result<()>,
) -> Result<T> {
    watch_from(what, work, each, || stuck(what, ANSWER))
}

/// The same; if it never says anything, that is said in the words of `silent`.
pub fn watch_from<E: Send + 'static, T: Send + 'static>(
    what: &str,
    work: impl FnOnce(&dyn Fn(E)) -> Result<T> + Send + 'static,
    each: impl FnMut(E) -> Result<()>,
    silent: impl FnOnce() -> Error,
) -> Result<T> {
    run(ANSWER, work, each, |heard| match heard {
        true => stuck(what, ANSWER),
        false => silent(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn what_never_answers_is_given_up_in_time() {
        let start = Instant::now();
        let mut heard = 0;
        let error = watch_each(
            "read the chip",
            |say: &dyn Fn(u32)| {
                say(1);
                thread::sleep(10 * ANSWER);
                Ok(())
            },
            |number| {
                heard += number;
                Ok(())
            },
        )
        .unwrap_err();
        assert!(
            error.to_string().contains("could not read the chip"),
            "{error}"
        );
        assert_eq!(heard, 1);
        assert!(
            start.elapsed() + LIST < Duration::from_secs(5),
            "took {:?}, allowed 5 s less {LIST:?}",
            start.elapsed()
        );
    }

    #[test]
    fn what_goes_on_may_take_its_time_and_a_panic_is_an_error() {
        let work = |say: &dyn Fn(())| {
            for _ in 0..8 {
                thread::sleep(ANSWER / 4);
                say(());
            }
            Ok(7)
        };
        assert_eq!(watch_each("wait", work, |()| Ok(())).unwrap(), 7);
        let panics = |_: &dyn Fn(())| -> Result<()> { panic!("a driver's bug") };
        assert!(
            watch_each("wait", panics, |()| Ok(())).is_err(),
            "a wait that panicked was taken for done"
        );
    }
}
