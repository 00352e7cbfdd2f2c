//! Commands on several processes, which a launcher such as `mpirun` or `srun` has started together.

use crate::exit_code;
use crate::output::Output;
use deepmill::processes::{Processes, SingleProcess, agree, require_same};
use deepmill::{Error, Result};

/// Calls `work` with all processes of this program. Only process 0 prints results. An error that no other process knows
/// of is printed, and ends them all.
pub fn together(
    output: &Output,
    work: impl FnOnce(&dyn Processes, &Output) -> Result<()>,
) -> Result<()> {
    let processes = start()?;
    let of_process = output.of_process(processes.rank());
    let result = require_same_program(&*processes).and_then(|()| work(&*processes, &of_process));
    let Err(error) = result else { return Ok(()) };
    if processes.size() == 1 {
        return Err(error);
    }
    output.error(&error);
    if !is_shared(&error) {
        abort(exit_code(&error).into());
    }
    // A launcher ends all processes as soon as one of them fails: not before the message is out.
    processes.gather(&[]);
    Err(Error::OtherProcess { rank: processes.rank() })
}

fn is_shared(error: &Error) -> bool {
    matches!(error, Error::Process { .. } | Error::OtherProcess { .. })
}

/// Ends the work of all processes, as process 0 says.
pub fn interrupted(processes: &dyn Processes, remedy: String) -> Error {
    let first = match processes.rank() {
        0 => Err(Error::Interrupted { remedy: remedy.clone() }),
        _ => Ok(()),
    };
    agree(processes, first).err().unwrap_or(Error::Interrupted { remedy })
}

fn start() -> Result<Box<dyn Processes>> {
    match n_launched() {
        0 | 1 => Ok(Box::new(SingleProcess)),
        n => start_many(n),
    }
}

/// How many processes the launcher says that there are: Open MPI, then those that speak PMI, then Slurm alone.
fn n_launched() -> usize {
    let names = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"];
    let number = |name| std::env::var(name).ok()?.parse().ok();
    names.into_iter().find_map(number).unwrap_or(1)
}

#[cfg(feature = "mpi")]
fn start_many(n: usize) -> Result<Box<dyn Processes>> {
    let processes = deepmill::processes::Mpi::start()?;
    if processes.size() != n {
        let remedy = "start them with the `mpirun` of that library, or with `srun --mpi=pmix`";
        let expected = format!("{n}, as were launched");
        let name = "number of processes that the MPI library knows";
        return Err(Error::argument(name, processes.size(), expected, remedy));
    }
    // The others would wait for a process that panics.
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        print(info);
        abort(101);
    }));
    Ok(Box::new(processes))
}

#[cfg(not(feature = "mpi"))]
fn start_many(n: usize) -> Result<Box<dyn Processes>> {
    let remedy = "build it with `--features mpi`, or start one process";
    Err(Error::argument("number of processes", n, "1: this program was built without MPI", remedy))
}

#[cfg(feature = "mpi")]
fn abort(code: i32) -> ! {
    deepmill::processes::Mpi::abort(code)
}

#[cfg(not(feature = "mpi"))]
fn abort(code: i32) -> ! {
    std::process::exit(code)
}

/// Checks that all processes run the same program with the same options.
fn require_same_program(processes: &dyn Processes) -> Result<()> {
    if processes.size() == 1 {
        return Ok(());
    }
    let program = std::env::current_exe()
        .and_then(std::fs::read)
        .map_err(|e| Error::read(std::env::args().next().unwrap_or_default(), e));
    let program = agree(processes, program)?;
    let version = format!("{} ({})", env!("CARGO_PKG_VERSION"), &hash(&program)[..16]);
    require_same(processes, "version of the program", &version)?;
    require_same(processes, "command line", &options(std::env::args().skip(1)))
}

/// SHA-256, hexadecimal.
pub fn hash(bytes: &[u8]) -> String {
    hmac_sha256::Hash::hash(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The command line without the number of threads, on which no result depends.
fn options(mut words: impl Iterator<Item = String>) -> String {
    let mut kept: Vec<String> = Vec::new();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--threads" => drop(words.next()),
            word if word.starts_with("--threads=") => {}
            _ => kept.push(word),
        }
    }
    kept.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_no_option_that_matters() {
        let words = |line: &str| options(line.split(' ').map(str::to_owned));
        let expected = "train --data a --out b";
        assert_eq!(words("train --threads 2 --data a --out b"), expected);
        assert_eq!(words("train --data a --threads=1 --out b"), expected);
    }
}
