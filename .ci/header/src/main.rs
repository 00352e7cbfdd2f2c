//! Writes `src/capi/deepmill.h`: `cargo run --manifest-path .ci/header/Cargo.toml`. With `--check` it writes nothing
//! and fails if the header is not what it would write.

use cbindgen::{Builder, Config, DocumentationStyle, EnumConfig, Language, RenameRule, Style};
use std::path::Path;
use std::process::ExitCode;

/// In the order of the header; the modules of `border` follow in the order in which it declares them.
const SOURCES: [&str; 7] =
    ["context.rs", "status.rs", "work.rs", "mesh.rs", "results.rs", "fields.rs", "border/mod.rs"];

const HEAD: &str = "\
/* Which parts of a surface a milling cutter cannot reach, and what is in its way: the C interface of deepmill.
 * This file is written by `cargo run --manifest-path .ci/header/Cargo.toml`: change the sources instead.
 * A context holds every object by a handle. A handle that was freed, is of another context or of an object of another
 * kind is refused by DM_BAD_HANDLE. Calls with one context may come from several threads.
 * Every function but the first few returns a status, and of a failure the context keeps the text. Lengths are mm.
 * Of every pointer the caller promises: it is null, or it leads to as much memory of its type as the lengths beside it
 * state, aligned, and nobody else writes there during the call. Texts are UTF-8 and end with a zero. A context is null,
 * or was made by dm_context_new and not freed since. Null where a value is needed is refused by DM_BAD_ARGUMENT.
 * Buffers: n counts elements, not bytes. `needed`, which may be null, is set to the number of elements of the result,
 * for text with its zero. With a null buffer and n = 0 a call only asks for that. A buffer that is too short stays as
 * it was (DM_SHORT_BUFFER); elements beyond the result do too. */";

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../src/capi");
    let config = Config {
        language: Language::C,
        header: Some(HEAD.into()),
        include_guard: Some("DEEPMILL_H".into()),
        cpp_compat: true,
        usize_is_size_t: true,
        documentation_style: DocumentationStyle::C99,
        style: Style::Type,
        line_length: 120,
        no_includes: true,
        sys_includes: vec!["stddef.h".into(), "stdint.h".into()],
        enumeration: EnumConfig { rename_variants: RenameRule::None, ..EnumConfig::default() },
        ..Config::default()
    };
    let mut builder = Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(root.join(source));
    }
    let header = match builder.generate() {
        Ok(bindings) => {
            let mut text = Vec::new();
            bindings.write(&mut text);
            text
        }
        Err(error) => {
            eprintln!("the header cannot be made: {error}");
            return ExitCode::FAILURE;
        }
    };
    let path = root.join("deepmill.h");
    let is_check = std::env::args().any(|argument| argument == "--check");
    let result = match is_check {
        true => std::fs::read(&path).map(|found| found == header),
        false => std::fs::write(&path, &header).map(|()| true),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("src/capi/deepmill.h is not that of the sources; this writes it:");
            eprintln!("cargo run --manifest-path .ci/header/Cargo.toml");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{}: {error}", path.display());
            ExitCode::FAILURE
        }
    }
}
