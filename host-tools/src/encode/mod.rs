//! Encoding: a dataset becomes a file that meets a goal.
//!
//! | module | holds |
//! |---|---|
//! | [`goal`] | what a file has to reach, and the loop that reaches it |
//! | [`encoder`] | what every encoder is, and encoding with one of them |
//! | [`auto`] | the choice between methods |
//! | [`parse`] | values of options in text |

pub mod auto;
pub mod encoder;
pub mod goal;
pub mod parse;

use crate::methods::registry::each_method;
use encoder::Encoder;

macro_rules! encoders {
    ($($module:ident)*) => {
        /// The encoders of all methods with their default options, in the order of
        /// [`METHODS`](crate::methods::METHODS).
        pub static ENCODERS: &[&dyn Encoder] = &[$(&crate::methods::$module::encode::ENCODER),*];
    };
}
each_method!(encoders);
