//! What the rest of the core asks of a method: its record, and the table of its sections (3.3).

use crate::container::header::Header;

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
