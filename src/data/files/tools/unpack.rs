//! What a file is before it is read: text, a packed library, or none of it.

use super::place;
use crate::storage::input_file;
use crate::{Error, Result};
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;
use zip::ZipArchive;

/// The content of a file of tools.
pub(super) enum Content<'a> {
    Text(Cow<'a, str>),
    /// Text that is not UTF-8, by Windows-1252.
    Western(String),
    /// The library of a Fusion 360 `.tools` file.
    Library(Vec<u8>),
}

/// Text, or the library that an archive holds.
///
/// # Errors
/// If it is a web page, another archive, or no text in UTF-8 or UTF-16.
pub(super) fn content<'a>(bytes: &'a [u8], path: &Path) -> Result<Content<'a>> {
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        return unpacked(bytes, path).map(Content::Library);
    }
    let text = utf16(bytes);
    if let Some(kind) = input_file::foreign(text.as_deref().map_or(bytes, str::as_bytes)) {
        return Err(kind.error(path, "a file of tools"));
    }
    let text = match text {
        Some(text) => place::text(text.as_bytes(), path)?.into_owned().into(),
        None => match place::text(bytes, path) {
            Err(error) => {
                let western = western(bytes).ok_or(error)?;
                return Ok(Content::Western(place::text(western.as_bytes(), path)?.into_owned()));
            }
            text => text?,
        },
    };
    Ok(Content::Text(text))
}

/// The text of a table in Windows-1252, as Excel writes it in the west; none if it has characters that no text has.
fn western(bytes: &[u8]) -> Option<String> {
    const HIGH: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";
    let high: Vec<char> = HIGH.chars().collect();
    let of = |byte: &u8| match byte {
        0..=8 | 0x0e..=0x1f | 0x7f | 0x81 | 0x8d | 0x8f | 0x90 | 0x9d => None,
        0x80..=0x9f => high.get(usize::from(byte - 0x80)).copied(),
        _ => Some(char::from(*byte)),
    };
    bytes.iter().map(of).collect()
}

/// A text in UTF-16 with its mark, as `.hsmlib` files are; what is no character is shown as that.
fn utf16(bytes: &[u8]) -> Option<String> {
    let is_big = match bytes {
        [0xff, 0xfe, ..] => false,
        [0xfe, 0xff, ..] => true,
        _ => return None,
    };
    let unit = |pair: &[u8]| match is_big {
        true => u16::from_be_bytes([pair[0], pair[1]]),
        false => u16::from_le_bytes([pair[0], pair[1]]),
    };
    let units = bytes.chunks_exact(2).map(unit);
    let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    // Some programs write a second mark behind the first line.
    Some(text.filter(|c| *c != '\u{feff}').collect())
}

/// `tools.json`, or the only JSON file beside what systems add.
fn unpacked(bytes: &[u8], path: &Path) -> Result<Vec<u8>> {
    let fault = |found: String, remedy: &str| Error::file(path, "zip archive", found, remedy);
    let again = "export the library again";
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|e| fault(e.to_string(), again))?;
    let names: Vec<String> = archive.file_names().flatten().map(Cow::into_owned).collect();
    let is_json = |name: &&String| {
        let last = name.rsplit('/').next().unwrap_or(name);
        last.to_lowercase().ends_with(".json")
            && !last.starts_with("._")
            && !name.starts_with("__MACOSX")
    };
    let jsons: Vec<&String> = names.iter().filter(is_json).collect();
    let tools = jsons.iter().find(|name| name.to_lowercase().ends_with("tools.json"));
    let name = match (tools, &jsons[..]) {
        (Some(name), _) | (None, [name]) => name,
        _ => {
            let has = |start: &str| names.iter().any(|name| name.starts_with(start));
            let found = match (has("xl/"), has("content.xml")) {
                (true, _) => "it is an Excel workbook, not a table in text",
                (_, true) => "it is an OpenDocument sheet, not a table in text",
                _ => "it is a ZIP archive without a library (tools.json)",
            };
            return Err(fault(found.into(), "save the sheet as CSV, or unpack the archive"));
        }
    };
    let entry = archive.by_name(name).map_err(|e| fault(e.to_string(), again))?;
    let size = entry.size();
    input_file::read_entry(entry, size, path, input_file::LIBRARY)
}
