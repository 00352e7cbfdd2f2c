//! The commands in groups, for `--help`.

use clap::Command;

/// Titles of the groups, and their commands in order.
const GROUPS: [(&str, &[&str]); 3] = [
    (
        "On a part",
        &[
            "check", "sample", "label", "tools", "setups", "machined", "watch", "explain",
            "predict", "report", "demo",
        ],
    ),
    ("Networks and data", &["generate", "dataset", "train", "eval", "weights"]),
    (
        "Checks and measurements of this build, for developers",
        &["gradcheck", "parity", "bench", "reproduce"],
    ),
];

/// The program with its commands listed in groups.
pub fn grouped(program: Command) -> Command {
    let mut list = String::new();
    for (title, names) in GROUPS {
        list += &format!("\n{title}:\n");
        for name in names {
            let about = program.find_subcommand(name).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            list += &format!("  {name:10} {about}\n");
        }
    }
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{list}\nOptions:\n{{options}}"
    );
    program.help_template(template)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group_and_described() {
        let program = crate::program();
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        let mut all: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
        listed.sort_unstable();
        all.sort_unstable();
        assert_eq!(listed, all);
        let help = grouped(program.clone()).render_help().to_string();
        assert!(GROUPS.iter().all(|(title, _)| help.contains(title)), "{help}");
        let described = |name: &&str| {
            help.lines().any(|line| {
                line.strip_prefix(&format!("  {name} "))
                    .is_some_and(|about| about.trim().len() > 10)
            })
        };
        assert!(all.iter().all(described), "{help}");
    }
}
