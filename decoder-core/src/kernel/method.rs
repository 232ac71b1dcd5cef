//! Which method answers (chapter 8.3): one line for each. Twin: written by `selvedge_shaders::assemble` for the
//! methods of a request.

use crate::kernel::colour::Values;
use crate::kernel::direction::Located;
use crate::kernel::material::Material;
use crate::kernel::position::Place;
use crate::kernel::words::Words;

/// Hands a macro the methods, a line each: feature, module, number, function of the textures.
macro_rules! each_method {
    ($then:ident) => {
        $then! {
            "sparse-ensemble" sparse_ensemble METHOD_SPARSE_ENSEMBLE sparse_ensemble_textures_q20;
            "sparse-tensor" sparse_tensor METHOD_SPARSE_TENSOR sparse_tensor_textures_q20;
        }
    };
}
pub(crate) use each_method;

macro_rules! textures {
    ($($feature:literal $module:ident $number:ident $textures:ident;)*) => {
        /// The textures of all channels by the material's method, Q20 (8.3-3).
        #[allow(unused_variables, reason = "a build may have no method")]
        pub fn textures_q20(
            words: Words<'_>,
            material: &Material,
            place: &Place,
            light: &Located,
            view: &Located,
        ) -> Values {
            match material.method {
                $(#[cfg(feature = $feature)]
                crate::method::$module::$number => {
                    crate::method::$module::$textures(words, material, place, light, view)
                })*
                // Nothing of another method can be opened (3.1-8).
                _ => Values { c0: 0, c1: 0, c2: 0 },
            }
        }
    };
}
each_method!(textures);
