//! Output of a command: text for people, or one JSON object for programs.

use deepmill::Error;
use serde_json::{Value, json};
use std::fmt::Display;
use std::io::{Write, stderr, stdout};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// The program's standard streams. A reader that goes away is no failure.
pub struct Output {
    json: bool,
    /// Whether the result is printed.
    done: AtomicBool,
}

impl Output {
    pub fn new(json: bool) -> Self {
        Output { json, done: AtomicBool::new(false) }
    }

    /// A line for people: standard output, or standard error when that carries JSON.
    pub fn say(&self, line: impl Display) {
        let _ = match self.json {
            true => writeln!(stderr(), "{line}"),
            false => writeln!(stdout(), "{line}"),
        };
    }

    /// A warning, on standard error.
    pub fn warn(&self, line: impl Display) {
        let _ = writeln!(stderr(), "warning: {line}");
    }

    /// The failure that ends the program, on standard error, and under `--json` as the result.
    pub fn error(&self, error: &Error) {
        let _ = writeln!(stderr(), "error: {error}");
        self.result(&json!({ "error": error.to_string() }));
    }

    /// The machine-readable result; printed only under `--json`, and only the first of a run: a
    /// failure after it is told by the exit code.
    pub fn result(&self, value: &Value) {
        if self.json && !self.done.swap(true, Ordering::Relaxed) {
            let _ = writeln!(stdout(), "{value}");
        }
    }

    /// Names the files written.
    pub fn files(&self, paths: &[PathBuf]) {
        paths.iter().for_each(|path| self.say(format!("written {}", path.display())));
    }

    /// [`Output::result`] with the files written.
    pub fn result_with_files(&self, mut value: Value, paths: &[PathBuf]) {
        value["files"] = json!(paths);
        self.result(&value);
    }
}
