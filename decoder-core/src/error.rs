//! Every rule that a file can break, and what a caller is told of it.
//!
//! A rule of the specification that `open` checks is one variant here, with the same number. The order
//! of the variants follows the order of the checks (1.4), which goes part by part: where rules are about
//! the same entry they are held against it together.

use core::fmt;

/// Who has to act.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// The file breaks the format.
    Invalid,
    /// The file is not known to be wrong, but this build cannot read it.
    Unsupported,
    /// The file asks for more than the caller's limits allow.
    Limits,
    /// The caller gave the wrong thing along with the file.
    Usage,
}

macro_rules! rules {
    ($($(#[$doc:meta])* $name:ident $id:literal $family:ident $title:literal;)*) => {
        /// A rule that `open` checks, in the order in which parts of a file are reached.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[non_exhaustive]
        pub enum Rule { $(#[doc = concat!($id, ": ", $title)] $name,)* }

        impl Rule {
            /// All rules, in order.
            pub const ALL: &'static [Rule] = &[$(Rule::$name,)*];

            /// Number in the specification, such as `3.1-1`.
            pub const fn id(self) -> &'static str {
                match self { $(Rule::$name => $id,)* }
            }

            /// What the rule asks for, in a few words.
            pub const fn title(self) -> &'static str {
                match self { $(Rule::$name => $title,)* }
            }

            /// Name of the variant, as in the conformance table.
            pub const fn name(self) -> &'static str {
                match self { $(Rule::$name => stringify!($name),)* }
            }

            /// Who has to act.
            pub const fn family(self) -> Family {
                match self { $(Rule::$name => Family::$family,)* }
            }
        }
    };
}

rules! {
    HeaderTooShort "3.1-1" Invalid "a file has at least the 128 bytes of its header";
    Magic "3.1-2" Invalid "the first eight bytes are 53 45 4c 56 0d 0a 1a 0a";
    MajorVersion "3.1-3" Unsupported "the major version is 1";
    FileLength "3.1-4" Invalid "the stated length is that of the file and a multiple of 16";
    SectionCount "3.1-5" Invalid "there are 1 to 4,096 sections and the directory lies in the file";
    HeaderChecksum "3.1-6" Invalid "the header's checksum is the CRC-32 of header and directory";
    Content "3.1-7" Invalid "the content is a material (0) or a dictionary (1)";
    Method "3.1-8" Unsupported "the method is known to this build";
    ImageSize "3.1-9" Invalid "width and height are 1 to 16,384";
    DirectionCount "3.1-10" Invalid "there are 1 to 1,024 directions of light and of view";
    LevelCount "3.1-11" Invalid "there are 1 to 15 levels and none after the first of one texel";
    BlockEdge "3.1-12" Invalid "the block edge is 1 to 16";
    LayerCount "3.1-13" Invalid "there are 1 to 8 quality layers";
    ChannelState "3.1-14" Invalid "each channel is missing (0), a mean (1) or full (2)";
    Transfer "3.1-15" Invalid "the transfer is log2 (0) or linear (1), the cosine flag 0 or 1";
    TransferParameter "3.1-16" Invalid "the log offset is +0 or a normal binary32 up to 1, the linear exponent within 60";
    ColourMatrix "3.1-17" Invalid "matrix entries are not -32768";
    HeaderReserved "3.1-18" Invalid "reserved words and unused bits of the header are zero";
    DictionaryHeader "3.1-19" Invalid "a dictionary's header states nothing of an image";
    LimitBytes "4.1-1" Limits "the file is not longer than the caller allows";
    LimitOperations "4.1-2" Limits "a sample does not cost more operations than the caller allows";
    LimitTexels "4.1-4" Limits "the image does not have more texels than the caller allows";
    SectionKind "3.2-1" Unsupported "a section is of a known kind or optional";
    SectionOrder "3.2-2" Invalid "entries ascend by kind, then instance";
    SectionOffset "3.2-3" Invalid "a section begins at the first multiple of 16 after the one before";
    SectionLength "3.2-4" Invalid "a section's length is a multiple of 4 and ends in the file";
    SectionPadding "3.2-5" Invalid "padding bytes are zero";
    FileEnd "3.2-6" Invalid "the last section's padding ends the file";
    SectionChecksum "3.2-7" Invalid "a section's checksum is the CRC-32 of its bytes";
    SectionMissing "3.3-1" Invalid "every section that the header calls for is there";
    SectionForeign "3.3-2" Invalid "no known section is there that the header does not call for";
    MetadataLength "3.4-1" Invalid "the metadata hold eight words and three strings and nothing more";
    MetadataValue "3.4-2" Invalid "metadata codes are defined and reserved words zero";
    MetadataText "3.4-3" Invalid "metadata strings are UTF-8 without control or invisible characters, padded with zero";
    ExternalLength "3.5-1" Invalid "the reference to a dictionary has 48 bytes, its last 12 zero";
    ExternalMissing "3.5-2" Usage "a material with an external dictionary is opened with it";
    ExternalUnwanted "3.5-3" Usage "a material without an external dictionary is opened without one";
    ExternalDigest "3.5-4" Usage "the dictionary given is the one that the material names";
    ExternalFit "3.5-5" Invalid "the dictionary has the material's method, directions, channels and edge";
    DirectionsLength "5.3-1" Invalid "the section is as long as its counts say";
    DirectionsCounts "5.3-2" Invalid "the counts fit the header, the grid and a triangulation";
    DirectionPoint "5.3-3" Invalid "points lie in the unit disc and differ";
    DirectionCosine "5.3-4" Invalid "the cosine is that of the point";
    TriangleShape "5.4-3" Invalid "a triangle has three directions, lowest first, and a positive area";
    TriangleReciprocal "5.4-4" Invalid "shift and reciprocal are those of the area";
    TriangleOrder "5.4-5" Invalid "triangles ascend";
    GridStarts "5.5-2" Invalid "the grid's starts ascend from zero to the count of candidates";
    GridCell "5.5-5" Invalid "a cell lists at most 256 triangles";
    GridCandidate "5.5-3" Invalid "a cell lists, ascending, the triangles that meet it";
    GridComplete "5.5-4" Invalid "a cell lists every triangle that meets it";
    HullEdge "5.7-6" Invalid "a hull edge has two directions and the reciprocal of its length squared";
    HullConvex "5.7-7" Invalid "the hull turns left once around";
    Cover "5.7-8" Invalid "the triangles cover the hull once";
    TableLength "8.1-5" Invalid "a table of pairs has four words and a row for each view";
    TableHeader "8.1-6" Invalid "base and shift are within their ranges, reserved words zero";
    TableEntry "8.1-7" Invalid "entries are not -32768 and the unused half of a row is zero";
    FactorLength "10.1-1" Invalid "a section of factors is as long as its tables";
    FactorCounts "10.1-2" Invalid "there are 1 to 256 dictionaries with columns in range";
    FactorOffset "10.1-3" Invalid "tables follow each other in order";
    FactorEntry "10.1-4" Invalid "entries are not -32768 and the unused half of a row is zero";
    SpatialCounts "10.2-1" Invalid "spatial factors have the dictionaries of the angular ones";
    AtomsLength "10.5-3" Invalid "a table of atoms is as long as its counts say";
    AtomsCounts "10.5-4" Invalid "there is a list of at most 65,536 atoms for each dictionary, in order";
    AtomColumn "10.5-5" Invalid "an atom names columns that are there";
    AtomOrder "10.5-6" Invalid "atoms ascend";
    AtomQuantiser "10.5-7" Invalid "an atom's base is not -32768 and base plus step is at most 32,767";
    CoefficientsLength "10.3-2" Invalid "a section of coefficients is as long as its counts say";
    CoefficientsHeader "10.3-3" Invalid "field widths and the block count are in range";
    RecordPlace "10.4-6" Invalid "records follow each other without a gap and end with the stream";
    RecordHeader "10.4-7" Invalid "dictionary, shift and low bits of a record are in range, zero if it is empty";
    RecordPositions "10.4-8" Invalid "positions ascend and name atoms of the dictionary";
    RecordZeros "10.4-11" Invalid "the high parts of a record have at most 32 zeros for each coefficient, and 32";
    RecordSum "10.7-7" Invalid "the shifted magnitudes of a record sum to at most 65,535";
    StreamEnd "10.4-9" Invalid "bits after the last record are zero";
    LargestCount "10.3-4" Invalid "the stated largest count is that of the records";
    LightAtomsLength "12.1-1" Invalid "light atoms have two words and a row for each light";
    LightAtomsCounts "12.1-2" Invalid "there are 1 to 256 light atoms, the reserved word is zero";
    LightAtomsEntry "12.1-3" Invalid "bits of channels without texture, and the two highest, are zero";
    FibresLength "12.2-1" Invalid "the section of fibres is as long as its counts say";
    FibresShape "12.2-2" Invalid "there are 1 to 1,024 ABRDF atoms with 1 to 32 entries of as many index bits as the light atoms need";
    FibresShifts "12.2-3" Invalid "bits beyond the two shifts of an ABRDF atom are zero";
    FibreIndex "12.2-4" Invalid "an entry names a light atom that is there, an unused half is zero";
    FibreSum "12.2-5" Invalid "the magnitudes of a fibre sum to at most eight";
    ListsLength "12.3-2" Invalid "a section of lists is as long as its counts say";
    ListsHeader "12.3-3" Invalid "field widths, shift and the number of texels are in range";
    ListPlace "12.4-6" Invalid "groups and lists follow each other without a gap and end with the stream";
    ListOutside "12.4-7" Invalid "texels outside the image have no coefficients";
    ListIndices "12.4-8" Invalid "a list has as many ones as coefficients, and its indices ascend and name ABRDF atoms";
    ListSum "12.5-8" Invalid "the shifted magnitudes of a list sum to at most 65,534";
    ListsEnd "12.4-9" Invalid "bits after the last list are zero";
    ListsLargest "12.3-4" Invalid "the stated largest count is that of the lists";
    StatedOperations "4.2-1" Invalid "the stated operations are those of the formula";
}

/// Which of the two files a finding is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Part {
    /// The file itself.
    #[default]
    File,
    /// The external dictionary.
    Dictionary,
}

/// One broken rule: which, where, and what was found there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The rule.
    pub rule: Rule,
    /// Which file.
    pub part: Part,
    /// Byte offset from the start of that file.
    pub offset: u32,
    /// What was found there.
    pub found: u32,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.part == Part::Dictionary {
            f.write_str("dictionary: ")?;
        }
        write!(
            f,
            "{} at byte {}: {}; found {} ({:#x})",
            self.rule.id(),
            self.offset,
            self.rule.title(),
            self.found,
            self.found
        )
    }
}

impl core::error::Error for Finding {}

/// Where a checker tells its findings.
pub trait Sink {
    /// Takes one finding; `false` ends the check.
    fn report(&mut self, finding: Finding) -> bool;
}

impl<F: FnMut(Finding) -> bool> Sink for F {
    fn report(&mut self, finding: Finding) -> bool {
        self(finding)
    }
}

/// The first finding and no more.
#[derive(Debug, Default)]
pub struct First(pub Option<Finding>);

impl Sink for First {
    fn report(&mut self, finding: Finding) -> bool {
        self.0.get_or_insert(finding);
        false
    }
}
