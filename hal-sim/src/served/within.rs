//! A line to a simulated drive within the program.

use super::{LineId, Serving};
use link::host::client::Line;
use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// A line on which a millisecond passes each time somebody listens, whatever the clock says.
#[derive(Clone, Debug)]
pub struct Within {
    serving: Rc<RefCell<Serving>>,
    id: LineId,
    began: Instant,
    passed: Duration,
}

impl Within {
    /// A new line to `serving`.
    #[must_use]
    pub fn open(serving: &Rc<RefCell<Serving>>) -> Self {
        let id = serving.borrow_mut().open();
        Self {
            serving: Rc::clone(serving),
            id,
            began: Instant::now(),
            passed: Duration::ZERO,
        }
    }
}

impl Within {
    /// Its host is gone.
    pub fn close(&self) {
        self.serving.borrow_mut().close(self.id);
    }
}

impl Line for Within {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.serving.borrow_mut().receive(self.id, bytes);
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], _: Duration) -> io::Result<usize> {
        let mut serving = self.serving.borrow_mut();
        serving.millisecond();
        self.passed += Duration::from_millis(1);
        let goes = serving.outgoing(self.id);
        let count = goes.len().min(bytes.len());
        bytes[..count].copy_from_slice(&goes[..count]);
        serving.sent(self.id, count);
        Ok(count)
    }

    fn now(&self) -> Instant {
        self.began + self.passed
    }
}
