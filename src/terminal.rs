//! Messages to the user. A line that cannot be written is lost, never the picture; and no name in a file
//! steers the terminal.

use std::{
    fmt::{Arguments, Write as _},
    io::{self, Write as _},
};

/// Says a line on standard error, formatted as by `format!`.
macro_rules! say {
    ($($argument:tt)*) => {
        $crate::terminal::say_line(format_args!($($argument)*))
    };
}
pub(crate) use say;

/// See [`say!`]. `eprintln!` would panic where standard error is a closed pipe or terminal, or a full disk.
pub(crate) fn say_line(line: Arguments<'_>) {
    let line = message(&line.to_string()) + "\n";
    io::stderr().lock().write_all(line.as_bytes()).ok();
}

/// [`escaped`] text with its later lines indented: one from a name must not pass for a message of its own.
pub(crate) fn message(text: &str) -> String {
    escaped(text).replace('\n', "\n  ")
}

/// Replaces control characters, C1 and delete among them, by their escapes of JSON; line breaks and tabs
/// stay.
pub(crate) fn escaped(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() && !matches!(character, '\n' | '\t') {
            write!(shown, "\\u{:04x}", u32::from(character)).ok();
        } else {
            shown.push(character);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::{escaped, message};

    #[test]
    fn nothing_steers_the_terminal() {
        assert_eq!(escaped("a\x1b[2J\u{9b}31m\r\x7f"), "a\\u001b[2J\\u009b31m\\u000d\\u007f");
        assert_eq!(escaped("größer:\n\tund breiter"), "größer:\n\tund breiter");
        assert_eq!(message("a\nerror: b"), "a\n  error: b");
    }
}
