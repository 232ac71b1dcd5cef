//! Which method answers (chapter 8.3): one line for each, for what decodes and for what is checked.
//!
//! Twin: written by `selvedge_shaders::assemble` for the methods of a request.

use crate::kernel::colour::Values;
use crate::kernel::direction::Located;
use crate::kernel::material::Material;
use crate::kernel::position::Place;
use crate::kernel::words::Words;
use crate::method;

/// Makes the dispatch and the list of methods from one line a method: feature, module, number, textures.
macro_rules! methods {
    ($($feature:literal $module:ident $number:ident $textures:ident;)*) => {
        /// The textures of all channels by the material's method, Q20 (8.3-3).
        pub fn textures_q20(
            words: Words<'_>,
            material: &Material,
            place: Place,
            light: Located,
            view: Located,
        ) -> Values {
            match material.method {
                $(#[cfg(feature = $feature)]
                method::$module::$number => method::$module::$textures(words, material, place, light, view),)*
                // Nothing of another method can be opened (3.1-8).
                _ => {
                    let _ = (words, place, light, view);
                    Values { c0: 0, c1: 0, c2: 0 }
                }
            }
        }

        /// The methods of this build.
        pub(crate) const METHODS: &[&method::Method] = &[
            $(#[cfg(feature = $feature)] &method::$module::check::METHOD,)*
        ];
    };
}

methods! {
    "sparse-ensemble" sparse_ensemble METHOD_SPARSE_ENSEMBLE sparse_ensemble_textures_q20;
    "sparse-tensor" sparse_tensor METHOD_SPARSE_TENSOR sparse_tensor_textures_q20;
}
