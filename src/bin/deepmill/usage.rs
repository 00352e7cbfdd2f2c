//! Arguments that cannot be read: how they may be, then, last, what is wrong and what to do.

use crate::output::Output;
use clap::error::{ContextKind, ContextValue};
use deepmill::geom::units::Unit;
use std::process::ExitCode;

/// Prints the usage and the error; the code of the program.
pub fn refuse(error: &clap::Error) -> ExitCode {
    let text = error.render().to_string();
    let json = std::env::args_os().any(|arg| arg == "--json");
    let output = Output::new(json, Unit::Millimeter);
    let (wrong, others) = parts(&text);
    if let Some(usage) = others.iter().find(|part| part.starts_with("Usage:")) {
        output.note(usage);
    }
    let tips = others.iter().filter_map(|part| part.trim().strip_prefix("tip: "));
    let tips: Vec<String> = tips.map(joined).collect();
    let command = match error.get(ContextKind::Usage) {
        Some(ContextValue::StyledStr(usage)) => command(&usage.to_string()),
        _ => "deepmill".into(),
    };
    let remedy = match tips.is_empty() {
        true => format!("`{command} --help` explains the arguments"),
        false => tips.join("; "),
    };
    output.error_of_arguments(&format!("{wrong}; {remedy}"));
    ExitCode::from(2)
}

/// What is wrong, in one line, and the other parts.
fn parts(text: &str) -> (String, Vec<String>) {
    let mut parts = text.trim().split("\n\n").map(str::to_string);
    let wrong = parts.next().unwrap_or_default();
    let wrong = joined(wrong.trim_start_matches("error: "));
    (wrong, parts.flat_map(|part| tips_apart(&part)).collect())
}

/// Tips stand one below the other.
fn tips_apart(part: &str) -> Vec<String> {
    match part.trim_start().starts_with("tip:") {
        true => part
            .split("\n  tip:")
            .map(|tip| format!("tip: {}", tip.trim_start().trim_start_matches("tip:").trim_start()))
            .collect(),
        false => vec![part.to_string()],
    }
}

fn joined(text: &str) -> String {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// `deepmill label` of its usage.
fn command(usage: &str) -> String {
    let words = usage.split_whitespace().skip_while(|word| *word == "Usage:");
    let words = words.take_while(|word| {
        word.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !word.starts_with('-')
    });
    let command = words.collect::<Vec<_>>().join(" ");
    if command.is_empty() { "deepmill".into() } else { command }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_one_line_and_tips_are_kept() {
        let text = "error: the following required arguments were not provided:\n  --out <DIR>\n\nUsage: deepmill label \
                    --out <DIR> <PART>\n\nFor more information, try '--help'.\n";
        let (wrong, others) = parts(text);
        assert_eq!(wrong, "the following required arguments were not provided: --out <DIR>");
        assert!(others.iter().any(|part| part.starts_with("Usage: deepmill label")));
        let text = "error: unexpected argument '--ot' found\n\n  tip: a similar argument exists: '--out'\n  tip: or so\n";
        let (_, others) = parts(text);
        assert_eq!(others, ["tip: a similar argument exists: '--out'", "tip: or so"]);
        assert_eq!(command("Usage: deepmill label [OPTIONS] <PART>"), "deepmill label");
        assert_eq!(command("--out <DIR>"), "deepmill");
    }
}
