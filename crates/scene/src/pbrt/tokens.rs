//! Files of a scene description, the main file and those that it includes, plain or compressed by gzip →
//! tokens, one at a time: brackets, words and quoted strings.

use std::{
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    rc::Rc,
};

use crate::{
    beside::Folder,
    error::{Error, Result},
    files,
};

/// Longest word or string, bytes.
const MAX_LENGTH: usize = 1 << 16;

/// Place in a file; line and column count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub path: Rc<Path>,
    pub line: usize,
    /// Column in bytes.
    pub column: usize,
}

impl Place {
    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(&self.path, self.line, self.column, message)
    }

    /// Place for a warning that begins with the path of the main file.
    pub(super) fn describe(&self, main: &Path) -> String {
        if *self.path == *main {
            format!("line {}", self.line)
        } else {
            format!("{}, line {}", self.path.display(), self.line)
        }
    }
}

/// Kind of a token; [`Tokens::text`] holds its characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token {
    /// `[`
    Open,
    Close,
    /// Characters up to a space, quote or bracket.
    Word,
    /// Characters between quotes, without them.
    Text,
}

/// Tokeniser that holds one token at a time.
pub(super) struct Tokens<R> {
    reader: R,
    line: usize,
    column: usize,
    /// Bytes that may still be read.
    pub(super) bytes_left: u64,
    buffer: Vec<u8>,
    pub(super) text: String,
    /// Place of the last token, or of the end of the file.
    pub(super) place: Place,
}

impl<R: BufRead> Tokens<R> {
    /// Starts at the first byte; more than `most_bytes` are an error.
    pub(super) fn new(path: Rc<Path>, reader: R, most_bytes: u64) -> Self {
        let place = Place { path, line: 1, column: 1 };
        let (buffer, text) = (Vec::new(), String::new());
        Self { reader, line: 1, column: 1, bytes_left: most_bytes, buffer, text, place }
    }

    /// Reads the next token; none at the end of the file. Fails for strings without an end, vast words and
    /// text that is not UTF-8.
    pub(super) fn next(&mut self) -> Result<Option<Token>> {
        self.buffer.clear();
        self.skip_blank()?;
        (self.place.line, self.place.column) = (self.line, self.column);
        let token = match self.peek()? {
            None => return Ok(None),
            Some(b'[') => self.take(Token::Open),
            Some(b']') => self.take(Token::Close),
            Some(b'"') => self.read_text()?,
            Some(_) => self.read_word()?,
        };
        self.text.clear();
        match std::str::from_utf8(&self.buffer) {
            Ok(text) => self.text.push_str(text),
            Err(_) if token == Token::Text => self.text.push_str(&files::decoded(&self.buffer)),
            Err(_) => return Err(self.place.error("not a text file: expected UTF-8")),
        }
        Ok(Some(token))
    }

    fn take(&mut self, token: Token) -> Token {
        self.advance();
        token
    }

    fn skip_blank(&mut self) -> Result<()> {
        let mut in_comment = false;
        loop {
            let bytes = available(&mut self.reader, &self.place, self.bytes_left)?;
            let mut passed = 0;
            for byte in bytes {
                match byte {
                    b'\n' | b'\r' => in_comment = false,
                    b'#' => in_comment = true,
                    _ if in_comment || byte.is_ascii_whitespace() => {}
                    _ => break,
                }
                self.column += 1;
                if *byte == b'\n' {
                    (self.line, self.column) = (self.line + 1, 1);
                }
                passed += 1;
            }
            let is_done = passed < bytes.len() || bytes.is_empty();
            self.consume(passed);
            if is_done {
                return Ok(());
            }
        }
    }

    fn read_word(&mut self) -> Result<Token> {
        let ends = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b'"' | b'[' | b']');
        loop {
            let bytes = available(&mut self.reader, &self.place, self.bytes_left)?;
            let length = bytes.iter().position(ends).unwrap_or(bytes.len());
            let is_done = length < bytes.len() || bytes.is_empty();
            if self.buffer.len() + length > MAX_LENGTH {
                return Err(self.too_long());
            }
            self.buffer.extend_from_slice(&bytes[..length]);
            self.column += length;
            self.consume(length);
            if is_done {
                return Ok(Token::Word);
            }
        }
    }

    fn read_text(&mut self) -> Result<Token> {
        let unended = "expected a closing quote before the end of the line, found none";
        self.advance();
        loop {
            let mut byte = match self.peek()? {
                None | Some(b'\n') => return Err(self.place.error(unended)),
                Some(byte) => byte,
            };
            self.advance();
            if byte == b'"' {
                return Ok(Token::Text);
            }
            if byte == b'\\' {
                byte = match self.peek()? {
                    Some(b'n') => b'\n',
                    Some(b't') => b'\t',
                    Some(b'r') => b'\r',
                    Some(b'b') => 8,
                    Some(b'f') => 12,
                    Some(found @ (b'\\' | b'"' | b'\'')) => found,
                    None => return Err(self.place.error(unended)),
                    Some(found) => {
                        let found = char::from(found).escape_default();
                        let expected = "expected one of b, f, n, r, t, \\, ' and \" after \\";
                        return Err(self.place.error(format!("{expected}, found {found}")));
                    }
                };
                self.advance();
            }
            if self.buffer.len() == MAX_LENGTH {
                return Err(self.too_long());
            }
            self.buffer.push(byte);
        }
    }

    fn too_long(&self) -> Error {
        self.place.error(format!("expected a word or string of at most {MAX_LENGTH} bytes"))
    }

    fn peek(&mut self) -> Result<Option<u8>> {
        let bytes = available(&mut self.reader, &self.place, self.bytes_left)?;
        Ok(bytes.first().copied())
    }

    /// Passes a byte that `peek` returned; it ends no line.
    fn advance(&mut self) {
        self.consume(1);
        self.column += 1;
    }

    fn consume(&mut self, count: usize) {
        self.reader.consume(count);
        self.bytes_left -= count as u64;
    }
}

/// Bytes that can be had at once, at most `most`; none at the end of the file.
fn available<'a>(reader: &'a mut impl BufRead, place: &Place, most: u64) -> Result<&'a [u8]> {
    let bytes = reader.fill_buf().map_err(|source| Error::io(&place.path, "read", source))?;
    if most == 0 && !bytes.is_empty() {
        return Err(place.error("the file is larger than a scene description may be"));
    }
    Ok(&bytes[..bytes.len().min(usize::try_from(most).unwrap_or(usize::MAX))])
}

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
    folder: Folder,
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
    /// Opens the main file, whose names start in `folder`. Fails for a device, and for a file that cannot be
    /// read.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_bounded() {
        let mut tokens = Tokens::new(Path::new("a.pbrt").into(), &b"abc"[..], 2);
        assert!(tokens.next().is_err());
    }
}
