//! The methods: for each a folder with its kernel functions (`mod.rs`, a twin), checks, cost and fast paths.
//!
//! A method is a line in this list, one in `kernel/method.rs`, a feature of the crate, and its rules in
//! [`crate::Rule`]; nothing else of the core knows it. Calls are direct, not by pointers, so that a compiler
//! leaves out what a build does not need.
//!
//! A method's module has, beside its twin functions: `check::METHOD`, `check::check_material`,
//! `check::check_dictionary`, `check::dictionary_fits`, and with the feature `batch` a module `fast`, which may be
//! `crate::fast::plain`.

use crate::container::header::Header;
use crate::kernel::material::Material;
use crate::kernel::method::each_method;
use crate::walk::check::Check;

pub mod sparse_ensemble;
pub mod sparse_tensor;

/// Whether a section of a method has to be in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// The header calls for it.
    Required,
    /// It may be there or not.
    Allowed,
    /// It must not be there.
    Foreign,
}

/// Of what a file has one section of a kind, and how the instances are numbered (3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// One, instance 0, where any channel has texture.
    File,
    /// One for each channel with texture: its number.
    Channel,
    /// One for each level and quality layer: `level << 8 | layer << 4`.
    Layer,
    /// One for each level, quality layer and channel with texture: `level << 8 | layer << 4 | channel`.
    LayerChannel,
}

/// Which file has a section (3.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The material's.
    Material,
    /// The external dictionary's if there is one, else the material's.
    Dictionary,
    /// The material's or, where that has none, the external dictionary's.
    Either,
}

/// A kind of section that a method has.
#[derive(Clone, Copy, Debug)]
pub struct SectionRule {
    /// Kind: the method's number in bits 8 to 15.
    pub kind: u32,
    /// Instances.
    pub per: Per,
    /// File.
    pub source: Source,
}

/// What the rest of the core asks of a method.
pub struct Method {
    /// Number in the header (3.1-8).
    pub number: u32,
    /// Largest edge of a block (3.1-12).
    pub largest_edge: u32,
    /// Means of a channel with texture (8.1). A channel that is a mean alone always needs its means.
    pub means: Call,
    /// Scales of a channel with texture (8.2).
    pub scales: Call,
    /// Its kinds of sections, ascending.
    pub sections: &'static [SectionRule],
}

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
            use crate::batch::FilteredQuery;
            use crate::fast::{ImageQuery, Textures};
            use crate::kernel::colour::Rgb;
            use crate::selvedge::Selvedge;

            /// Words of scratch that a batch of so many queries needs.
            pub(crate) fn batch_scratch_len(selvedge: &Selvedge<'_>, count: usize) -> usize {
                match selvedge.material().method {
                    $(#[cfg(feature = $feature)]
                    super::$module::$number => super::$module::fast::batch_scratch_len(selvedge, count),)*
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
                    super::$module::$number => super::$module::fast::batch(selvedge, queries, scratch, out),)*
                    _ => Some(()),
                }
            }

            /// Words of scratch that an image needs.
            pub(crate) fn image_scratch_len(selvedge: &Selvedge<'_>) -> usize {
                match selvedge.material().method {
                    $(#[cfg(feature = $feature)]
                    super::$module::$number => super::$module::fast::image_scratch_len(selvedge),)*
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
                    super::$module::$number => super::$module::fast::image(selvedge, query, scratch, textures),)*
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

impl Method {
    /// The rule of a kind, if it is one of this method's.
    pub fn section_rule(&self, kind: u32) -> Option<&'static SectionRule> {
        self.sections.iter().find(|rule| rule.kind == kind)
    }
}

impl SectionRule {
    /// Whether a header has this instance (3.3).
    pub fn has_instance(&self, header: &Header, instance: u32) -> bool {
        let (level, layer, rest) = (instance >> 8, (instance >> 4) & 0xf, instance & 0xf);
        let in_layers = level < header.level_count && layer < header.layer_count;
        match self.per {
            Per::File => instance == 0 && header.has_texture(),
            Per::Channel => header.is_full(instance),
            Per::Layer => in_layers && rest == 0 && header.has_texture(),
            Per::LayerChannel => in_layers && rest < 3 && header.is_full(rest),
        }
    }

    /// Whether a file of the header's content has to have an instance that [`SectionRule::has_instance`].
    pub fn call(&self, in_dictionary: bool, external: bool) -> Call {
        match (self.source, in_dictionary, external) {
            (Source::Material, true, _) => Call::Foreign,
            (Source::Material, false, _) => Call::Required,
            (Source::Dictionary, true, _) | (Source::Dictionary, false, false) => Call::Required,
            (Source::Dictionary, false, true) => Call::Foreign,
            (Source::Either, true, _) | (Source::Either, false, true) => Call::Allowed,
            (Source::Either, false, false) => Call::Required,
        }
    }
}

/// The instance of a level, quality layer and channel (3.3).
pub fn layer_instance(level: u32, layer: u32, channel: u32) -> u32 {
    level << 8 | layer << 4 | channel
}
