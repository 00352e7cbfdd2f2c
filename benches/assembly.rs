//! Checks the assembly of every kernel for every x86 instruction set: fails where an innermost loop holds what the
//! instruction set does without. Needs no processor of that instruction set.
//!
//! ```sh
//! cargo bench --bench assembly              # compiles the numerical core, reads it, prints the table
//! cargo bench --bench assembly -- FILE.s    # reads this file
//! ```
//!
//! Kernels are the instances of `run_avx2` and `run_avx512` (`src/simd/isa.rs`). An innermost loop is a natural loop of
//! the control flow with no other inside. In those with arithmetic on vectors none of these may stand: a gather or
//! scatter, a call, a vector on the stack (spilled), a division, arithmetic on vectors narrower than those of the
//! instruction set; and in those with fused multiply-adds no access to the stack at all. Nowhere may a kernel call
//! vector arithmetic that was compiled for the baseline because it was not inlined, a closure for instance. Printed per
//! kernel: its innermost loops, fused multiply-adds in the one that has most, and instructions per fused multiply-add
//! there.

#![allow(clippy::print_stdout)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Loops that are known and accepted: instruction set, part of the kernel's name, finding, and why.
const ACCEPTED: &[(&str, &str, &str, &str)] = &[
    ("avx2", "kernels::AnyObstacle", "narrow", "a step's lower end: one addition of two scalars"),
    ("avx512", "kernels::AnyObstacle", "narrow", "as at AVX2"),
    (
        "avx2",
        "ranks::Ranks",
        "call",
        "one binary search per obstacle; its loop is no loop over lanes",
    ),
    ("avx2", "ranks::Ranks", "stack", "what the call does not preserve"),
    ("avx512", "ranks::Ranks", "call", "as at AVX2"),
    ("avx512", "ranks::Ranks", "stack", "as at AVX2"),
    (
        "avx2",
        "search::Search",
        "narrow",
        "lanes taken out one by one, to look up cells; cell sizes; bit sets",
    ),
    ("avx512", "search::Search", "narrow", "as at AVX2"),
    (
        "avx2",
        "search::Search",
        "not inlined: deepmill::access::points::pruned::search::cell_bins::CellBins::lay_out",
        "the size of the cells, once a direction, in f64",
    ),
    (
        "avx512",
        "search::Search",
        "not inlined: deepmill::access::points::pruned::search::cell_bins::CellBins::lay_out",
        "as at AVX2",
    ),
];

/// Instruction sets by the name of their shell, with the register that is as wide as they are.
const ISAS: [(&str, &str, &str); 2] =
    [("avx2", "run_avx2", "%ymm"), ("avx512", "run_avx512", "%zmm")];

fn main() -> ExitCode {
    assert_self_check();
    let file = std::env::args().nth(1).filter(|arg| !arg.starts_with("--")).map(PathBuf::from);
    let file = file.unwrap_or_else(compile);
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let (mut faults, tables, packed) = (0, jump_tables(&text), packed_functions(&text));
    println!(
        "{:<8} {:<58} {:>5} {:>5} {:>9}  findings",
        "isa", "kernel", "loops", "fma", "per fma"
    );
    for (isa, shell, register) in ISAS {
        let mut rows = BTreeMap::new();
        for function in functions(&text, shell) {
            let mut report = inspect(&function.lines, register, &tables);
            report.findings.extend(calls_out(&function.lines, &packed));
            if report.n_loops > 0 || !report.findings.is_empty() {
                rows.entry(function.kernel).or_insert_with(Vec::new).push(report);
            }
        }
        for (kernel, reports) in rows {
            for report in reports {
                faults += print_row(isa, &kernel, &report);
            }
        }
    }
    match faults {
        0 => ExitCode::SUCCESS,
        n => {
            println!("{n} findings");
            ExitCode::FAILURE
        }
    }
}

/// Prints one kernel; the number of findings that are not accepted.
fn print_row(isa: &str, kernel: &str, report: &Report) -> usize {
    let accepted = |finding: &str| {
        ACCEPTED
            .iter()
            .any(|(l, k, f, _)| *l == isa && kernel.contains(k) && finding.starts_with(f))
    };
    let (known, new): (Vec<_>, Vec<_>) = report.findings.iter().partition(|f| accepted(f));
    let per_fma = match report.n_fma {
        0 => "-".to_owned(),
        n => format!("{:.2}", report.n_instructions as f64 / n as f64),
    };
    let mut findings: Vec<String> = new.iter().map(|f| (*f).clone()).collect();
    if !known.is_empty() {
        findings.push(format!("{} accepted", known.len()));
    }
    let Report { n_loops, n_fma, .. } = report;
    println!("{isa:<8} {kernel:<58} {n_loops:>5} {n_fma:>5} {per_fma:>9}  {}", findings.join("; "));
    new.len()
}

/// Assembly of the numerical core, compiled beside the usual builds.
fn compile() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let target = root.join("target/assembly");
    let flags =
        ["--emit=asm", "-Ccodegen-units=1", "-Cdebuginfo=0", "-Csymbol-mangling-version=v0"];
    let status = Command::new(env!("CARGO"))
        .current_dir(root)
        .args(["rustc", "--release", "--lib", "--no-default-features", "--target-dir"])
        .arg(&target)
        .arg("--")
        .args(flags)
        .status();
    assert!(status.expect("cargo starts").success(), "the numerical core compiles");
    let folder = target.join("release/deps");
    let files = std::fs::read_dir(folder).expect("a folder of compiled code");
    let files = files.map(|entry| entry.expect("a readable folder").path());
    let assembly = files.filter(|path| path.extension().is_some_and(|e| e == "s"));
    let newest = assembly.max_by_key(|path| path.metadata().and_then(|m| m.modified()).ok());
    newest.expect("an assembly file")
}

/// One instance of a shell.
struct Function<'a> {
    kernel: String,
    lines: Vec<&'a str>,
}

/// The functions whose symbol names `shell`, without comments and directives.
fn functions<'a>(text: &'a str, shell: &str) -> Vec<Function<'a>> {
    let mut found: Vec<Function> = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim_end();
        if let Some(symbol) = line.strip_suffix(':').filter(|s| s.starts_with('_')) {
            inside = identifiers(symbol).iter().any(|name| name == shell);
            if inside {
                found.push(Function { kernel: kernel_of(symbol, shell), lines: Vec::new() });
            }
        } else if line.contains(".cfi_endproc") {
            inside = false;
        } else if inside && (line.starts_with(".LBB") || !line.trim_start().starts_with('.')) {
            found.last_mut().expect("inside a function").lines.push(line.trim());
        }
    }
    found
}

/// Targets of every jump table: `.long .LBB1_2-.LJTI1_0` lines after the table's label.
fn jump_tables(text: &str) -> BTreeMap<&str, Vec<&str>> {
    let mut tables: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in text.lines().filter(|line| line.contains("-.LJTI")) {
        if let Some((target, table)) = line.trim().trim_start_matches(".long").split_once('-') {
            tables.entry(table.trim()).or_default().push(target.trim());
        }
    }
    tables
}

/// The identifiers in a mangled symbol: a length, perhaps an underscore, and as many characters. `B…_` and
/// `s…_` are numbers in base 62, not lengths.
fn identifiers(symbol: &str) -> Vec<String> {
    let (mut names, mut rest) = (Vec::new(), symbol);
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit() || c == 'B' || c == 's') {
        rest = &rest[start..];
        if let Some(number) = rest.strip_prefix(['B', 's']) {
            let digits = number.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(0);
            rest = number[digits..].strip_prefix('_').unwrap_or(number);
            continue;
        }
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let length: usize = rest[..digits].parse().unwrap_or(usize::MAX);
        let name = rest[digits..].strip_prefix('_').unwrap_or(&rest[digits..]);
        match name.get(..length).filter(|name| is_name(name)) {
            Some(found) => {
                names.push(found.to_owned());
                rest = &name[length..];
            }
            None => rest = &rest[digits..],
        }
    }
    names
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// What the shell was compiled for.
fn kernel_of(symbol: &str, shell: &str) -> String {
    let names = identifiers(symbol);
    let after = names.iter().position(|name| name == shell).map_or(0, |i| i + 1);
    let path: Vec<&str> = names[after..].iter().map(String::as_str).collect();
    path.join("::")
}

/// What was seen in a function.
#[derive(Default)]
struct Report {
    n_loops: usize,
    /// Of the innermost loop with most fused multiply-adds.
    n_fma: usize,
    n_instructions: usize,
    findings: Vec<String>,
}

fn inspect(lines: &[&str], register: &str, tables: &BTreeMap<&str, Vec<&str>>) -> Report {
    let mut report = Report::default();
    let framed = lines.iter().any(|line| line.replace(' ', "").contains("movq\t%rsp,%rbp"));
    let blocks = blocks(lines, tables);
    for body in innermost_loops(&blocks) {
        let instructions = || body.iter().flat_map(|&block| &blocks[block].lines);
        if !instructions().any(|line| is_vector_arithmetic(line)) {
            continue;
        }
        report.n_loops += 1;
        let is_fma = |line: &&&str| line.contains("fmadd") && line.contains(register);
        let n_fma = instructions().filter(is_fma).count();
        if n_fma > report.n_fma {
            (report.n_fma, report.n_instructions) = (n_fma, instructions().count());
        }
        for line in instructions() {
            if let Some(what) = fault(line, register, framed, n_fma > 0) {
                report.findings.push(format!("{what}: {}", line.replace('\t', " ")));
            }
        }
    }
    report.findings.sort();
    report.findings.dedup();
    report
}

/// Calls of functions with packed vector arithmetic: outside the shell they are compiled for the baseline.
fn calls_out(lines: &[&str], packed: &BTreeSet<&str>) -> Vec<String> {
    let calls = lines.iter().filter_map(|line| {
        let symbol = line.strip_prefix("call")?.split_whitespace().last()?;
        packed.contains(symbol).then(|| format!("not inlined: {}", identifiers(symbol).join("::")))
    });
    calls.collect()
}

/// Symbols of the functions of the crate that hold packed vector arithmetic, or call it: without its instruction set
/// even a single instruction is a call.
fn packed_functions(text: &str) -> BTreeSet<&str> {
    let (mut found, mut symbol) = (BTreeSet::new(), "");
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        match line.strip_suffix(':').filter(|s| s.starts_with("_R")) {
            Some(name) => symbol = name,
            None if (is_packed(line) || line.contains("core_arch"))
                && identifiers(symbol).iter().any(|name| name == "deepmill") =>
            {
                found.insert(symbol);
            }
            None => {}
        }
    }
    found
}

/// Arithmetic on several lanes.
fn is_packed(line: &str) -> bool {
    let operation = operation(line);
    let ends = ["ps", "pd", "epi32"].iter().any(|end| operation.ends_with(end));
    ends && is_vector_arithmetic(line)
        && !["and", "or", "xor", "unpck", "shuf"].iter().any(|o| operation.starts_with(o))
}

/// Instructions without a jump in between, and the blocks that may follow.
#[derive(Default)]
struct Block<'a> {
    lines: Vec<&'a str>,
    next: Vec<usize>,
}

fn blocks<'a>(lines: &[&'a str], tables: &BTreeMap<&str, Vec<&str>>) -> Vec<Block<'a>> {
    let mut blocks = vec![Block::default()];
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut ended = false;
    for &line in lines {
        if let Some(label) = line.strip_suffix(':') {
            blocks.push(Block::default());
            places.insert(label, blocks.len() - 1);
        } else {
            if ended {
                blocks.push(Block::default());
            }
            blocks.last_mut().expect("there is one").lines.push(line);
        }
        ended = !line.ends_with(':') && (line.starts_with('j') || line.starts_with("ret"));
    }
    let mut table: &[&str] = &[];
    for i in 0..blocks.len() {
        let mentioned = blocks[i].lines.iter().rev().find_map(|line| {
            let rest = &line[line.find(".LJTI")?..];
            tables.get(rest.split('(').next()?)
        });
        table = mentioned.map_or(table, Vec::as_slice);
        let last = blocks[i].lines.last().copied().unwrap_or_default();
        let operand = last.split_whitespace().last().unwrap_or_default();
        let falls_through =
            !last.starts_with("jmp") && !last.starts_with("ret") && !last.starts_with("ud2");
        let mut next: Vec<usize> = Vec::new();
        if last.starts_with("jmp") && operand.starts_with('*') {
            next.extend(table.iter().filter_map(|label| places.get(label)));
        } else if last.starts_with('j') {
            next.extend(places.get(operand));
        }
        next.extend((falls_through && i + 1 < blocks.len()).then_some(i + 1));
        blocks[i].next = next;
    }
    blocks
}

/// The blocks of every natural loop that has no other inside: a jump back to a block that all ways to the jump
/// pass (a dominator), and all blocks between the two.
fn innermost_loops(blocks: &[Block]) -> Vec<Vec<usize>> {
    let mut previous = vec![Vec::new(); blocks.len()];
    for (i, block) in blocks.iter().enumerate() {
        block.next.iter().for_each(|&next| previous[next].push(i));
    }
    let dominator = dominators(blocks, &previous);
    let dominates = |a: usize, mut b: usize| {
        while b != a && dominator[b].is_some_and(|up| up != b) {
            b = dominator[b].expect("checked");
        }
        a == b
    };
    let mut loops: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, block) in blocks.iter().enumerate().filter(|(i, _)| dominator[*i].is_some()) {
        for &head in block.next.iter().filter(|&&head| dominates(head, i)) {
            let body = loops.entry(head).or_insert_with(|| vec![head]);
            let mut open = vec![i];
            while let Some(block) = open.pop() {
                if !body.contains(&block) {
                    body.push(block);
                    open.extend(previous[block].iter().filter(|b| dominator[**b].is_some()));
                }
            }
        }
    }
    let innermost = |(head, body): &(&usize, &Vec<usize>)| {
        !body.iter().any(|block| block != *head && loops.contains_key(block))
    };
    loops.iter().filter(innermost).map(|(_, body)| body.clone()).collect()
}

/// The immediate dominator of each block that can be reached (Cooper, Harvey and Kennedy 2001).
fn dominators(blocks: &[Block], previous: &[Vec<usize>]) -> Vec<Option<usize>> {
    let (mut order, mut seen, mut open) = (Vec::new(), vec![false; blocks.len()], vec![(0, 0)]);
    seen[0] = true;
    while let Some((block, child)) = open.pop() {
        match blocks[block].next.get(child) {
            Some(&next) => {
                open.push((block, child + 1));
                if !std::mem::replace(&mut seen[next], true) {
                    open.push((next, 0));
                }
            }
            None => order.push(block),
        }
    }
    let mut rank = vec![0; blocks.len()];
    order.iter().enumerate().for_each(|(i, &block)| rank[block] = i);
    let mut dominator = vec![None; blocks.len()];
    dominator[0] = Some(0);
    let mut changed = true;
    while changed {
        changed = false;
        for &block in order.iter().rev().filter(|&&block| block != 0) {
            let mut new: Option<usize> = None;
            for &from in previous[block].iter().filter(|&&from| dominator[from].is_some()) {
                new = Some(new.map_or(from, |mut a| {
                    let mut b = from;
                    while a != b {
                        let lower = if rank[a] < rank[b] { &mut a } else { &mut b };
                        *lower = dominator[*lower].expect("reached before");
                    }
                    a
                }));
            }
            if dominator[block] != new {
                dominator[block] = new;
                changed = true;
            }
        }
    }
    dominator
}

/// Names of vector registers.
const VECTORS: [&str; 3] = ["%xmm", "%ymm", "%zmm"];

/// Mnemonic without the `v` of its three-operand form.
fn operation(line: &str) -> &str {
    let word = line.split_whitespace().next().unwrap_or_default();
    word.strip_prefix('v').unwrap_or(word)
}

fn is_vector_arithmetic(line: &str) -> bool {
    let on_vectors = VECTORS.iter().any(|register| line.contains(register));
    let moves = ["mov", "broadcast", "extract", "insert", "set", "zero", "cvt", "comi", "ucomi"];
    on_vectors && !moves.iter().any(|name| operation(line).starts_with(name)) && !is_clearing(line)
}

/// `xor` of a register with itself.
fn is_clearing(line: &str) -> bool {
    let mut operands = line.split_whitespace().skip(1).map(|operand| operand.trim_end_matches(','));
    let first = operands.next();
    operation(line).contains("xor") && operands.all(|operand| Some(operand) == first)
}

/// What is wrong with an instruction of an innermost loop.
fn fault(line: &str, register: &str, framed: bool, has_fma: bool) -> Option<&'static str> {
    let operation = operation(line);
    if operation.contains("gather") || operation.contains("scatter") {
        return Some("gather or scatter");
    }
    if operation.starts_with("call") {
        return Some("call");
    }
    let on_stack = line.contains("(%rsp") || framed && line.contains("(%rbp");
    if on_stack && (has_fma || VECTORS.iter().any(|register| line.contains(register))) {
        return Some("stack");
    }
    if operation.starts_with("div") || operation.starts_with("idiv") {
        return Some("division");
    }
    (is_vector_arithmetic(line) && !line.contains(register)).then_some("narrow")
}

/// The checker sees what it is for.
fn assert_self_check() {
    let body =
        |line: &str| format!(".LBB0_1:\n\tvmulps\t%zmm1, %zmm2, %zmm3\n{line}\n\tjne\t.LBB0_1");
    let found = |line: &str| {
        let text = body(line);
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        inspect(&lines, "%zmm", &BTreeMap::new()).findings.len()
    };
    assert_eq!(found("\tvfmadd231ps\t%zmm1, %zmm2, %zmm3"), 0);
    for line in [
        "\tvgatherqps\t(%rax,%zmm1), %ymm2 {%k1}",
        "\tcallq\tmemcpy@PLT",
        "\tvaddps\t64(%rsp), %zmm1, %zmm2",
        "\tvdivps\t%zmm1, %zmm2, %zmm3",
        "\tvfmadd231ps\t%ymm1, %ymm2, %ymm3",
        "\tvaddss\t%xmm1, %xmm2, %xmm3",
    ] {
        assert_eq!(found(line), 1, "{line}");
    }
    let closure = "_RNCNvXs_NtNtCs8xk_8deepmill4simd4gemmNtB4_4Rows3runB6_";
    let called = |arithmetic: &str| {
        let text = format!("{closure}:\n\t{arithmetic}\t%xmm1, %xmm2\n\tretq");
        calls_out(&[&format!("callq\t{closure}")], &packed_functions(&text))
    };
    assert!(called("mulps")[0].ends_with("gemm::Rows::run"));
    assert_eq!(called("callq\t_RNvNtNtCs3_4core9core_arch7avx512f14__mm512_set1_ps").len(), 1);
    assert!(called("mulss").is_empty() && called("movaps").is_empty());
    let names =
        identifiers("_RINvNtNtCs8xk_8deepmill4simd3isa10run_avx512NtNtB4_4gemm10RowsKernelEB6_");
    assert!(names.contains(&"run_avx512".to_owned()) && names.contains(&"RowsKernel".to_owned()));
}
