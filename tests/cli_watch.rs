//! `deepmill watch`: a page that follows the files.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, block, grooved, stl};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const LONG: Duration = Duration::from_secs(60);

/// The program while it watches; ended when dropped.
struct Watch {
    program: Child,
    host: String,
    root: String,
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

impl Watch {
    fn start(args: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_deepmill"));
        command.arg("watch").args(args).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut program = command.spawn().unwrap();
        let lines = BufReader::new(program.stdout.take().unwrap());
        let mut lines = lines.lines().map(Result::unwrap);
        let address = lines.find_map(|line| Some(line.split_once("http://")?.1.to_string()));
        let address = address.expect("an address");
        // Nobody reads on: the pipe must not fill.
        std::thread::spawn(move || lines.for_each(drop));
        let (host, root) = address.split_once('/').unwrap();
        Watch { program, host: host.into(), root: format!("/{root}") }
    }

    /// Status and body.
    fn request(&self, method: &str, path: &str, host: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(LONG)).unwrap();
        let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8(answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_string())
    }

    fn get(&self, place: &str) -> (u16, String) {
        self.request("GET", &format!("{}{place}", self.root), &self.host)
    }

    /// The next state that is wanted.
    fn state(&self, is_wanted: impl Fn(&Value) -> bool) -> Value {
        let (start, mut after) = (Instant::now(), -1);
        while start.elapsed() < LONG {
            let (status, body) = self.get(&format!("state?after={after}"));
            assert_eq!(status, 200, "{body}");
            let state: Value = serde_json::from_str(&body).unwrap();
            if is_wanted(&state) {
                return state;
            }
            after = state["number"].as_i64().unwrap();
        }
        panic!("no such state");
    }

    fn shown(&self, version: u64) -> Value {
        self.state(|state| state["kind"] == "shown" && state["version"] == version)
    }
}

/// The bytes of a block with a groove of this width and 15 mm depth.
fn groove_of(width_mm: f32) -> Vec<u8> {
    std::fs::read(grooved(&Folder::new(), width_mm, 15.0)).unwrap()
}

const ARGS: [&str; 6] = ["--cutter", "3,30,6,30", "--directions", "up", "--sites", "4000"];

fn changes(state: &Value) -> Vec<String> {
    state["changes"].as_array().unwrap().iter().map(|c| c.as_str().unwrap().into()).collect()
}

#[test]
fn a_wider_groove_is_shown_with_what_it_frees() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 15.0);
    let watch = Watch::start(&[&[&*part], &ARGS[..]].concat());
    let (status, page) = watch.get("");
    assert_eq!(status, 200);
    assert!(page.contains("data-version=\"1\"") && page.contains("connect-src 'self'"));
    assert_eq!(changes(&watch.shown(1)), [""; 0]);
    // By +z alone a ball of 6 mm does not enter a groove of 4 mm. In one of 10 mm it reaches both walls but for 3 mm
    // above the floor, 2 * 12 * 30 mm2, and 4 mm of the floor, 4 * 30 mm2. The wider groove takes 6 * 30 mm2 off the
    // top and 6 * 15 mm2 off each end.
    let by_hand = 720.0 + 120.0 - 180.0 - 180.0;
    grooved(&folder, 10.0, 15.0);
    let state = watch.shown(2);
    let changes = changes(&state);
    let freed: f64 = changes[0].strip_suffix(" mm² reachable").unwrap().parse().unwrap();
    assert!((freed - by_hand).abs() < 80.0, "{changes:?}");
    assert!(changes.iter().any(|change| change.ends_with("gone")), "{changes:?}");
    let (_, page) = watch.get("page");
    assert!(page.contains("data-version=\"2\"") && page.contains("\"has_changes\":true"));
}

#[test]
fn answers_are_shown_before_it_is_known_what_would_help() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 15.0);
    let watch = Watch::start(&[&[&*part], &ARGS[..]].concat());
    assert_eq!(watch.shown(1)["page"], 1);
    grooved(&folder, 10.0, 15.0);
    let state = watch.state(|state| state["version"] == 2);
    let of_look = state["kind"] == "working";
    if of_look {
        let words = state["words"].as_str().unwrap();
        assert!(words.starts_with("version 2: ") && words.contains("would help"), "{state}");
        assert!(changes(&state)[0].ends_with(" mm² reachable"), "{state}");
    }
    let complete = watch.shown(2);
    assert_eq!(complete["page"], 3, "a page of the answers alone was shown before");
    let words = complete["words"].as_str().unwrap();
    let [shown, complete_s] = ["shown after ", ", complete after "].map(|before| {
        let rest = words.split_once(before).unwrap_or_else(|| panic!("{words}")).1;
        rest.split_once(" s").unwrap().0.parse::<f64>().unwrap()
    });
    assert!(shown <= complete_s);
    if of_look {
        assert_eq!(changes(&state), changes(&complete));
        let share = |words: &str| words.split_once(" %").unwrap().0.to_owned();
        assert_eq!(share(state["words"].as_str().unwrap()), share(words));
    }
    assert!(watch.get("page").1.contains("data-version=\"2\" data-number=\"3\""));
}

#[test]
fn a_page_that_will_not_be_complete_goes_back_to_the_version_before() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 15.0);
    let many = ["--cutter", "1,20,5,20", "--directions", "up", "--sites", "40000"];
    let watch = Watch::start(&[&[&*part], &many[..]].concat());
    watch.shown(1);
    grooved(&folder, 10.0, 15.0);
    watch.state(|state| state["version"] == 2);
    // Before it is complete, or just after.
    folder.file("groove.stl", &groove_of(8.0)[..500]);
    let state = watch.state(|state| state["kind"] == "error");
    let page = watch.get("page").1;
    let version = state["version"].as_u64().unwrap();
    let number = state["page"].as_u64().unwrap();
    assert!(page.contains(&format!("data-version=\"{version}\" data-number=\"{number}\"")));
    let [is_before, is_complete] = [[1, 3], [2, 3]].map(|is| is == [version, number]);
    assert!(is_before || is_complete, "{state}");
    grooved(&folder, 4.0, 15.0);
    watch.shown(version + 1);
}

#[test]
fn a_broken_file_is_said_and_the_page_stays() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 15.0);
    let watch = Watch::start(&[&[&*part], &ARGS[..]].concat());
    folder.file("groove.stl", &groove_of(10.0)[..500]);
    let state = watch.state(|state| state["kind"] == "error");
    assert!(state["words"].as_str().unwrap().contains("groove.stl"), "{state}");
    assert_eq!(state["version"], 1);
    assert!(watch.get("page").1.contains("data-version=\"1\""));
    // As an editor saves: another file takes its name.
    let other = folder.file("groove.tmp", groove_of(10.0));
    std::fs::rename(other, folder.path("groove.stl")).unwrap();
    watch.shown(2);
}

#[test]
fn a_file_that_is_half_written_is_waited_for() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 15.0);
    let watch = Watch::start(&[&[&*part], &ARGS[..]].concat());
    let whole = groove_of(10.0);
    let mut file = std::fs::File::create(folder.path("groove.stl")).unwrap();
    file.write_all(&whole[..500]).unwrap();
    file.flush().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    file.write_all(&whole[500..]).unwrap();
    drop(file);
    let is_shown = |state: &Value| state["kind"] == "shown" && state["version"] == 2;
    let state = watch.state(|state| state["kind"] == "error" || is_shown(state));
    assert_eq!(state["kind"], "shown", "{state}");
}

#[test]
fn tools_and_setups_are_watched_with_their_files() {
    let folder = Folder::new();
    let part = grooved(&folder, 10.0, 15.0);
    let table =
        |diameter: f32| format!("name,diameter,corner,stick_out,shank\nF,{diameter},0,40,6\n");
    let tools = folder.file("tools.csv", table(12.0));
    let holder = folder.file("holder.csv", "height,lower,upper\n40,30,30\n");
    let more = ["--sites", "500", "--holder", &holder];
    for command in [
        &["tools", &part, "--library", &tools][..],
        &["setups", &part, "--tools", &tools, "--machine", "3-axis"],
    ] {
        folder.file("tools.csv", table(12.0));
        let watch = Watch::start(&[command, &more].concat());
        watch.shown(1);
        folder.file("tools.csv", table(8.0));
        let changes = changes(&watch.shown(2));
        assert!(
            changes[0].starts_with('+') && !changes[0].starts_with("+0.000"),
            "{command:?}: {changes:?}"
        );
    }
}

#[test]
fn files_are_written_if_a_folder_is_named() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 15.0);
    let out = folder.path("out");
    let more = ["--no-picture", "--out", &out];
    let watch = Watch::start(&[&[&*part], &ARGS[..], &more].concat());
    let labels = std::path::Path::new(&out).join("labels.npz");
    let start = Instant::now();
    while !labels.exists() && start.elapsed() < LONG {
        std::thread::sleep(Duration::from_millis(20));
    }
    let before = std::fs::read(&labels).unwrap();
    grooved(&folder, 10.0, 15.0);
    watch.shown(2);
    while std::fs::read(&labels).unwrap() == before && start.elapsed() < LONG {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_ne!(std::fs::read(&labels).unwrap(), before);
}

#[test]
fn nothing_but_the_page_is_served_and_to_nobody_else() {
    let folder = Folder::new();
    let part = folder.file("part.stl", stl(&block([0.0; 3], [20.0, 20.0, 20.0])));
    let watch = Watch::start(&[&[&*part], &ARGS[..]].concat());
    assert!(watch.host.starts_with("127.0.0.1:"));
    // 128 random bits.
    assert_eq!(watch.root.len(), 34);
    let (root, host) = (&*watch.root, &*watch.host);
    for (method, path, host, expected) in [
        ("GET", root, host, 200),
        ("GET", "/", host, 404),
        ("GET", "/page", host, 404),
        ("GET", &format!("/{}/", "0".repeat(32)), host, 404),
        ("GET", &format!("{root}../Cargo.toml"), host, 404),
        ("GET", &format!("{root}%2e%2e/part.stl"), host, 404),
        ("GET", root, "example.com", 404),
        ("GET", root, "localhost:80", 404),
        ("POST", root, host, 405),
        ("DELETE", &format!("{root}page"), host, 405),
    ] {
        assert_eq!(watch.request(method, path, host).0, expected, "{method} {path} {host}");
    }
}

#[test]
fn what_cannot_be_watched_is_refused() {
    let folder = Folder::new();
    let part = folder.block();
    for (args, found) in [
        (&["watch"][..], "PART"),
        (&["watch", &part, &part, "--cutter", command::CUTTER], "2 parts"),
        (&["watch", &part, "--cutter", command::CUTTER, "--volume", "1"], "--volume"),
        (
            &["watch", &part, "--cutter", command::CUTTER, "--write-baseline", "b.toml"],
            "--write-baseline",
        ),
        (&["watch", "tools", "--library", &part, "--show"], "PART"),
    ] {
        let output = command::deepmill(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let stderr = command::text(&output.stderr);
        assert!(stderr.contains(found), "{args:?}: {stderr}");
    }
    let output = command::deepmill(&["label", &part, "--cutter", command::CUTTER]);
    assert_eq!(output.status.code(), Some(2), "a folder is required elsewhere");
    assert!(command::text(&output.stderr).contains("--out"));
}
