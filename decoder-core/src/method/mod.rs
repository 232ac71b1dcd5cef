//! The methods: for each a folder with its kernel functions (`mod.rs`, a twin), checks, cost and fast paths.
//!
//! A method is a line in this list, one in `kernel/method.rs`, a feature of the crate, and its rules in
//! [`crate::Rule`]; nothing else of the core knows it. Calls are direct, not by pointers, so that a compiler
//! leaves out what a build does not need.
//!
//! A method's module has, beside its twin functions: `check::METHOD`, `check::check_material`,
//! `check::check_dictionary`, `check::dictionary_fits`, and with the feature `batch` a module `fast`, which may be a
//! file that takes over `crate::fast::plain`.

use crate::container::header::Header;
use crate::kernel::material::Material;
use crate::kernel::method::each_method;
use crate::method::rule::Method;
use crate::walk::check::Check;

pub mod rule;
pub mod sparse_ensemble;
pub mod sparse_tensor;

macro_rules! dispatch {
    ($($feature:literal $module:ident $number:ident $textures:ident;)*) => {
        /// The methods of this build.
        pub const METHODS: &[&Method] = &[$(#[cfg(feature = $feature)] &$module::check::METHOD,)*];

        /// Walks the method's chapter over a material, fills in [`Material::parts`] and gives the operations of its
        /// part of a sample (4.2-1). `None` if there was a finding that it cannot go on from.
        #[allow(unused_variables, reason = "a build may have no method")]
        pub(crate) fn check_material(
            check: &mut Check<'_, '_>,
            header: &Header,
            external: Option<&Header>,
            material: &mut Material,
        ) -> Option<u64> {
            match header.method {
                $(#[cfg(feature = $feature)]
                $module::$number => $module::check::check_material(check, header, external, material),)*
                _ => None,
            }
        }

        /// Walks the method's chapter over a dictionary.
        #[allow(unused_variables, reason = "a build may have no method")]
        pub(crate) fn check_dictionary(check: &mut Check<'_, '_>, header: &Header) -> Option<()> {
            match header.method {
                $(#[cfg(feature = $feature)]
                $module::$number => $module::check::check_dictionary(check, header),)*
                _ => None,
            }
        }

        /// Whether a dictionary has what a material of the same method lacks, beyond what holds for every method
        /// (3.5-5).
        #[allow(unused_variables, reason = "a build may have no method")]
        pub(crate) fn dictionary_fits(check: &mut Check<'_, '_>, header: &Header, other: &Header) -> bool {
            match header.method {
                $(#[cfg(feature = $feature)]
                $module::$number => $module::check::dictionary_fits(check, header, other),)*
                _ => false,
            }
        }

        /// Batches and images by the material's method.
        #[cfg(feature = "batch")]
        #[allow(unused_variables, reason = "a build may have no method")]
        pub(crate) mod fast {
            use crate::query::FilteredQuery;
            use crate::fast::{ImageQuery, Textures};
            use crate::kernel::colour::Rgb;
            use crate::selvedge::Selvedge;

            /// Words of scratch that a batch of so many queries needs.
            pub(crate) fn batch_scratch_len(selvedge: &Selvedge<'_>, count: usize) -> usize {
                match selvedge.material().method {
                    $(#[cfg(feature = $feature)]
                    crate::method::$module::$number => crate::method::$module::fast::batch_scratch_len(selvedge, count),)*
                    _ => 0,
                }
            }

            /// Samples level 0: as many answers as queries. `None` if the scratch is too short.
            pub(crate) fn batch(
                selvedge: &Selvedge<'_>,
                queries: &[FilteredQuery],
                scratch: &mut [i32],
                out: &mut [Rgb],
            ) -> Option<()> {
                match selvedge.material().method {
                    $(#[cfg(feature = $feature)]
                    crate::method::$module::$number => crate::method::$module::fast::batch(selvedge, queries, scratch, out),)*
                    _ => Some(()),
                }
            }

            /// Words of scratch that an image needs.
            pub(crate) fn image_scratch_len(selvedge: &Selvedge<'_>) -> usize {
                match selvedge.material().method {
                    $(#[cfg(feature = $feature)]
                    crate::method::$module::$number => crate::method::$module::fast::image_scratch_len(selvedge),)*
                    _ => 0,
                }
            }

            /// Fills in the textures of an image of which a channel that is asked for has texture.
            pub(crate) fn image(
                selvedge: &Selvedge<'_>,
                query: &ImageQuery,
                scratch: &mut [i32],
                textures: Textures<'_>,
            ) {
                match selvedge.material().method {
                    $(#[cfg(feature = $feature)]
                    crate::method::$module::$number => crate::method::$module::fast::image(selvedge, query, scratch, textures),)*
                    _ => {}
                }
            }
        }
    };
}
each_method!(dispatch);

/// The method of a number, if this build has it.
pub fn method_of(number: u32) -> Option<&'static Method> {
    METHODS.iter().find(|method| method.number == number).copied()
}

/// The numbers of the methods of this build.
pub fn numbers() -> impl Iterator<Item = u32> {
    METHODS.iter().map(|method| method.number)
}
