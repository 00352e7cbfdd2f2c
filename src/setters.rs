//! Setters of options.

/// Methods `with_field(value)` that return the changed options: what may grow is not written as a literal outside of
/// this crate.
macro_rules! setters {
    ($of:ident $(<$life:lifetime>)? { $($(#[$meta:meta])* $set:ident($field:ident: $type:ty)),* $(,)? }) => {
        impl $(<$life>)? $of $(<$life>)? {
            $(
                #[doc = concat!("With this [`", stringify!($field), "`](field@Self::", stringify!($field), ").")]
                $(#[$meta])*
                #[must_use]
                pub fn $set(self, $field: $type) -> Self {
                    Self { $field, ..self }
                }
            )*
        }
    };
}
