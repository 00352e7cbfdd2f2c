//! Where a command's words go: text for people, or one JSON object for programs.
#![allow(clippy::print_stdout, clippy::print_stderr)]

/// The program's standard streams.
pub struct Output {
    json: bool,
}

impl Output {
    pub fn new(json: bool) -> Self {
        Output { json }
    }

    /// A line for people: standard output, or standard error when that carries JSON.
    pub fn say(&self, line: impl std::fmt::Display) {
        if self.json {
            eprintln!("{line}");
        } else {
            println!("{line}");
        }
    }

    /// A warning, on standard error.
    pub fn warn(&self, line: impl std::fmt::Display) {
        eprintln!("warning: {line}");
    }

    /// The failure that ends the program, on standard error.
    pub fn error(&self, error: &deepmill::Error) {
        eprintln!("error: {error}");
    }

    /// The machine-readable result; printed only under `--json`, once per run.
    pub fn result(&self, value: &serde_json::Value) {
        if self.json {
            println!("{value}");
        }
    }
}
