//! A reader of lines and numbers of text files that knows the line of every fault.

use super::one_line;
use glam::DVec3;
use std::borrow::Cow;

/// The lines of a text file with their numbers, from 1; they end in LF, CRLF or CR. Bytes that are not UTF-8
/// (names in old encodings) become replacement characters.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        Lines { rest, number: 0 }
    }

    /// Lines of the part of a file that follows line `number`.
    pub(super) fn after(rest: &'a [u8], number: usize) -> Self {
        Lines { rest, number }
    }

    /// What follows the lines that were taken.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, str>);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let is_end = |b: &u8| matches!(b, b'\n' | b'\r');
        let end = self.rest.iter().position(is_end).unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        let next = if self.rest[end..].starts_with(b"\r\n") { end + 2 } else { end + 1 };
        self.rest = self.rest.get(next..).unwrap_or(&[]);
        self.number += 1;
        Some((self.number, String::from_utf8_lossy(line)))
    }
}

/// Three finite coordinates; the error says what stands there instead.
pub(super) fn coordinates<'a>(
    mut tokens: impl Iterator<Item = &'a str>,
) -> std::result::Result<DVec3, String> {
    let mut xyz = [0.0_f64; 3];
    for (value, name) in xyz.iter_mut().zip(["x", "y", "z"]) {
        let token = tokens.next().ok_or_else(|| format!("coordinate {name} is missing"))?;
        *value = token
            .parse()
            .map_err(|_| format!("coordinate {name} is \"{}\", not a number", one_line(token)))?;
        if !value.is_finite() {
            return Err(format!("coordinate {name} is {value}"));
        }
    }
    Ok(DVec3::from_array(xyz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_from_one_and_survive_foreign_bytes() {
        let lines: Vec<_> = Lines::new(b"\xef\xbb\xbfa\r\n\nb\xff").collect();
        assert_eq!(lines.iter().map(|l| l.0).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!(lines[0].1.trim(), "a");
        assert_eq!(lines[2].1, "b\u{fffd}");
    }

    #[test]
    fn lines_end_in_any_of_the_three_ways() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["a", "", "b", ""].join(end);
            let lines: Vec<_> = Lines::new(text.as_bytes()).map(|l| (l.0, l.1.into())).collect();
            let expected = [(1, "a".to_string()), (2, String::new()), (3, "b".into())];
            assert_eq!(lines, expected, "{end:?}");
        }
    }

    #[test]
    fn coordinates_must_be_three_finite_numbers() {
        let read = |text: &'static str| coordinates(text.split_whitespace());
        assert_eq!(read("1 -2e3 .5 9"), Ok(DVec3::new(1.0, -2e3, 0.5)));
        assert_eq!(read("1 2"), Err("coordinate z is missing".into()));
        assert_eq!(read("1 nan 2"), Err("coordinate y is NaN".into()));
        assert_eq!(read("1e999 1 2"), Err("coordinate x is inf".into()));
        assert!(read("1 2 3,5").unwrap_err().contains("\"3,5\""));
    }
}
