//! A render or a study on a thread of its own, while Python's thread hears of it and of signals.

use std::{
    panic::resume_unwind,
    sync::mpsc::{RecvTimeoutError, Sender, channel},
    thread,
    time::Duration,
};

use fenestra::session::{self, Event, Flag, Observer};
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};

use super::{exception, logging};

/// Interval of looks at signals.
const INTERVAL: Duration = Duration::from_millis(50);

/// State of a render, for callbacks.
#[pyclass(frozen, get_all, module = "fenestra._fenestra")]
pub(super) struct Standing {
    /// Fraction done, 0…1, by the stop rule that will be met first.
    fraction: f64,
    /// Camera paths per pixel so far.
    samples: u32,
    /// Wall time until the end, seconds; `None` if unknown.
    seconds_left: Option<f64>,
    /// Rays per second so far; 0 if unknown.
    rays_per_second: f64,
    /// Mean relative standard error, if known.
    error: Option<f64>,
}

/// Observer that sends each standing to Python's thread.
pub(super) struct Follower {
    flag: Flag,
    sender: Sender<session::Standing>,
}

impl Observer for Follower {
    fn interrupt(&self) -> Flag {
        self.flag.clone()
    }

    fn notice(&mut self, event: &Event<'_>) {
        match event {
            // Python's thread listens until the work is done.
            Event::Pass { standing, .. } => drop(self.sender.send(*standing)),
            Event::Note(line) => log::info!("{line}"),
            Event::Look(_) => {}
        }
    }
}

/// Runs `work`, and calls `progress` with each [`Standing`]. Its first exception and signals end the work;
/// after a KeyboardInterrupt the work's result counts, if there is one.
pub(super) fn follow<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(Follower) -> fenestra::Result<T> + Send,
) -> PyResult<T> {
    logging::listen();
    let flag = Flag::default();
    let (sender, mut receiver) = channel();
    let follower = Follower { flag: flag.clone(), sender };
    let mut raised = None;
    let result = thread::scope(|scope| {
        let worker = scope.spawn(move || work(follower));
        loop {
            let news;
            (receiver, news) = py.detach(move || {
                let news = receiver.recv_timeout(INTERVAL);
                (receiver, news)
            });
            let standing = match news {
                Ok(standing) => Some(standing),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break worker.join(),
            };
            let heard = match (progress, standing) {
                (Some(progress), Some(standing)) if raised.is_none() => call(progress, standing),
                _ => Ok(()),
            };
            let heard = heard.and_then(|()| logging::hand_on(py)).and_then(|()| py.check_signals());
            if let Err(error) = heard {
                raised.get_or_insert(error);
                flag.raise();
            }
        }
    });
    logging::hand_on(py)?;
    let result = result.unwrap_or_else(|panic| resume_unwind(panic));
    match (result, raised) {
        (result, None) => result.map_err(|error| exception(&error)),
        (Ok(value), Some(error)) if error.is_instance_of::<PyKeyboardInterrupt>(py) => Ok(value),
        (_, Some(error)) => Err(error),
    }
}

fn call(progress: &Bound<'_, PyAny>, standing: session::Standing) -> PyResult<()> {
    let standing = Standing {
        fraction: standing.fraction,
        samples: standing.samples,
        seconds_left: standing.seconds_left,
        rays_per_second: standing.rays_per_second,
        error: standing.relative_error.filter(|error| error.is_finite()),
    };
    progress.call1((standing,)).map(drop)
}
