//! Attributes of XML tags, checked.

use super::super::one_line;
use super::Found;
use quick_xml::escape::unescape;
use quick_xml::events::BytesStart;

/// The attribute of that name, whatever its prefix; `&quot;` and the like as the characters that they stand for.
pub(super) fn value(tag: &BytesStart, name: &str) -> Option<String> {
    let mut all = tag.attributes();
    let mut all = all.with_checks(false).flatten();
    let raw = all.find(|a| a.key.local_name().as_ref() == name)?.value;
    Some(match unescape(&raw) {
        Ok(text) => text.into_owned(),
        Err(_) => raw.into_owned(),
    })
}

pub(super) fn required(tag: &BytesStart, name: &str) -> Found<String> {
    value(tag, name)
        .ok_or_else(|| format!("<{}> has no {name}", one_line(tag.local_name().as_ref())))
}

pub(super) fn number(tag: &BytesStart, name: &str) -> Found<u32> {
    let text = required(tag, name)?;
    text.trim().parse().map_err(|_| format!("{name} is \"{}\", not a count", one_line(&text)))
}

pub(super) fn coordinate(tag: &BytesStart, name: &str) -> Found<f64> {
    finite(&required(tag, name)?).map_err(|found| format!("coordinate {name} is {found}"))
}

pub(super) fn finite(text: &str) -> Found<f64> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(x) => Err(x.to_string()),
        Err(_) => Err(format!("\"{}\", not a number", one_line(text))),
    }
}

pub(super) fn unit_mm(name: Option<&str>) -> Found<f64> {
    Ok(match name {
        None | Some("millimeter") => 1.0,
        Some("micron") => 1e-3,
        Some("centimeter") => 10.0,
        Some("inch") => 25.4,
        Some("foot") => 304.8,
        Some("meter") => 1000.0,
        Some(other) => return Err(format!("the unit is \"{}\"", one_line(other))),
    })
}

/// The namespace of a prefix, if the tag binds it.
pub(super) fn namespace(tag: &BytesStart, prefix: &str) -> Option<String> {
    let mut all = tag.attributes();
    let mut all = all.with_checks(false).flatten();
    let binds = |key: &str| key.strip_prefix("xmlns:") == Some(prefix);
    all.find(|a| binds(a.key.as_ref())).map(|a| a.value.into_owned())
}
