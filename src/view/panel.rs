//! The window as the rendering thread sees it: input from it, and pictures to it.

use std::{
    collections::VecDeque,
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, TryRecvError},
    },
    time::Duration,
};

use super::{
    keys::Action,
    message::{Input, Setting},
    projector::{Overlay, Place, Projector},
};
use crate::{
    error::{Error, Result},
    film::{Tone, tone::auto_exposure},
    gpu::{Buffer, Device, Presented, Swapchain, swapchain::Target},
    shader::constants::SHOW_PICTURE,
};

pub(crate) struct Panel {
    inputs: Receiver<Input>,
    /// Input that waits for the end of a pass.
    pub(super) pending: VecDeque<Input>,
    pub(super) projector: Projector,
    swapchain: Swapchain,
    size: [u32; 2],
    pub(super) tone: Tone,
    /// Layer that is shown, `SHOW_…`.
    pub(super) layer: u32,
    pub(super) has_right: bool,
    /// True while the camera moves: its small films are finished and shown, whatever comes.
    pub(super) is_moving: bool,
    /// Place of the pointer, pixels of the window.
    pub(super) pointer: Option<[f64; 2]>,
    /// True if a setting has changed since it was announced.
    pub(super) is_changed: bool,
    /// Failure between the waves of a pass, which cannot return it.
    pub(super) failure: Option<Error>,
}

impl Panel {
    /// Connects a window of `size` pixels. Fails if the device cannot show pictures there.
    pub(crate) fn new(
        device: &Arc<Device>,
        window: Arc<dyn Target>,
        size: [u32; 2],
        projector: Projector,
        inputs: Receiver<Input>,
        tone: Tone,
    ) -> Result<Self> {
        Ok(Self {
            inputs,
            pending: VecDeque::new(),
            projector,
            swapchain: Swapchain::new(device, window, size)?,
            size,
            tone,
            layer: 0,
            has_right: false,
            is_moving: false,
            pointer: None,
            is_changed: false,
            failure: None,
        })
    }

    /// Takes all input that is there, and acts on what needs no renderer. Returns true if a pass under way
    /// is worth nothing more.
    pub(crate) fn attend(&mut self) -> bool {
        loop {
            match self.inputs.try_recv() {
                Ok(input) => self.take(input),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    self.pending.push_back(Input::Close);
                    break;
                }
            }
        }
        self.failure.is_some() || self.pending.iter().any(|input| input.restarts())
    }

    /// Waits for input, for this long at most.
    pub(crate) fn wait(&mut self, longest: Duration) {
        match self.inputs.recv_timeout(longest) {
            Ok(input) => self.take(input),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => self.pending.push_back(Input::Close),
        }
    }

    fn take(&mut self, input: Input) {
        let acted = match input {
            Input::Key(Action::Exposure(stops)) => self.change(|tone| tone.exposure += stops),
            Input::Set(Setting::Exposure(stops)) => self.change(|tone| tone.exposure = stops),
            Input::Set(Setting::Curve(curve)) => self.change(|tone| tone.curve = curve),
            Input::Key(Action::AutoExposure) if self.layer == SHOW_PICTURE => {
                let shown = self.projector.shown(Place::Left);
                shown.and_then(|shown| self.change(|tone| tone.exposure = auto_exposure(&shown)))
            }
            Input::Key(Action::AutoExposure) => self.present(),
            Input::Key(Action::Curve) => {
                let all = crate::film::Curve::ALL;
                let now = all.iter().position(|curve| *curve == self.tone.curve).unwrap_or(0);
                self.change(|tone| tone.curve = all[(now + 1) % all.len()])
            }
            Input::Overlay(overlay) => {
                self.projector.set_overlay(overlay).and_then(|_| self.present())
            }
            Input::Pointer(at) => {
                self.pointer = Some(at);
                self.pending.push_back(input);
                Ok(())
            }
            Input::Resized(size) => {
                self.size = size;
                self.swapchain.resize(size).and_then(|()| self.present())
            }
            Input::Redraw => self.present(),
            other => {
                self.pending.push_back(other);
                Ok(())
            }
        };
        if let Err(error) = acted {
            self.failure.get_or_insert(error);
        }
    }

    /// Changes exposure or curve of the picture that is there.
    fn change(&mut self, change: impl FnOnce(&mut Tone)) -> Result<()> {
        change(&mut self.tone);
        self.is_changed = true;
        self.present()
    }

    /// Shows what the projector has. Fails if the device does or the window is gone.
    pub(crate) fn present(&mut self) -> Result<()> {
        // Twice: a window may change its size or lose its surface once in between.
        for _ in 0..2 {
            let size = self.swapchain.size;
            if size.contains(&0) {
                return Ok(());
            }
            let pixels = self.compose(size, self.swapchain.is_bgra)?;
            match self.swapchain.present(&pixels)? {
                Presented::Done => return Ok(()),
                Presented::Outdated => self.swapchain.resize(self.size)?,
                Presented::Lost => {
                    log::warn!("the window lost its surface; making another");
                    self.swapchain.renew(self.size).map_err(|error| Error::Device {
                        reason: format!("the display is gone: {error}"),
                        help: "`fenestra render` writes files and needs no display".into(),
                    })?;
                }
            }
        }
        Ok(())
    }

    /// Returns what the window shows without controls: its width, and red, green, blue of each pixel. Fails
    /// if the device does.
    pub(crate) fn picture(&mut self) -> Result<(u32, Vec<[u8; 3]>)> {
        let mut size = self.swapchain.size;
        if size.contains(&0) {
            return Err(Error::usage("the window has no pixels to write"));
        }
        let overlay = self.projector.set_overlay(Overlay::default())?;
        size[0] = size[0].saturating_sub(overlay.reserved).max(1);
        let pixels = self.compose(size, false)?;
        let pixels: Vec<[u8; 4]> = pixels.download(size[0] as usize * size[1] as usize)?;
        self.projector.set_overlay(overlay)?;
        Ok((size[0], pixels.into_iter().map(|[red, green, blue, _]| [red, green, blue]).collect()))
    }

    fn compose(&mut self, size: [u32; 2], is_bgra: bool) -> Result<Buffer> {
        // Exposure and curve are for the picture; colours of other layers are shown as they are.
        let tone = if self.layer == SHOW_PICTURE { self.tone } else { Tone::default() };
        self.projector.compose(size, self.has_right, tone, is_bgra)
    }
}
