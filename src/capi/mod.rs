//! The C interface: `deepmill.h` declares it, `docs/c.md` describes it.
//!
//! A [`dm_context`] holds every object by a handle, a number that never comes back: one that was freed, is of another
//! context, or of an object of another kind is refused. Input is copied and checked; results are copied into buffers of
//! the caller. Errors and panics become a [`dm_status`], whose text the context keeps.
//!
//! Pointers are followed in `border` alone.

mod border;
mod context;
mod fields;
mod mesh;
mod request;
mod results;
mod status;
mod tools;
mod work;

pub use border::*;
pub use context::dm_context;
pub use fields::*;
pub use mesh::{DM_FORCE, DM_REPAIR};
pub use results::{
    DM_ACCESSIBLE, DM_ALL_TOOLS, DM_INACCESSIBLE, DM_TIP_DOES_NOT_FIT, DM_WRITE_CSV, DM_WRITE_GLB,
    DM_WRITE_NO_PICTURES, DM_WRITE_REPORT,
};
pub use status::dm_status;
pub use work::{
    DM_STAGE_FINDINGS, DM_STAGE_LABELS, DM_STAGE_MACHINING, DM_STAGE_SITES, DM_STAGE_VERIFYING,
    DM_STAGE_WRITING,
};
