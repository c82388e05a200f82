//! Read-only properties of a class: docstring, name, type and value of each.

macro_rules! getters {
    ($class:ident { $(
        $(#[$doc:meta])*
        $name:ident: $type:ty = |$this:ident $(, $py:ident)?| $value:expr;
    )+ }) => {
        #[pymethods]
        impl $class { $(
            $(#[$doc])*
            #[getter]
            fn $name<'py>(&self, _py: Python<'py>) -> $type {
                let $this = self;
                $(let $py = _py;)?
                $value
            }
        )+ }
    };
}
pub(crate) use getters;
