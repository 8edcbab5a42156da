//! Files of a scene description: the main file, those that it includes, plain or compressed by gzip.

use std::{
    fs::File,
    io::{BufReader, Read},
    path::{Path, PathBuf},
    rc::Rc,
};

use flate2::read::MultiGzDecoder;

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
    stack: Vec<Open>,
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
        let first = Open { tokens: open(path, MAX_BYTES)?, restores: false };
        let inputs = vec![path.into()];
        Ok(Self { folder, stack: vec![first], held: None, inputs })
    }

    /// Next token, or the end of an imported file or of everything.
    pub(super) fn next(&mut self) -> Result<Part> {
        if let Some(token) = self.held.take() {
            return Ok(Part::Token(token));
        }
        loop {
            let Some(open) = self.stack.last_mut() else { return Ok(Part::End) };
            if let Some(token) = open.tokens.next()? {
                return Ok(Part::Token(token));
            }
            if self.stack.len() == 1 {
                return Ok(Part::End);
            }
            let Some(closed) = self.stack.pop() else { return Ok(Part::End) };
            // All files together have so many bytes.
            if let Some(open) = self.stack.last_mut() {
                open.tokens.bytes_left = closed.tokens.bytes_left;
            }
            if closed.restores {
                return Ok(Part::EndOfImport);
            }
        }
    }

    /// Next token of the file in hand; none at its end, which stays to be read by `next`.
    pub(super) fn next_here(&mut self) -> Result<Option<Token>> {
        match (self.held.take(), self.stack.last_mut()) {
            (None, Some(open)) => open.tokens.next(),
            (held, _) => Ok(held),
        }
    }

    /// Returns the last token to be read again.
    pub(super) fn hold(&mut self, token: Token) {
        self.held = Some(token);
    }

    /// Characters of the last token.
    pub(super) fn text(&self) -> &str {
        self.stack.last().map_or("", |open| &open.tokens.text)
    }

    /// Place of the last token.
    pub(super) fn place(&self) -> Place {
        match self.stack.last() {
            Some(open) => open.tokens.place.clone(),
            None => Place { path: Rc::from(&*self.folder.path), line: 0, column: 0 },
        }
    }

    /// Goes on with another file, until its end. `restores` marks an import.
    pub(super) fn include(&mut self, name: &str, restores: bool, place: &Place) -> Result<()> {
        let path = self.folder.file(name).map_err(|message| place.error(message))?;
        if self.stack.iter().any(|open| files::is_same_file(&open.tokens.place.path, &path)) {
            return Err(place.error(format!("`{name}` includes itself")));
        }
        if self.stack.len() == MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} files include one another");
            return Err(place.error(message));
        }
        if self.inputs.len() > MAX_INCLUDES {
            return Err(place.error(format!("more than {MAX_INCLUDES} files are included")));
        }
        let left = self.stack.last().map_or(MAX_BYTES, |open| open.tokens.bytes_left);
        let tokens = open(&path, left).map_err(|error| place.error(error.to_string()))?;
        self.inputs.push(path);
        self.stack.push(Open { tokens, restores });
        Ok(())
    }
}

fn open(path: &Path, most_bytes: u64) -> Result<FileTokens> {
    let file: File = files::open_regular(path)?;
    let reader: Box<dyn Read> = if files::extension(path) == "gz" {
        Box::new(MultiGzDecoder::new(file))
    } else {
        Box::new(file)
    };
    let reader = BufReader::with_capacity(1 << 16, reader);
    Ok(Tokens::new(Rc::from(path), reader, most_bytes))
}
