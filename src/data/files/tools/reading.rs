//! A table of tools in the making: what is left out never loses the rest.

use super::{Tool, ToolTable, number_repeated};
use crate::{Error, Result};
use std::path::Path;

/// A table in the making.
#[derive(Default)]
pub(super) struct Reading {
    pub tools: Vec<Tool>,
    pub unused: Vec<String>,
    pub notices: Vec<String>,
    left_out: Vec<LeftOut>,
}

struct LeftOut {
    why: Error,
    /// Whether it is whole, but of a kind that cannot be represented.
    is_other_kind: bool,
}

impl Reading {
    /// A tool with what was changed of it, or why there is none.
    pub fn add(&mut self, tool: Result<(Tool, Vec<String>)>) {
        match tool {
            Ok((tool, notices)) => {
                self.tools.push(tool);
                self.notices.extend(notices);
            }
            Err(why) => self.left_out.push(LeftOut { why, is_other_kind: false }),
        }
    }

    /// A tool of a kind that cannot be represented.
    pub fn leave_out_kind(&mut self, why: Error) {
        self.left_out.push(LeftOut { why, is_other_kind: true });
    }

    pub fn extend(&mut self, other: Reading) {
        self.tools.extend(other.tools);
        self.unused.extend(other.unused);
        self.notices.extend(other.notices);
        self.left_out.extend(other.left_out);
    }

    /// The table; an error if no tool is left.
    pub fn finish(self, path: &Path) -> Result<ToolTable> {
        match self.tools.is_empty() {
            true => Err(self.none_left(path)),
            false => Ok(self.table()),
        }
    }

    pub fn table(mut self) -> ToolTable {
        number_repeated(&mut self.tools);
        let sentence = |left: &LeftOut| match left.is_other_kind {
            true => left.why.to_string(),
            false => format!("{}; the tool is left out", left.why),
        };
        let refused = self.left_out.iter().map(sentence).collect();
        let Reading { tools, unused, notices, .. } = self;
        ToolTable { tools, unused, refused, notices }
    }

    pub fn none_left(self, path: &Path) -> Error {
        let n = self.left_out.len();
        let first = self.left_out.iter().position(|left| !left.is_other_kind).unwrap_or(0);
        match self.left_out.into_iter().nth(first) {
            Some(LeftOut {
                why: Error::File { path, place, found, remedy },
                is_other_kind: false,
            }) => {
                let more =
                    if n > 1 { format!(" (none of {n} tools can be used)") } else { String::new() };
                Error::File { path, place, found: found + &more, remedy }
            }
            first => {
                let first = first.map_or(String::new(), |first| format!(": {}", first.why));
                let found = format!("no tool can be used{first}");
                let remedy = "add a ball, bull-nose, flat or tapered end mill";
                Error::file(path, "tools", found, remedy)
            }
        }
    }
}
