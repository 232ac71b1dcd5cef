"""Chapter 3: the bytes of a file with its fields and sections."""

from chapters.conventions import MASK, Finding, align, as_i16

MATERIAL, DICTIONARY = 0, 1
MISSING, MEAN, FULL = 0, 1, 2

METADATA = 0x0001
REFERENCE = 0x0002
DIRECTIONS = 0x0003
MEANS = 0x0004
SCALES = 0x0005
OPTIONAL = 0x8000


class Section:
    """3.2: an entry of the directory."""

    def __init__(self, entry, kind, instance, offset, length, checksum):
        self.entry = entry  # byte of the entry
        self.kind, self.instance = kind, instance
        self.offset, self.length, self.checksum = offset, length, checksum


class Row:
    """3.3: a row of the table of sections in the chapter of a method.

    `per` says of what there is one section each. The calls are "required", "allowed" or "foreign": in a
    material, in a material that refers to a dictionary, and in a dictionary. All hold for full channels.
    """

    PER = ("file", "channel", "layer", "layer and channel")

    def __init__(self, kind, per, in_material, in_referring, in_dictionary):
        if per not in self.PER:
            raise ValueError("a section of kind %#06x for each %s" % (kind, per))
        self.kind, self.per = kind, per
        self.in_material, self.in_referring, self.in_dictionary = in_material, in_referring, in_dictionary
        self.of_levels = per.startswith("layer")  # of each layer of each level

    def instances(self, file):
        """The instances within a file, or those within a layer: a method has none without a full channel."""
        if self.per.endswith("channel"):
            return list(file.full)
        return [0] if file.full else []


class File:
    """The bytes of one file with its fields, for the checks and for queries."""

    def __init__(self, data, part):
        self.data = bytes(data)
        self.part = part
        self.sections = {}
        self.entries = []

    def fail(self, rule, offset, found):
        raise Finding(rule, self.part, offset, found)

    # 1.2-1, 1.2-4
    def u8(self, offset):
        return self.data[offset]

    def u16(self, offset):
        return self.data[offset] + 256 * self.data[offset + 1]

    def i16(self, offset):
        return as_i16(self.u16(offset))

    def word(self, index):
        """1.2-1."""
        b0, b1, b2, b3 = self.data[4 * index : 4 * index + 4]
        return b0 + 256 * b1 + 65536 * b2 + 16777216 * b3

    def u32(self, offset):
        return self.word(offset // 4)

    def packed_i16(self, table, index):
        """1.2-2: entry `index` of the table that begins at word `table`."""
        word = self.word(table + (index >> 1))
        return as_i16(word & 0xFFFF if index % 2 == 0 else word >> 16)

    def bit_window(self, start, bit, end=None):
        """1.2-3: 32 bits of the stream at word `start`; past `end` are zeros."""
        window = 0
        for step in (0, 1):
            index = start + (bit >> 5) + step
            word = 0
            if 4 * index + 4 <= len(self.data) and (end is None or index < end):
                word = self.word(index)
            window |= word << (32 * step)
        return (window >> (bit & 31)) & MASK

    def section(self, kind, instance=0):
        return self.sections.get((kind, instance))

    def read_header(self):
        """3.1: the fields that later chapters use."""
        self.content = self.u32(16)
        self.method = self.u32(20)
        self.section_count = self.u32(24)
        self.operations = self.u32(28)
        self.width, self.height = self.u32(32), self.u32(36)
        self.light_count, self.view_count = self.u32(40), self.u32(44)
        self.level_count = self.u32(48)
        self.edge, self.layer_count = self.u8(52), self.u8(53)
        self.state = [self.u8(56 + channel) for channel in range(3)]
        self.transfer, self.cosine_included = self.u8(60), self.u8(61)
        self.parameter = self.u32(64)
        self.matrix_q13 = [self.i16(68 + 2 * n) for n in range(9)]
        self.full = [channel for channel in range(3) if self.state[channel] == FULL]

    def check_rows(self, rule, at, rows, columns):
        """8.1-7, 10.1-4: the entries of rows of 16 bits, each row padded to a word."""
        halves = align(columns, 2)
        for row in range(rows):
            for column in range(halves):
                entry = at + 2 * (row * halves + column)
                value = self.u16(entry)
                if value == 0x8000 if column < columns else value != 0:
                    self.fail(rule, entry, value)
