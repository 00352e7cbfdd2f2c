//! Arguments that cannot be read: how they may be, then, last, what is wrong and what to do.

use crate::output::Output;
use clap::error::{ContextKind, ContextValue, ErrorKind};
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
    let tips: Vec<String> = tips.map(joined).filter(|tip| is_of_use(tip, &wrong)).collect();
    let command = match error.get(ContextKind::Usage) {
        Some(ContextValue::StyledStr(usage)) => command(&usage.to_string()),
        _ if error.kind() == ErrorKind::InvalidSubcommand => "deepmill".into(),
        _ => {
            let first = std::env::args_os().nth(1).unwrap_or_default();
            command(&format!("deepmill {}", first.to_string_lossy()))
        }
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

/// Whether a tip helps. None is of use that takes an option for a value, or names an argument with few of the letters
/// of the one that was given.
fn is_of_use(tip: &str, wrong: &str) -> bool {
    let quoted =
        |text: &str| text.split('\'').nth(1).map(|name| name.trim_start_matches('-').to_string());
    match (quoted(tip), quoted(wrong)) {
        _ if tip.starts_with("to pass ") => false,
        (Some(similar), Some(given)) if tip.starts_with("a similar argument exists") => {
            2 * n_edits(&similar, &given) <= similar.len().max(given.len())
        }
        _ => true,
    }
}

/// Least number of letters to be added, left out or changed to make one word of the other.
fn n_edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let changed = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
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

    #[test]
    fn tips_that_do_not_help_are_left_out() {
        let wrong = "unexpected argument '--search' found";
        assert!(!is_of_use("a similar argument exists: '--clearance'", wrong));
        assert!(!is_of_use("to pass '--search' as a value, use '-- --search'", wrong));
        assert!(is_of_use(
            "a similar argument exists: '--out'",
            "unexpected argument '--outt' found"
        ));
        assert!(is_of_use(
            "some similar subcommands exist: 'sample', 'label'",
            "unrecognized 'lable'"
        ));
        assert_eq!(
            [n_edits("out", "outt"), n_edits("", "ab"), n_edits("kitten", "sitting")],
            [1, 2, 3]
        );
    }
}
