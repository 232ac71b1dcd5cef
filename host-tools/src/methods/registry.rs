//! The list of methods, and the ways to find one.

use crate::error::{Result, ToolError};
use crate::methods::method::Method;
use selvedge::{Finding, Part, Rule, Selvedge};

/// Hands a macro the modules of the methods by number, a line each. Each has a `METHOD` and, in
/// `encode::encoder`, an `ENCODER`.
macro_rules! each_method {
    ($then:ident) => {
        $then! {
            sparse_ensemble
            sparse_tensor
        }
    };
}
pub(crate) use each_method;

macro_rules! methods {
    ($($module:ident)*) => {
        /// Every method of the tools, by number.
        pub const METHODS: &[&Method] = &[$(&crate::methods::$module::METHOD),*];
    };
}
each_method!(methods);

/// Byte of a header that has the method (3.1).
const METHOD_OFFSET: u32 = 20;

/// The method of a number.
///
/// # Errors
/// Rule 3.1-8 at the header's method, if these tools have none of that number.
pub fn by_number(number: u32) -> std::result::Result<&'static Method, Finding> {
    let unknown = Finding { rule: Rule::Method, part: Part::File, offset: METHOD_OFFSET, found: number };
    METHODS.iter().find(|method| method.number == number).copied().ok_or(unknown)
}

/// The method of an open material.
///
/// # Errors
/// As [`by_number`].
pub fn of(opened: &Selvedge<'_>) -> std::result::Result<&'static Method, Finding> {
    by_number(opened.header().method)
}

/// The method of a name.
///
/// # Errors
/// [`ToolError::Usage`] with all names, if no method has this one.
pub fn by_name(name: &str) -> Result<&'static Method> {
    METHODS.iter().find(|method| method.name == name).copied().ok_or_else(|| {
        let names: Vec<&str> = METHODS.iter().map(|method| method.name).collect();
        ToolError::Usage(format!("`{name}` is no method; there are {}", names.join(", ")))
    })
}
