//! A drive that is served within the program: its time goes on while a command listens, whatever the clock says.

use super::ServeOptions;
use super::flash::Flash;
use super::machine::MachineLine;
use super::switched_on::SwitchedOn;
use crate::drive::{Task, carry_out};
use anyhow::Result;
use hal_sim::served::{Serving, Within};
use link::host::client::{Client, Line};
use std::cell::RefCell;
use std::rc::Rc;

/// The drive.
pub struct ServedWithin {
    serving: Rc<RefCell<Serving>>,
    flash: Option<Flash>,
}

impl ServedWithin {
    /// Switches it on, and prints its machine.
    ///
    /// # Errors
    /// As `serve`.
    pub fn new(options: &ServeOptions) -> Result<Self> {
        let on = SwitchedOn::new(options)?;
        eprintln!("{}", MachineLine(&on.setup));
        Ok(Self {
            serving: Rc::new(RefCell::new(Serving::new(on.drive))),
            flash: on.flash,
        })
    }

    /// What `ddfeed drive` does at the drive's line. Its flash is kept afterwards.
    ///
    /// # Errors
    /// The command's.
    pub fn drive(&mut self, task: &Task) -> Result<()> {
        task.check()?;
        let line = Within::open(&self.serving);
        let boxed: Box<dyn Line> = Box::new(line.clone());
        let done = Client::open(boxed).and_then(|client| carry_out(client, task));
        line.close();
        if let Some(flash) = &mut self.flash {
            flash.keep(self.serving.borrow_mut().drive_mut())?;
        }
        done
    }
}
