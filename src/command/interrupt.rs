//! Ctrl-C, SIGTERM and SIGHUP.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::{session::Flag, terminal::say};

/// Interrupts of this process. One while there is nothing to lose, and a second one, end it at once
/// with status 130; another is noted for the caller, who writes what there is.
#[derive(Debug, Default)]
pub(crate) struct Interrupt {
    /// Raised once there was an interrupt.
    pub(crate) flag: Flag,
    has_caller: AtomicBool,
}

impl Interrupt {
    pub(crate) fn listen() -> Arc<Self> {
        let interrupt = Arc::new(Self::default());
        let heard = Arc::clone(&interrupt);
        let listening = ctrlc::set_handler(move || {
            let waits = heard.has_caller.load(Ordering::SeqCst);
            if !waits {
                say!("error: interrupted before anything was rendered");
            }
            if heard.flag.raise() || !waits {
                std::process::exit(130);
            }
        });
        if let Err(error) = listening {
            log::warn!("Ctrl-C will end the program without writing the image: {error}");
        }
        interrupt
    }

    /// Leaves the first interrupt from now on to the caller, who looks at [`Interrupt::flag`].
    pub(crate) fn wait_for_caller(&self) {
        self.has_caller.store(true, Ordering::SeqCst);
    }
}
