//! Bytes of a pbrt file → tokens, one at a time: brackets, words and quoted strings.

use std::{io::BufRead, path::Path, rc::Rc};

use crate::{
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

    /// Reads the next token; none at the end of the file.
    ///
    /// # Errors
    /// [`Error::Io`], and [`Error::Parse`] for strings without an end, vast words and text that is
    /// not UTF-8.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_bounded() {
        let mut tokens = Tokens::new(Path::new("a.pbrt").into(), &b"abc"[..], 2);
        assert!(tokens.next().is_err());
    }
}
