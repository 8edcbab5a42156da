//! Bytes of a pbrt file → tokens, one at a time: brackets, words and quoted strings.

use std::{io::BufRead, path::Path, rc::Rc};

use crate::error::{Error, Result};

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
        match std::str::from_utf8(&self.buffer) {
            Ok(text) => {
                self.text.clear();
                self.text.push_str(text);
                Ok(Some(token))
            }
            Err(_) => Err(self.place.error("not a text file: expected UTF-8")),
        }
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
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn tokens(text: &[u8]) -> Tokens<&[u8]> {
        Tokens::new(Path::new("a.pbrt").into(), text, 1 << 20)
    }

    fn all(text: &str) -> Vec<(Token, String, usize, usize)> {
        let mut tokens = tokens(text.as_bytes());
        let mut found = Vec::new();
        while let Some(token) = tokens.next().unwrap() {
            let place = tokens.place.clone();
            found.push((token, tokens.text.to_owned(), place.line, place.column));
        }
        found
    }

    #[test]
    fn words_strings_brackets_and_comments() {
        let found = all("A\"b c\"[1 -.5e3]# note \"[\n \"q\\\"\\\\\"x");
        let expected = [
            (Token::Word, "A", 1, 1),
            (Token::Text, "b c", 1, 2),
            (Token::Open, "", 1, 7),
            (Token::Word, "1", 1, 8),
            (Token::Word, "-.5e3", 1, 10),
            (Token::Close, "", 1, 15),
            (Token::Text, "q\"\\", 2, 2),
            (Token::Word, "x", 2, 9),
        ];
        let expected = expected.map(|(token, text, line, at)| (token, text.to_owned(), line, at));
        assert_eq!(found, expected);
    }

    #[test]
    fn bad_text_is_an_error_with_its_place() {
        let message = |text: &[u8]| {
            let mut tokens = tokens(text);
            loop {
                match tokens.next() {
                    Ok(Some(_)) => {}
                    Ok(None) => return None,
                    Err(error) => return Some(error.to_string()),
                }
            }
        };
        let found = message(b"a\n \"b\nc\"").unwrap();
        assert!(found.starts_with("a.pbrt:2:2: expected a closing quote"), "{found}");
        assert!(message(b"\"b").unwrap().contains("a.pbrt:1:1: expected a closing quote"));
        assert!(message(b"\"\\q\"").unwrap().contains("after \\, found q"));
        assert!(message(b"\xff").unwrap().contains("UTF-8"));
        assert!(message(&[b'x'; MAX_LENGTH + 1]).unwrap().contains("at most"));
        let mut short = Tokens::new(Path::new("a.pbrt").into(), &b"abc"[..], 2);
        assert!(short.next().is_err());
    }
}
