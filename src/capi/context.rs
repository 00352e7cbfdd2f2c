//! What a program holds: objects by handles, and the text of the last failure.

use super::mesh::PartMesh;
use super::request::Request;
use super::results::Results;
use super::status::{Answer, Failure, dm_status};
use super::tools::ToolList;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Everything that a program has made, by handles, and the text of the last failure. Its calls may come from several
/// threads; the text is that of the last failure of all.
#[allow(non_camel_case_types)] // the name in C
pub struct dm_context {
    /// In the upper bits of its handles.
    number: u64,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    /// The last handle. Handles never come back, so one that was freed names nothing for ever.
    last: u64,
    held: BTreeMap<u64, Held>,
    error: String,
}

/// An object.
pub enum Held {
    Mesh(Arc<PartMesh>),
    Tools(Arc<ToolList>),
    Analysis(Arc<Request>),
    Outcome(Arc<Results>),
}

/// A kind of object.
pub trait Kind: Sized {
    /// In words.
    const NAME: &'static str;
    fn held(this: Arc<Self>) -> Held;
    fn of(held: &mut Held) -> Option<&mut Arc<Self>>;
}

macro_rules! kind {
    ($kind:ty, $variant:ident, $name:literal) => {
        impl Kind for $kind {
            const NAME: &'static str = $name;

            fn held(this: Arc<Self>) -> Held {
                Held::$variant(this)
            }

            fn of(held: &mut Held) -> Option<&mut Arc<Self>> {
                match held {
                    Held::$variant(this) => Some(this),
                    _ => None,
                }
            }
        }
    };
}

kind!(PartMesh, Mesh, "a mesh");
kind!(ToolList, Tools, "a list of tools");
kind!(Request, Analysis, "an analysis");
kind!(Results, Outcome, "an outcome");

/// Handles of one context, before their numbers would be those of the next: a million million. The number of the
/// context has the other 24 bits, so that after 16 million contexts the numbers begin again.
const HANDLE_BITS: u32 = 40;

impl dm_context {
    /// An empty one.
    pub(super) fn new() -> Self {
        /// The one thing that all contexts share: how many there were. Handles of one name nothing in another.
        static CONTEXTS: AtomicU64 = AtomicU64::new(0);
        let number = 1 + CONTEXTS.fetch_add(1, Ordering::Relaxed);
        dm_context { number: number << HANDLE_BITS, inner: Mutex::default() }
    }

    /// A panic while it was locked has left whole objects: each change ends with one assignment.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Holds an object; its handle.
    pub(super) fn add<K: Kind>(&self, object: K) -> u64 {
        let mut inner = self.inner();
        inner.last += 1;
        let handle = self.number + inner.last;
        inner.held.insert(handle, K::held(Arc::new(object)));
        handle
    }

    /// The object of a handle.
    pub(super) fn get<K: Kind>(&self, handle: u64) -> Answer<Arc<K>> {
        let mut inner = self.inner();
        let held = inner.held.get_mut(&handle).ok_or_else(|| names_nothing(handle, K::NAME))?;
        K::of(held).cloned().ok_or_else(|| of_another_kind(handle, held, K::NAME))
    }

    /// Changes an object; if that fails it stays as it was.
    pub(super) fn change<K: Kind + Clone>(
        &self,
        handle: u64,
        change: impl FnOnce(&mut K) -> Answer<()>,
    ) -> Answer<()> {
        let mut inner = self.inner();
        let held = inner.held.get_mut(&handle).ok_or_else(|| names_nothing(handle, K::NAME))?;
        let Some(object) = K::of(held) else {
            return Err(of_another_kind(handle, held, K::NAME));
        };
        let mut changed = K::clone(object);
        change(&mut changed)?;
        *object = Arc::new(changed);
        Ok(())
    }

    /// Frees the object of a handle. What was made of it stays.
    pub(super) fn free(&self, handle: u64) -> Answer<()> {
        // Taken out first: a large object is dropped without the lock.
        let freed = self.inner().held.remove(&handle);
        freed.map(drop).ok_or_else(|| names_nothing(handle, "an object of this context"))
    }

    /// Keeps the text of a failure.
    pub(super) fn set_error(&self, text: String) {
        self.inner().error = text;
    }

    /// The text of the last failure; empty if there was none.
    pub(super) fn error(&self) -> String {
        self.inner().error.clone()
    }
}

/// Calls of several threads have it at once; through pointers the compiler would not see that it can be shared.
const _: () = {
    const fn can_be_shared<T: Send + Sync>() {}
    can_be_shared::<dm_context>();
};

fn names_nothing(handle: u64, expected: &str) -> Failure {
    let text = match handle {
        0 => format!(
            "handle is 0, expected {expected}; give what the call that makes it has returned"
        ),
        _ => format!(
            "handle is {handle}, which was freed, or is of another context, expected {expected}; give one that is held"
        ),
    };
    Failure { status: dm_status::DM_BAD_HANDLE, text }
}

fn of_another_kind(handle: u64, held: &Held, expected: &str) -> Failure {
    let kind = match held {
        Held::Mesh(_) => PartMesh::NAME,
        Held::Tools(_) => ToolList::NAME,
        Held::Analysis(_) => Request::NAME,
        Held::Outcome(_) => Results::NAME,
    };
    let text = format!(
        "handle is {handle}, {kind}, expected {expected}; check the order of the arguments"
    );
    Failure { status: dm_status::DM_BAD_HANDLE, text }
}
