//! The page on this machine's loopback address: nothing else is served, and its address cannot be guessed.

use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tiny_http::{Header, Method, Request, Response};

/// How long a page waits for news before it asks again.
const WAIT: Duration = Duration::from_secs(25);
/// Pages that may wait at once.
const MOST_WAITING: usize = 32;
const JSON: &str = "application/json";
const HTML: &str = "text/html; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";
/// Of every answer: it is for this page alone, and not kept.
const HEADERS: [(&str, &str); 5] = [
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
];

/// What a state is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The page is that of the files.
    Shown,
    /// An answer is being computed.
    Working,
    /// The files have no answer.
    Error,
}

/// The newest page, and what is said of it.
struct State {
    /// Counts what was said.
    number: u64,
    version: u64,
    /// Counts the pages.
    page: u64,
    kind: Kind,
    words: String,
    changes: Vec<String>,
    html: Arc<str>,
}

impl State {
    fn json(&self) -> Value {
        let kind = match self.kind {
            Kind::Shown => "shown",
            Kind::Working => "working",
            Kind::Error => "error",
        };
        json!({
            "number": self.number,
            "version": self.version,
            "page": self.page,
            "kind": kind,
            "words": self.words,
            "changes": self.changes,
        })
    }
}

struct Shared {
    state: Mutex<State>,
    said: Condvar,
    n_waiting: AtomicUsize,
    /// `/TOKEN/`.
    root: String,
    /// `127.0.0.1:PORT`.
    host: String,
}

/// Serves the page, on threads of its own, until the program ends.
pub struct Server(Arc<Shared>);

impl Server {
    /// Begins to serve; port 0 is any that is free.
    ///
    /// # Errors
    /// If the port is taken, or the system has no random numbers.
    pub fn start(port: u16) -> Result<Self> {
        let refused = |found: String| {
            Error::argument("--port", found, "a port that is free", "leave --port out")
        };
        let server = tiny_http::Server::http(("127.0.0.1", port))
            .map_err(|error| refused(format!("{port} ({error})")))?;
        let address = server.server_addr().to_ip();
        let port = address.map_or(port, |address| address.port());
        let mut token = [0; 16];
        getrandom::fill(&mut token).map_err(|error| refused(error.to_string()))?;
        let token: String = token.iter().map(|byte| format!("{byte:02x}")).collect();
        let state = State {
            number: 0,
            version: 0,
            page: 0,
            kind: Kind::Working,
            words: String::new(),
            changes: Vec::new(),
            html: "".into(),
        };
        let shared = Arc::new(Shared {
            state: Mutex::new(state),
            said: Condvar::new(),
            n_waiting: AtomicUsize::new(0),
            root: format!("/{token}/"),
            host: format!("127.0.0.1:{port}"),
        });
        let of_thread = Arc::clone(&shared);
        std::thread::spawn(move || {
            for request in server.incoming_requests() {
                let shared = Arc::clone(&of_thread);
                std::thread::spawn(move || shared.answer(request));
            }
        });
        Ok(Server(shared))
    }

    /// Where the page is.
    pub fn address(&self) -> String {
        format!("http://{}{}", self.0.host, self.0.root)
    }

    /// Shows a page, by its version and number: of `kind`, all that there is of the version, or what there is so far.
    pub fn show(
        &self,
        html: String,
        [version, page]: [u64; 2],
        (kind, words): (Kind, &str),
        changes: &[String],
    ) {
        self.0.say(|state| {
            state.html = html.into();
            (state.version, state.page) = (version, page);
            state.kind = kind;
            state.words = words.into();
            state.changes = changes.to_vec();
        });
    }

    /// Says something of the version that is shown.
    pub fn say(&self, kind: Kind, words: &str) {
        self.0.say(|state| {
            state.kind = kind;
            state.words = words.into();
            state.changes.clear();
        });
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn say(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.state();
        change(&mut state);
        state.number += 1;
        drop(state);
        self.said.notify_all();
    }

    fn answer(&self, request: Request) {
        // Another name of this machine would be that of another site (DNS rebinding).
        let host = request.headers().iter().find(|header| header.field.equiv("Host"));
        let is_ours = host.is_some_and(|host| host.value.as_str() == self.host);
        let path = request.url().to_owned();
        let place = path.strip_prefix(&*self.root).filter(|_| is_ours);
        let (status, kind, body): (u16, &str, Vec<u8>) = match place {
            Some(_) if *request.method() != Method::Get => (405, TEXT, b"GET alone".to_vec()),
            Some("" | "page") => (200, HTML, self.state().html.as_bytes().to_vec()),
            Some(place) => match place.strip_prefix("state?after=") {
                Some(after) => match self.wait(after.parse().ok()) {
                    Some(state) => (200, JSON, state.to_string().into_bytes()),
                    None => (503, TEXT, b"too many pages wait".to_vec()),
                },
                None => (404, TEXT, b"nothing here".to_vec()),
            },
            None => (404, TEXT, b"nothing here".to_vec()),
        };
        let mut response = Response::from_data(body).with_status_code(status);
        for (name, value) in HEADERS.into_iter().chain([("Content-Type", kind)]) {
            if let Ok(header) = Header::from_bytes(name, value) {
                response.add_header(header);
            }
        }
        // A page that is closed meanwhile wants no answer.
        let _ = request.respond(response);
    }

    /// The state when something was said after number `after`, or when it is time to ask again.
    fn wait(&self, after: Option<u64>) -> Option<Value> {
        let n_before = self.n_waiting.fetch_add(1, Ordering::Relaxed);
        let state = (n_before < MOST_WAITING).then(|| {
            let is_known = |state: &mut State| Some(state.number) == after;
            let waited = self.said.wait_timeout_while(self.state(), WAIT, is_known);
            waited.unwrap_or_else(PoisonError::into_inner).0.json()
        });
        self.n_waiting.fetch_sub(1, Ordering::Relaxed);
        state
    }
}
