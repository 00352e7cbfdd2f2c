//! The demo: what the program does when it is given nothing to do.

use crate::output::Output;
use deepmill::Result;

pub fn run(output: &Output) -> Result<()> {
    output.warn("this version has no demo yet");
    output.say(format!("deepmill {}", env!("CARGO_PKG_VERSION")));
    output.result(&serde_json::json!({ "version": env!("CARGO_PKG_VERSION") }));
    Ok(())
}
