//! Files of a scene description: the main file, those that it includes, plain or compressed by gzip.

use std::{
    io::{BufReader, Read},
    path::{Path, PathBuf},
    rc::Rc,
};

use super::tokens::{Place, Token, Tokens};
use crate::{beside::Folder, error::Result, files};

/// Most files that may include one another.
const MAX_DEPTH: usize = 32;
/// Most files that are included; a file may be included many times.
const MAX_INCLUDES: usize = 1 << 12;
/// Most bytes of all files together, after decompression.
const MAX_BYTES: u64 = 1 << 33;

type FileTokens = Tokens<BufReader<Box<dyn Read>>>;

struct Open {
    tokens: FileTokens,
    /// True if the graphics state returns to what it was at the end of the file.
    restores: bool,
}

/// Tokens of the main file and of the files that it includes.
pub(super) struct Source {
    /// Folder of the main file, to which all paths are relative.
    pub(super) folder: Folder,
    open: Open,
    /// Files that include the open one, the main file first.
    outer: Vec<Open>,
    /// Last token, if it is to be read again.
    held: Option<Token>,
    pub inputs: Vec<PathBuf>,
}

/// Next part of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Token(Token),
    /// End of a file that `Import` named.
    EndOfImport,
    /// End of the main file.
    End,
}

impl Source {
    /// Opens the main file, whose names start in `folder`.
    ///
    /// # Errors
    /// [`Io`](crate::error::Error::Io), and [`Format`](crate::error::Error::Format) for a device.
    pub(super) fn open(path: &Path, folder: Folder) -> Result<Self> {
        let open = Open { tokens: open(path, MAX_BYTES)?, restores: false };
        Ok(Self { folder, open, outer: Vec::new(), held: None, inputs: vec![path.into()] })
    }

    /// Next token, or the end of an imported file or of everything.
    pub(super) fn next(&mut self) -> Result<Part> {
        Ok(match self.next_here()? {
            Some(token) => Part::Token(token),
            None if self.close() => Part::EndOfImport,
            None => Part::End,
        })
    }

    /// Next token; none at the end of an imported file or of the main one, which `next` tells.
    pub(super) fn next_here(&mut self) -> Result<Option<Token>> {
        loop {
            let token =
                self.held.take().map_or_else(|| self.open.tokens.next(), |t| Ok(Some(t)))?;
            // Parameters that begin in an included file may go on after it.
            if token.is_some() || self.open.restores || !self.close() {
                return Ok(token);
            }
        }
    }

    /// Returns to the file that includes the open one; false for the main one.
    fn close(&mut self) -> bool {
        let Some(outer) = self.outer.pop() else { return false };
        let closed = std::mem::replace(&mut self.open, outer);
        // All files together have so many bytes.
        self.open.tokens.bytes_left = closed.tokens.bytes_left;
        true
    }

    /// Returns the last token to be read again.
    pub(super) fn hold(&mut self, token: Token) {
        self.held = Some(token);
    }

    /// Characters of the last token.
    pub(super) fn text(&self) -> &str {
        &self.open.tokens.text
    }

    /// Place of the last token.
    pub(super) fn place(&self) -> Place {
        self.open.tokens.place.clone()
    }

    /// Goes on with another file, until its end. `restores` marks an import.
    pub(super) fn include(&mut self, name: &str, restores: bool, place: &Place) -> Result<()> {
        let path = self.folder.file(name).map_err(|message| place.error(message))?;
        let is_it = |open: &Open| files::is_same_file(&open.tokens.place.path, &path);
        if is_it(&self.open) || self.outer.iter().any(is_it) {
            return Err(place.error(format!("`{name}` includes itself")));
        }
        if self.outer.len() + 1 == MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} files include one another");
            return Err(place.error(message));
        }
        if self.inputs.len() > MAX_INCLUDES {
            return Err(place.error(format!("more than {MAX_INCLUDES} files are included")));
        }
        let tokens = open(&path, self.open.tokens.bytes_left)
            .map_err(|error| place.error(error.to_string()))?;
        self.inputs.push(path);
        self.outer.push(std::mem::replace(&mut self.open, Open { tokens, restores }));
        Ok(())
    }
}

fn open(path: &Path, most_bytes: u64) -> Result<FileTokens> {
    let (reader, _) = files::open_unpacked(path)?;
    Ok(Tokens::new(Rc::from(path), reader, most_bytes))
}
