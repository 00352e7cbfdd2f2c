//! How much memory work may take: checked before any of it is allocated, so that work that is too large is refused with
//! a number.

use crate::{Error, Result};
use std::path::Path;

/// Work of fewer bytes is never refused: the check would cost more than it saves.
const SMALL_BYTES: u64 = 16 << 20;

/// Checks that `operation`, which takes `needed_bytes` by an upper estimate, fits into [`limit_bytes`].
///
/// # Errors
/// [`Error::TooLarge`] if it does not.
pub fn require(
    operation: &'static str,
    needed_bytes: u64,
    remedy: impl Into<String>,
) -> Result<()> {
    if needed_bytes <= SMALL_BYTES {
        return Ok(());
    }
    let limit_bytes = limit_bytes();
    if needed_bytes <= limit_bytes {
        return Ok(());
    }
    Err(Error::TooLarge { operation, needed_bytes, limit_bytes, remedy: remedy.into() })
}

/// [`require`] for the content of the file `path`, which nothing but more memory makes fit.
///
/// # Errors
/// As [`require`].
pub fn require_for(path: &Path, operation: &'static str, needed_bytes: u64) -> Result<()> {
    require(operation, needed_bytes, format!("{}: free some memory", path.display()))
}

/// The product of counts and bytes; the greatest number there is if it is beyond that.
pub fn product(factors: impl IntoIterator<Item = usize>) -> u64 {
    factors.into_iter().fold(1, |product: u64, n| product.saturating_mul(n as u64))
}

/// Bytes that this process may still take: the least of the machine's memory and its control group's, less what is
/// resident, and three quarters of the limit of its address space (`ulimit -v`), less what is mapped. What the system
/// does not say does not limit.
///
/// Other programs' memory is not subtracted, so that the answer does not depend on who else is at work.
pub fn limit_bytes() -> u64 {
    let status = text("/proc/self/status");
    let of_status = |name| kibibytes(&status, name).unwrap_or(0);
    let (resident, mapped) = (of_status("VmRSS:"), of_status("VmSize:"));
    let machine = kibibytes(&text("/proc/meminfo"), "MemTotal:");
    let group = text("/sys/fs/cgroup/memory.max").trim().parse().ok();
    let limits = text("/proc/self/limits");
    let address_space = limits.lines().find_map(|line| line.strip_prefix("Max address space"));
    let address_space = address_space.and_then(|l| l.split_whitespace().next()?.parse().ok());
    // Threads map stacks and heaps of their own, some of them later.
    let address_space = address_space.map(|limit: u64| limit - limit / 4);
    let left = |limit: Option<u64>, used| limit.map(|limit| limit.saturating_sub(used));
    let all = [left(machine, resident), left(group, resident), left(address_space, mapped)];
    // No more than there are addresses.
    all.into_iter().flatten().min().unwrap_or(usize::MAX as u64)
}

/// A file of the system; empty where there is none.
fn text(path: &str) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_there_is_is_refused_with_both_numbers() {
        require("a test", SMALL_BYTES, "").unwrap();
        let found = require("a test", u64::MAX, "ask for less");
        if cfg!(target_os = "linux") {
            let message = found.unwrap_err().to_string();
            assert!(
                message.starts_with("a test needs about 18446744073709551615 bytes, the limit")
            );
            assert!(message.ends_with("; ask for less"), "{message}");
            assert!((SMALL_BYTES..1 << 50).contains(&limit_bytes()));
        }
        assert_eq!(product([3, 1 << 40, 1 << 40]), u64::MAX);
        assert_eq!(product([3, 5]), 15);
    }

    #[test]
    fn numbers_of_the_system_are_read() {
        let status = "Name:\tx\nVmSize:\t   1000 kB\nVmRSS:\t12 kB\nVmData: many kB\n";
        assert_eq!(kibibytes(status, "VmSize:"), Some(1_024_000));
        assert_eq!(kibibytes(status, "VmRSS:"), Some(12_288));
        assert_eq!(kibibytes(status, "VmData:"), None);
        assert_eq!(kibibytes(status, "VmSwap:"), None);
    }
}
