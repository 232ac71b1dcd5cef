#!/usr/bin/env python3
"""A second decoder and checker of Selvedge, format version 1.

Written from the text of the specification alone, to be compared with the
decoder bit for bit. It is slow and plain on purpose: it follows the chapters
of the text in order, uses their names, and every function names its rules.
Only the standard library is used.

Commands
  check FILE [--dictionary F] [--max-bytes N] [--max-operations N] [--max-texels N]
      prints the first broken rule as "rule part offset found", tab separated,
      or nothing; exit code 0 or 3.
  digest FILE [--dictionary F] [--layers N]
      prints the decode digest of 11.2.
  vectors DIR
      compares everything in DIR/manifest.tsv; a line for each disagreement,
      then a summary; exit code 1 if anything disagrees.
  samples FILE [--dictionary F] [--layers N]
      reads queries from standard input, prints one line of results for each.
  example TEXT OUT
      collects the bytes of the worked example from the text and writes them.
  tensor-example TEXT FILE
      compares the bytes of the tensor example that chapter 12 shows with those of FILE.
  selftest
      computes the numeric examples of the text that need no file.

Protocol of `samples`: a line has a word and decimal integers, separated by
spaces; a query's direction is x_q18 y_q18 z_q15. Empty lines and lines that
begin with # are skipped. The answer has one line for each line asked.

  point x y light view
  texel x y  light_x light_y light_z  view_x view_y view_z
  filtered level u_q32 v_q32  light_x light_y light_z  view_x view_y view_z
  trilinear level_q16 u_q32 v_q32  light_x light_y light_z  view_x view_y view_z
      -> red green blue, each as eight hexadecimal digits
  light x_q18 y_q18 z_q15
  view x_q18 y_q18 z_q15
      -> the taps: a b c weight_a weight_b weight_c cosine, in decimal
  direction x_bits y_bits z_bits        (binary32 patterns, 5.2)
      -> x_q18 y_q18 z_q15, in decimal
  fraction bits                         (binary32 pattern, 6.1-2)
      -> the fraction as eight hexadecimal digits
  layers n
      -> "layers n"; from here on layer_limit is n

A line that is not understood is answered with "error".
"""

import hashlib
import os
import struct
import sys

# ---------------------------------------------------------------- chapter 1

MASK = 0xFFFFFFFF

ONE_Q14 = 16384
ONE_Q18 = 262144
ONE_Q15 = 32768
HALF_Q15 = 16384
HALF_Q13 = 4096
ONE_Q30 = 0x40000000
BINARY32_MAX = 0x7F7FFFFF
VALUE_BOUND = 0x08000000
RECORD_BOUND = 0x02000000
LAYER_BOUND = 0x08000000

# How often a value left its word where the text proves that it does not.
wraps = [0]


def i32(value):
    """2.1-1, 2.1-2: a signed word. The text bounds every use of this."""
    word = ((value + 0x80000000) & MASK) - 0x80000000
    if word != value:
        wraps[0] += 1
    return word


def u32(value):
    """2.1-1: an unsigned word. The text bounds every use of this."""
    word = value & MASK
    if word != value:
        wraps[0] += 1
    return word


def modulo32(value):
    """2.1-1, where the text means the wrap."""
    return value & MASK


def as_i16(half):
    """1.2-2: two's complement of 16 bits."""
    return half - 65536 if half >= 32768 else half


def as_i32(word):
    """2.1-2: an unsigned word read as a signed one."""
    return word - (1 << 32) if word >= 0x80000000 else word


def crc32(data):
    """1.3-1, bit by bit through a table of bytes."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = CRC_TABLE[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF


def crc_of_byte(byte):
    """1.3-1: eight steps, lowest bit first."""
    for _ in range(8):
        byte = (byte >> 1) ^ 0xEDB88320 if byte & 1 else byte >> 1
    return byte


CRC_TABLE = [crc_of_byte(byte) for byte in range(256)]


def align(value, unit):
    """The first multiple of `unit` that is not before `value`."""
    return (value + unit - 1) // unit * unit


def ceil_div(n, d):
    return -(-n // d)


class Finding(Exception):
    """1.4-4: a broken rule."""

    def __init__(self, rule, part, offset, found):
        super().__init__(rule, part, offset, found)
        self.rule, self.part, self.offset, self.found = rule, part, offset, found

    def row(self):
        return (self.rule, self.part, self.offset, self.found)


class Limits:
    """4.1: what the caller allows; None is no limit."""

    def __init__(self, max_bytes=None, max_operations=None, max_texels=None):
        self.max_bytes = max_bytes
        self.max_operations = max_operations
        self.max_texels = max_texels


# ---------------------------------------------------------------- chapter 2


def multiply_q15(p, u):
    """2.2-1."""
    return i32(i32((p >> 15) * u) + (i32(i32((p & 0x7FFF) * u) + HALF_Q15) >> 15))


def multiply_q13(p, u):
    """2.2-2."""
    return i32(i32((p >> 13) * u) + (i32(i32((p & 0x1FFF) * u) + HALF_Q13) >> 13))


def round_shift(p, shift):
    """2.2-3."""
    if shift == 0:
        return p
    return i32((p >> shift) + ((p >> (shift - 1)) & 1))


def product_high(a, b):
    """2.2-4."""
    return (a * b) >> 32


def divide(n, d, bits):
    """2.2-5."""
    return (n << bits) // d


def clamp_magnitude(x, bound):
    """2.2-6."""
    return max(min(x, bound), -bound)


# 2.3-2
EXP2_C1 = 0xB17215AF
EXP2_C2 = 0x3D7FAAF3
EXP2_C3 = 0x0E344889
EXP2_C4 = 0x027A1725
EXP2_C5 = 0x0051B593
EXP2_C6 = 0x000E2A0C


def exp2_q31(fraction_q20):
    """2.3-1."""
    x_q32 = u32(fraction_q20 << 12)
    y5 = u32(EXP2_C5 + product_high(EXP2_C6, x_q32))
    y4 = u32(EXP2_C4 + product_high(y5, x_q32))
    y3 = u32(EXP2_C3 + product_high(y4, x_q32))
    y2 = u32(EXP2_C2 + product_high(y3, x_q32))
    y1 = u32(EXP2_C1 + product_high(y2, x_q32))
    return u32(0x80000000 + (product_high(y1, x_q32) >> 1))


def leading_zeros(word):
    return 32 - word.bit_length()


def assemble_binary32(mantissa, exponent):
    """2.4-1, 2.4-2, 2.4-3."""
    if mantissa == 0:
        return 0
    shift = leading_zeros(mantissa)
    normal = u32(mantissa << shift)
    rounded = u32((normal >> 8) + ((normal >> 7) & 1))
    biased = i32(i32(exponent - shift) + 126)
    if biased < 0:
        return 0
    if biased > 253:
        return BINARY32_MAX
    bits = u32(u32(biased << 23) + rounded)
    return BINARY32_MAX if bits > BINARY32_MAX else bits


# ---------------------------------------------------------------- chapter 3

MAGIC = bytes.fromhex("53454c560d0a1a0a")
MATERIAL, DICTIONARY = 0, 1
MISSING, MEAN, FULL = 0, 1, 2
ENSEMBLE, TENSOR = 1, 2

METADATA = 0x0001
REFERENCE = 0x0002
DIRECTIONS = 0x0003
MEANS = 0x0004
SCALES = 0x0005
ANGULAR = 0x0110
SPATIAL = 0x0111
ATOMS = 0x0112
COEFFICIENTS = 0x0113
LIGHT_ATOMS = 0x0210
FIBRES = 0x0211
LISTS = 0x0212
OPTIONAL = 0x8000
KNOWN_KINDS = (METADATA, REFERENCE, DIRECTIONS, MEANS, SCALES, ANGULAR, SPATIAL, ATOMS, COEFFICIENTS)
KNOWN_KINDS += (LIGHT_ATOMS, FIBRES, LISTS)


class Section:
    """3.2: an entry of the directory."""

    def __init__(self, entry, kind, instance, offset, length, checksum):
        self.entry = entry  # byte of the entry
        self.kind, self.instance = kind, instance
        self.offset, self.length, self.checksum = offset, length, checksum


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


def check_begin(file):
    """1.4, step 1: 3.1-1 to 3.1-6."""
    data = file.data
    if len(data) < 128:
        file.fail("3.1-1", 0, min(len(data), MASK))
    if data[0:8] != MAGIC:
        at = 4 if data[0:4] == MAGIC[0:4] else 0
        file.fail("3.1-2", at, file.u32(at))
    if file.u16(8) != 1:
        file.fail("3.1-3", 8, file.u16(8))
    stated = file.u32(12)
    if stated != len(data) or stated % 16 != 0 or stated > 0xFFFFFFF0:
        file.fail("3.1-4", 12, stated)
    count = file.u32(24)
    if not 1 <= count <= 4096 or 128 + 16 * count > len(data):
        file.fail("3.1-5", 24, count)
    if file.u32(124) != crc32(data[0:124] + data[128 : 128 + 16 * count]):
        file.fail("3.1-6", 124, file.u32(124))


def check_header(file, content=None):
    """1.4, step 2: 3.1-7 to 3.1-19. `content` is 1 for a dictionary given along."""
    file.read_header()
    if file.content not in (MATERIAL, DICTIONARY) or content not in (None, file.content):
        file.fail("3.1-7", 16, file.content)
    if file.method not in (ENSEMBLE, TENSOR):
        file.fail("3.1-8", 20, file.method)
    for at in (32, 36):
        if not 1 <= file.u32(at) <= 16384:
            file.fail("3.1-9", at, file.u32(at))
    for at in (40, 44):
        if not 1 <= file.u32(at) <= 1024:
            file.fail("3.1-10", at, file.u32(at))
    levels = file.level_count
    if not 1 <= levels <= 15:
        file.fail("3.1-11", 48, levels)
    if levels > 1 and max(level_size(file.width, levels - 2), level_size(file.height, levels - 2)) <= 1:
        file.fail("3.1-11", 48, levels)
    if not 1 <= file.edge <= (16 if file.method == ENSEMBLE else 1):
        file.fail("3.1-12", 52, file.edge)
    if not 1 <= file.layer_count <= 8:
        file.fail("3.1-13", 53, file.layer_count)
    for channel in range(3):
        if file.state[channel] > 2:
            file.fail("3.1-14", 56 + channel, file.state[channel])
    if file.transfer > 1:
        file.fail("3.1-15", 60, file.transfer)
    if file.cosine_included > 1:
        file.fail("3.1-15", 61, file.cosine_included)
    parameter = file.parameter
    if file.transfer == 1:
        if not -60 <= as_i32(parameter) <= 60:
            file.fail("3.1-16", 64, parameter)
    elif parameter != 0 and not 0x00800000 <= parameter <= 0x3F800000:
        file.fail("3.1-16", 64, parameter)
    for n in range(9):
        if file.matrix_q13[n] == -32768:
            file.fail("3.1-17", 68 + 2 * n, 0xFFFF8000)
    for at, unused in ((54, file.u16(54)), (59, file.u8(59)), (62, file.u16(62)), (86, file.u16(86))):
        if unused != 0:
            file.fail("3.1-18", at, unused)
    for at in range(88, 121, 4):
        if file.u32(at) != 0:
            file.fail("3.1-18", at, file.u32(at))
    if file.content == DICTIONARY:
        if file.operations != 0:
            file.fail("3.1-19", 28, file.operations)
        for at, value in ((32, file.width), (36, file.height), (48, file.level_count), (53, file.layer_count)):
            if value != 1:
                file.fail("3.1-19", at, value)
        for channel in range(3):
            if file.state[channel] == MEAN:
                file.fail("3.1-19", 56 + channel, MEAN)
        for at in range(60, 85, 4):
            if file.u32(at) != 0:
                file.fail("3.1-19", at, file.u32(at))


def check_limits(file, limits):
    """1.4, step 3: 4.1-1, 4.1-2, 4.1-4."""
    if limits.max_bytes is not None and len(file.data) > limits.max_bytes:
        file.fail("4.1-1", 12, len(file.data))
    if limits.max_operations is not None and file.operations > limits.max_operations:
        file.fail("4.1-2", 28, file.operations)
    texels = file.width * file.height
    if limits.max_texels is not None and texels > limits.max_texels:
        file.fail("4.1-4", 32, min(texels, MASK))


def check_padding(file, begin, end):
    """3.2-5."""
    for at in range(begin, end):
        if file.data[at] != 0:
            file.fail("3.2-5", at, file.data[at])


def check_directory(file):
    """1.4, steps 5 to 7: 3.2-1 to 3.2-7."""
    end = 128 + 16 * file.section_count
    before = None
    for n in range(file.section_count):
        entry = 128 + 16 * n
        section = Section(
            entry,
            file.u16(entry),
            file.u16(entry + 2),
            file.u32(entry + 4),
            file.u32(entry + 8),
            file.u32(entry + 12),
        )
        if section.kind < OPTIONAL and section.kind not in KNOWN_KINDS:
            file.fail("3.2-1", entry, section.kind)
        order = (section.kind, section.instance)
        if before is not None and order <= before:
            file.fail("3.2-2", entry, file.u32(entry))
        before = order
        if section.offset != align(end, 16):
            file.fail("3.2-3", entry + 4, section.offset)
        if section.length % 4 != 0 or section.offset + section.length > len(file.data):
            file.fail("3.2-4", entry + 8, section.length)
        check_padding(file, end, section.offset)
        end = section.offset + section.length
        file.entries.append(section)
        file.sections[order] = section
    check_padding(file, end, align(end, 16))
    if align(end, 16) != len(file.data):
        file.fail("3.2-6", end, len(file.data))
    for section in file.entries:
        if crc32(file.data[section.offset : section.offset + section.length]) != section.checksum:
            file.fail("3.2-7", section.entry + 12, section.checksum)


def called_for(file):
    """3.3: the required sections in the order of step 8, then the allowed ones."""
    required, allowed = [(METADATA, 0)], []
    channels = range(3)
    # A kind of the other method is foreign, and one of the method 2 without a channel of state 2.
    ensemble = file.full if file.method == ENSEMBLE else []
    tensor = file.method == TENSOR and bool(file.full)
    if file.content == DICTIONARY:
        required += [(ANGULAR, channel) for channel in ensemble]
        allowed += [(SPATIAL, channel) for channel in ensemble]
        if tensor:
            required += [(LIGHT_ATOMS, 0), (FIBRES, 0)]
        return required, allowed
    referring = file.section(REFERENCE) is not None
    allowed.append((REFERENCE, 0))
    required.append((DIRECTIONS, 0))
    (required if file.view_count != file.light_count else allowed).append((DIRECTIONS, 1))
    required += [(MEANS, channel) for channel in channels if file.state[channel] != MISSING]
    allowed += [(SCALES, channel) for channel in file.full]
    if not referring:
        required += [(ANGULAR, channel) for channel in ensemble]
    (allowed if referring else required).extend((SPATIAL, channel) for channel in ensemble)
    required += [(ATOMS, channel) for channel in ensemble]
    if tensor and not referring:
        required += [(LIGHT_ATOMS, 0), (FIBRES, 0)]
    for level in range(file.level_count):
        for layer in range(file.layer_count):
            for channel in ensemble:
                required.append((COEFFICIENTS, level * 256 + layer * 16 + channel))
            if tensor:
                required.append((LISTS, level * 256 + layer * 16))
    return required, allowed


def check_sections(file):
    """1.4, step 8: 3.3-1, then 3.3-2."""
    required, allowed = called_for(file)
    for kind, instance in required:
        if (kind, instance) not in file.sections:
            file.fail("3.3-1", 128, kind + 65536 * instance)
    for section in file.entries:
        order = (section.kind, section.instance)
        if section.kind < OPTIONAL and order not in required and order not in allowed:
            file.fail("3.3-2", section.entry, file.u32(section.entry))


def bad_character(code):
    """3.4-3."""
    return (
        code <= 0x1F
        or 0x7F <= code <= 0x9F
        or 0x200B <= code <= 0x200F
        or 0x2028 <= code <= 0x202E
        or 0x2060 <= code <= 0x206F
        or code == 0xFEFF
    )


def check_metadata(file):
    """1.4, step 9: 3.4-1, 3.4-2, 3.4-3."""
    section = file.section(METADATA)
    begin, end = section.offset, section.offset + section.length
    if section.length < 44:
        file.fail("3.4-1", begin, section.length)
    for at, most in ((8, 2), (12, 2), (16, 4), (20, 0), (24, 0), (28, 0)):
        if file.u32(begin + at) > most:
            file.fail("3.4-2", begin + at, file.u32(begin + at))
    at = begin + 32
    for _ in range(3):
        if at + 4 > end:
            file.fail("3.4-1", at, section.length)
        length = file.u32(at)
        if at + 4 + length > end:
            file.fail("3.4-1", at, section.length)
        after = at + 4 + align(length, 4)
        try:
            text = file.data[at + 4 : at + 4 + length].decode("utf-8", "strict")
        except UnicodeDecodeError:
            file.fail("3.4-3", at, length)
        if any(bad_character(ord(character)) for character in text):
            file.fail("3.4-3", at, length)
        if any(file.data[at + 4 + length : after]):
            file.fail("3.4-3", at, length)
        at = after
    if at != end:
        file.fail("3.4-1", begin, section.length)


def check_reference(file, dictionary, limits):
    """1.4, step 10: 3.5-1 to 3.5-5. Gives the dictionary as a File, or None."""
    section = file.section(REFERENCE)
    if section is None:
        if dictionary is not None:
            file.fail("3.5-3", 0, 0)
        return None
    begin = section.offset
    if section.length != 48 or any(file.data[begin + 36 : begin + 48]):
        file.fail("3.5-1", begin, section.length)
    stated = file.u32(begin + 32)
    if dictionary is None:
        file.fail("3.5-2", begin, stated)
    if limits.max_bytes is not None and stated > limits.max_bytes:
        file.fail("4.1-1", begin + 32, stated)
    digest = hashlib.sha256(dictionary).digest()
    if stated != len(dictionary) or digest != file.data[begin : begin + 32]:
        file.fail("3.5-4", begin, len(dictionary))
    other = File(dictionary, "dictionary")
    check_dictionary(other, limits, DICTIONARY)
    same = (
        other.method == file.method
        and other.light_count == file.light_count
        and other.view_count == file.view_count
        and all(other.state[channel] == FULL for channel in file.full)
    )
    for channel in file.full if file.method == ENSEMBLE else []:
        if file.section(SPATIAL, channel) is None:
            same = same and other.section(SPATIAL, channel) is not None and other.edge == file.edge
    if not same:
        file.fail("3.5-5", begin, other.edge)
    return other


def check_dictionary(file, limits, content=None):
    """1.4, step 14 (3.5-6)."""
    check_begin(file)
    check_header(file, content)
    check_limits(file, limits)
    check_dictionary_rest(file)


def check_dictionary_rest(file):
    """1.4, step 14, from step 5 on."""
    check_directory(file)
    check_sections(file)
    check_metadata(file)
    if file.method == TENSOR:
        if file.full:
            check_tensor_tables(file)
        return
    for channel in file.full:
        check_factors(file, ANGULAR, channel)
        if file.section(SPATIAL, channel) is not None:
            check_factors(file, SPATIAL, channel)
            check_dictionary_counts(file, file, channel)


# ---------------------------------------------------------------- chapter 4


def stated_cost(file, textures):
    """4.2-1. `textures` is that of the method."""
    locate_light = operations_to_locate(file.light_set)
    locate_view = operations_to_locate(file.view_set)
    means = sum(1 for channel in range(3) if file.state[channel] != MISSING)
    scales = sum(1 for channel in range(3) if file.section(SCALES, channel) is not None)
    return min(18 + locate_light + locate_view + 15 * means + 17 * scales + textures + 102, MASK)


def textures_of_ensemble(file, largest_counts):
    """4.2-1, 4.2-2. `largest_counts[(level, layer, channel)]` is `n`."""
    edge = file.edge
    records = 0
    for level in range(file.level_count):
        level_sum = 0
        for layer in range(file.layer_count):
            for channel in file.full:
                n = largest_counts[level, layer, channel]
                level_sum += 9 * n + 4 * min(n, edge * edge) + 4 * min(n, edge) + 8
        records = max(records, level_sum)
    return 4 * records


def textures_of_tensor(file, tensor, largest_counts):
    """4.2-1, 4.2-4. `largest_counts[(level, layer)]` is `n`."""
    textures = 0
    for level in range(file.level_count):
        level_sum = 0
        for layer in range(file.layer_count):
            n = largest_counts[level, layer]
            level_sum += 12 * n + min(4 * n, tensor.atom_count) * (39 * tensor.entries + 6)
        textures = max(textures, level_sum)
    return textures


def operations_to_locate(directions):
    """4.2-3."""
    return 2 + 6 * directions.most_candidates() + 6 * directions.hull_count + 7


# ---------------------------------------------------------------- chapter 5


def cross(a, b, p):
    """5.4-1."""
    return i32(
        i32(i32(b[0] - a[0]) * i32(p[1] - a[1])) - i32(i32(b[1] - a[1]) * i32(p[0] - a[0]))
    )


def dot_product(a, b, p):
    """5.7-1."""
    return i32(
        i32(i32(b[0] - a[0]) * i32(p[0] - a[0])) + i32(i32(b[1] - a[1]) * i32(p[1] - a[1]))
    )


def ratio_q15(part, shift, reciprocal, limit):
    """5.4-2."""
    return min(u32(u32((part >> shift) * reciprocal) + 0x8000) >> 16, limit)


def refine(part, whole, step_x, step_y, rest_x, rest_y):
    """5.4-7."""
    step = i32(i32(step_x * rest_x) + i32(step_y * rest_y)) >> 4
    return max(min(i32(part + step), whole), 0)


def coarse_q14(q18):
    """5.4-6."""
    return i32(q18 + 8) >> 4


def grid_cell(q14, grid_size):
    """5.5-1."""
    return min(i32((q14 + 16384) * grid_size) >> 15, grid_size - 1)


def limit_direction(direction):
    """5.1-2."""
    x_q18, y_q18, z_q15 = direction
    return (
        max(min(x_q18, ONE_Q18), -ONE_Q18),
        max(min(y_q18, ONE_Q18), -ONE_Q18),
        max(min(z_q15, ONE_Q15), 0),
    )


def binary32_to_q30(bits):
    """5.2-1."""
    exponent = (bits >> 23) & 0xFF
    mantissa = (bits & 0x7FFFFF) | 0x800000
    if exponent >= 127:
        magnitude = ONE_Q30
    elif exponent >= 96:
        magnitude = round_shift(i32(mantissa << 6), 126 - exponent)
    else:
        magnitude = 0
    return -magnitude if bits >> 31 else magnitude


def project_q18(n, d):
    """5.2-2."""
    magnitude = (divide(abs(n), d, 19) + 1) >> 1
    return -magnitude if n < 0 else magnitude


def direction_of_binary32(x_bits, y_bits, z_bits):
    """5.2-3."""
    x_q30, y_q30, z_q30 = binary32_to_q30(x_bits), binary32_to_q30(y_bits), binary32_to_q30(z_bits)
    d = u32(ONE_Q30 + abs(z_q30))
    return project_q18(x_q30, d), project_q18(y_q30, d), round_shift(max(z_q30, 0), 15)


def shift_of(whole):
    """5.4-4: 0 below 2^16, else what leaves 16 bits."""
    return 0 if whole < 1 << 16 else whole.bit_length() - 16


def reciprocal_of(whole):
    """5.4-4."""
    return ceil_div(1 << 31, whole >> shift_of(whole))


def sampled_cosine(x_q14, y_q14):
    """5.3-4."""
    s = x_q14 * x_q14 + y_q14 * y_q14
    return (2 * (1 << 15) * ((1 << 28) - s) + (1 << 28) + s) // (2 * ((1 << 28) + s))


def cell_range(cell, grid_size):
    """5.5: the range of a cell along an axis."""
    begin = ceil_div(cell << 15, grid_size) - 16384
    if cell == grid_size - 1:
        return begin, 16384
    return begin, ceil_div((cell + 1) << 15, grid_size) - 16384 - 1


def meets(corners, cell_x, cell_y, grid_size):
    """5.5: the closed triangle and the closed rectangle have a common point.

    Two convex figures are apart exactly if a side of one of them parts them.
    """
    x0, x1 = cell_range(cell_x, grid_size)
    y0, y1 = cell_range(cell_y, grid_size)
    xs, ys = [p[0] for p in corners], [p[1] for p in corners]
    if max(xs) < x0 or min(xs) > x1 or max(ys) < y0 or min(ys) > y1:
        return False
    for n in range(3):
        a, b = corners[n], corners[(n + 1) % 3]
        if all(cross(a, b, (x, y)) < 0 for x in (x0, x1) for y in (y0, y1)):
            return False
    return True


class Taps:
    """5.1."""

    def __init__(self, a, b, c, weight_a_q15, weight_b_q15, weight_c_q15, cosine_q15):
        self.rows = (a, b, c)
        self.weights = (weight_a_q15, weight_b_q15, weight_c_q15)
        self.cosine_q15 = cosine_q15


def taps_of_sample(index):
    """5.1-3."""
    return Taps(index, index, index, ONE_Q15, 0, 0, ONE_Q15)


class Directions:
    """5.3: the tables of a set."""

    def __init__(self, file, section):
        self.file, self.section = file, section
        at = section.offset
        self.count = file.u32(at)
        self.triangle_count = file.u32(at + 4)
        self.hull_count = file.u32(at + 8)
        self.grid_size = file.u32(at + 12)
        self.candidate_count = file.u32(at + 16)

    def place(self):
        """5.3: where the tables begin."""
        self.points_at = self.section.offset + 32
        self.triangles_at = self.points_at + 8 * self.count
        self.hull_at = self.triangles_at + 12 * self.triangle_count
        self.starts_at = self.hull_at + 8 * self.hull_count
        self.candidates_at = self.starts_at + 4 * (self.grid_size * self.grid_size + 1)
        self.end = self.candidates_at + 4 * self.candidate_count

    def read(self):
        file = self.file
        self.points = [
            (file.i16(self.points_at + 8 * n), file.i16(self.points_at + 8 * n + 2)) for n in range(self.count)
        ]
        self.cosines = [file.u32(self.points_at + 8 * n + 4) for n in range(self.count)]
        self.triangles = []
        for n in range(self.triangle_count):
            at = self.triangles_at + 12 * n
            self.triangles.append(
                (file.u16(at), file.u16(at + 2), file.u16(at + 4), file.u16(at + 6), file.u32(at + 8))
            )
        self.hull = []
        for n in range(self.hull_count):
            at = self.hull_at + 8 * n
            self.hull.append((file.u16(at), file.u16(at + 2), file.u32(at + 4)))
        cells = self.grid_size * self.grid_size
        self.starts = [file.u32(self.starts_at + 4 * n) for n in range(cells + 1)]
        self.candidates = [file.u32(self.candidates_at + 4 * n) for n in range(self.candidate_count)]

    def most_candidates(self):
        """4.2-3."""
        return max(self.starts[n + 1] - self.starts[n] for n in range(self.grid_size * self.grid_size))

    def edge_ends(self, n):
        """5.7: the first direction of edge n, and that of the next edge."""
        return self.hull[n][0], self.hull[(n + 1) % self.hull_count][0]

    # the checks of step 11

    def check(self, stated_count):
        file, section = self.file, self.section
        at = section.offset
        # 5.3-2, in the order of the words
        if self.count != stated_count:
            file.fail("5.3-2", at, self.count)
        if self.triangle_count > 2048:
            file.fail("5.3-2", at + 4, self.triangle_count)
        if self.triangle_count != 0:
            # which of the two fields is named: see guesses.md
            if self.triangle_count + 2 + self.hull_count != 2 * self.count or self.hull_count < 3:
                file.fail("5.3-2", at + 4, self.triangle_count)
            if self.hull_count > self.count:
                file.fail("5.3-2", at + 8, self.hull_count)
        elif self.hull_count != 2 * (self.count - 1):
            file.fail("5.3-2", at + 8, self.hull_count)
        if not 1 <= self.grid_size <= 64:
            file.fail("5.3-2", at + 12, self.grid_size)
        if self.candidate_count > 1048576:
            file.fail("5.3-2", at + 16, self.candidate_count)
        for reserved in (20, 24, 28):
            if file.u32(at + reserved) != 0:
                file.fail("5.3-2", at + reserved, file.u32(at + reserved))
        # 5.3-1
        self.place()
        if self.end != at + section.length:
            file.fail("5.3-1", at, section.length)
        self.read()
        self.check_points()
        self.check_triangles()
        self.check_grid()
        self.check_hull()
        self.check_cover()

    def check_points(self):
        """5.3-3, 5.3-4 for each direction."""
        file = self.file
        seen = set()
        for n, (x, y) in enumerate(self.points):
            at = self.points_at + 8 * n
            if x * x + y * y > 1 << 28 or (x, y) in seen:
                file.fail("5.3-3", at, file.u32(at))
            seen.add((x, y))
            if self.cosines[n] != sampled_cosine(x, y):
                file.fail("5.3-4", at + 4, self.cosines[n])

    def check_triangles(self):
        """5.4-3, 5.4-4, 5.4-5 for each triangle."""
        file, points = self.file, self.points
        before = None
        for n, (a, b, c, shift, reciprocal) in enumerate(self.triangles):
            at = self.triangles_at + 12 * n
            if not (a < b < self.count and a < c < self.count and b != c):
                file.fail("5.4-3", at, file.u32(at))
            whole = cross(points[a], points[b], points[c])
            if whole <= 0:
                file.fail("5.4-3", at, file.u32(at))
            if shift != shift_of(whole):
                file.fail("5.4-4", at + 6, shift)
            if reciprocal != reciprocal_of(whole):
                file.fail("5.4-4", at + 8, reciprocal)
            if before is not None and (a, b, c) <= before:
                file.fail("5.4-5", at, file.u32(at))
            before = (a, b, c)

    def check_grid(self):
        """5.5-2 and 5.5-5 for each cell; 5.5-3; 5.5-4."""
        file, size = self.file, self.grid_size
        starts, candidates = self.starts, self.candidates
        cells = size * size
        if starts[0] != 0:
            file.fail("5.5-2", self.starts_at, starts[0])
        for cell in range(cells):
            at = self.starts_at + 4 * (cell + 1)
            # a start above the count cannot be followed by an end that is the count
            if not starts[cell] <= starts[cell + 1] <= self.candidate_count:
                file.fail("5.5-2", at, starts[cell + 1])
            if cell == cells - 1 and starts[cells] != self.candidate_count:
                file.fail("5.5-2", at, starts[cells])
            if starts[cell + 1] - starts[cell] > 256:
                file.fail("5.5-5", at, starts[cell + 1] - starts[cell])
        for cell in range(cells):
            before = -1
            for n in range(starts[cell], starts[cell + 1]):
                triangle = candidates[n]
                good = before < triangle < self.triangle_count
                if not good or not meets(self.corners(triangle), cell % size, cell // size, size):
                    file.fail("5.5-3", self.candidates_at + 4 * n, triangle)
                before = triangle
        listed = [set(candidates[starts[cell] : starts[cell + 1]]) for cell in range(cells)]
        for triangle in range(self.triangle_count):
            corners = self.corners(triangle)
            xs, ys = [p[0] for p in corners], [p[1] for p in corners]
            # only cells that the box of the triangle meets can meet the triangle
            for cell_y in range(grid_cell(min(ys), size), grid_cell(max(ys), size) + 1):
                for cell_x in range(grid_cell(min(xs), size), grid_cell(max(xs), size) + 1):
                    if triangle not in listed[cell_y * size + cell_x] and meets(corners, cell_x, cell_y, size):
                        file.fail("5.5-4", self.section.offset + 16, self.candidate_count)

    def corners(self, triangle):
        return [self.points[corner] for corner in self.triangles[triangle][0:3]]

    def check_hull(self):
        """5.7-6 for all edges; 5.7-7."""
        file, points, count = self.file, self.points, self.hull_count
        for n in range(count):
            at = self.hull_at + 8 * n
            a, b = self.edge_ends(n)
            _, shift, reciprocal = self.hull[n]
            if a >= self.count or b >= self.count or a == b:
                file.fail("5.7-6", at, file.u32(at))
            whole = dot_product(points[a], points[b], points[b])
            if shift != shift_of(whole) or reciprocal != reciprocal_of(whole):
                file.fail("5.7-6", at, file.u32(at))
        steps = []
        for n in range(count):
            a, b = self.edge_ends(n)
            steps.append((points[b][0] - points[a][0], points[b][1] - points[a][1]))
        quarters = 0
        for n in range(count):
            after = (n + 1) % count
            (x0, y0), (x1, y1) = steps[n], steps[after]
            left, ahead = x0 * y1 - y0 * x1, x0 * x1 + y0 * y1
            if self.triangle_count != 0:
                good = left > 0 or (left == 0 and ahead > 0)
            else:
                turns_back = after in (0, count // 2)
                good = left == 0 and (ahead < 0 if turns_back else ahead > 0)
            if not good:
                file.fail("5.7-7", self.hull_at + 8 * n, n)
            quarters += (quadrant(x1, y1) - quadrant(x0, y0)) % 4
        if self.triangle_count != 0 and quarters != 4:
            file.fail("5.7-7", self.hull_at, quarters)

    def check_cover(self):
        """5.7-8."""
        file = self.file
        if self.triangle_count == 0:
            named = {edge[0] for edge in self.hull}
            # A set of one direction has no hull edge and nothing to leave out.
            if self.count > 1 and len(named) != self.count:
                file.fail("5.7-8", self.hull_at, 0)
            return
        edges = [self.edge_ends(n) for n in range(self.hull_count)]
        sides_of = [((a, b), (b, c), (c, a)) for a, b, c, _, _ in self.triangles]
        times = {}
        for sides in sides_of:
            for side in sides:
                times[side] = times.get(side, 0) + 1
        for n, sides in enumerate(sides_of):
            if any(times[side] > 1 or times.get((side[1], side[0]), 0) > 1 for side in sides):
                file.fail("5.7-8", self.triangles_at + 12 * n, n)
        alone = {side for side in times if (side[1], side[0]) not in times}
        for n, edge in enumerate(edges):
            if edge not in alone:
                file.fail("5.7-8", self.hull_at + 8 * n, edge[0])
        # Every hull edge is a side without a neighbour; if they are as many, it is all of them.
        if len(alone) != self.hull_count:
            file.fail("5.7-8", self.hull_at, len(alone))

    # location

    def locate(self, direction):
        """5.6: the taps of a query's direction."""
        x_q18, y_q18, z_q15 = limit_direction(direction)
        p = (coarse_q14(x_q18), coarse_q14(y_q18))
        rest_x = i32(x_q18 - 16 * p[0])
        rest_y = i32(y_q18 - 16 * p[1])
        cell = grid_cell(p[1], self.grid_size) * self.grid_size + grid_cell(p[0], self.grid_size)
        for n in range(self.starts[cell], self.starts[cell + 1]):
            ia, ib, ic, shift, reciprocal = self.triangles[self.candidates[n]]
            a, b, c = self.points[ia], self.points[ib], self.points[ic]
            area_a, area_b, area_c = cross(b, c, p), cross(c, a, p), cross(a, b, p)
            # 5.6-1
            if area_a < 0 or area_b < 0 or area_c < 0:
                continue
            # 5.6-2
            whole = i32(area_a + area_b + area_c)
            fine_a = refine(area_a, whole, b[1] - c[1], c[0] - b[0], rest_x, rest_y)
            fine_b = refine(area_b, whole, c[1] - a[1], a[0] - c[0], rest_x, rest_y)
            weight_a = ratio_q15(fine_a, shift, reciprocal, ONE_Q15)
            weight_b = ratio_q15(fine_b, shift, reciprocal, ONE_Q15 - weight_a)
            weight_c = ONE_Q15 - weight_a - weight_b
            # 5.6-3
            return Taps(ia, ib, ic, weight_a, weight_b, weight_c, ONE_Q15 if z_q15 > 0 else 0)
        # 5.6-4
        return self.locate_on_hull(p, rest_x, rest_y, z_q15)

    def locate_on_hull(self, p, rest_x, rest_y, z_q15):
        """5.7-2 to 5.7-5."""
        ia, ib, weight_b = self.nearest_on_hull(p, rest_x, rest_y)
        weight_a = ONE_Q15 - weight_b
        sampled = (
            i32(i32(self.cosines[ia] * weight_a) + i32(self.cosines[ib] * weight_b) + HALF_Q15) >> 15
        )
        if z_q15 < sampled:
            cosine = divide(z_q15, sampled, 15)
        elif z_q15 == 0:
            cosine = 0
        else:
            cosine = ONE_Q15
        return Taps(ia, ib, ia, weight_a, weight_b, 0, cosine)

    def nearest_on_hull(self, p, rest_x, rest_y):
        """5.7-2, 5.7-3, 5.7-4."""
        if self.hull_count == 0:
            return 0, 0, 0
        points = self.points
        for n in range(self.hull_count):
            ia, ib = self.edge_ends(n)
            a, b = points[ia], points[ib]
            along, back = dot_product(a, b, p), dot_product(b, a, p)
            if along >= 0 and back >= 0 and cross(b, a, p) >= 0:
                _, shift, reciprocal = self.hull[n]
                fine = refine(along, i32(along + back), b[0] - a[0], b[1] - a[1], rest_x, rest_y)
                return ia, ib, ratio_q15(fine, shift, reciprocal, ONE_Q15)
        found = self.hull[0][0]
        for n in range(self.hull_count):
            ia, ib = self.edge_ends(n)
            io = self.hull[n - 1][0]  # of edge 0 this is the last one
            if dot_product(points[ia], points[ib], p) < 0 and dot_product(points[ia], points[io], p) < 0:
                found = ia
        return found, found, 0


def quadrant(x, y):
    """5.7-7: the quarter of the plane that a step points into."""
    if x > 0 and y >= 0:
        return 0
    if x <= 0 and y > 0:
        return 1
    if x < 0 and y <= 0:
        return 2
    return 3


def check_directions(file):
    """1.4, step 11."""
    sets = []
    for instance, count in ((0, file.light_count), (1, file.view_count)):
        section = file.section(DIRECTIONS, instance)
        if section is None:
            sets.append(sets[0])  # 5.3-5
            continue
        if section.length < 32:
            file.fail("5.3-1", section.offset, section.length)
        directions = Directions(file, section)
        directions.check(count)
        sets.append(directions)
    file.light_set, file.view_set = sets


# ---------------------------------------------------------------- chapter 6


def fraction_of_binary32(bits):
    """6.1-2."""
    exponent = (bits >> 23) & 0xFF
    mantissa = (bits & 0x7FFFFF) | 0x800000
    if 118 <= exponent <= 149:
        magnitude = modulo32(mantissa << (exponent - 118))
    elif 95 <= exponent <= 117:
        magnitude = mantissa >> (118 - exponent)
    else:
        magnitude = 0
    return modulo32(-magnitude) if bits >> 31 else magnitude


def texel_under(position_q32, size):
    """6.1-3."""
    return product_high(position_q32, size)


def block_of(texel, edge):
    """6.2-1."""
    edge_reciprocal_q18 = ceil_div(1 << 18, edge)
    return u32(texel * edge_reciprocal_q18) >> 18


def blocks_along(size, edge):
    """6.2-3."""
    return block_of(size - 1, edge) + 1


class Span:
    """6.3: one block along an axis, two of its rows and their weights."""

    def __init__(self, block, row_a, row_b, weight_a, weight_b):
        self.block = block
        self.rows = (row_a, row_b)
        self.weights = (weight_a, weight_b)


def axis_of_texel(texel, edge):
    """6.2-2."""
    block = block_of(texel, edge)
    row = texel - block * edge
    return [Span(block, row, row, ONE_Q15, 0)]


def axis_of_position(position_q32, size, edge):
    """6.3-1, 6.3-2, 6.3-3."""
    low = modulo32(position_q32 * size)
    high = product_high(position_q32, size)
    if low >= 0x80000000:
        texel_a = high
    elif high != 0:
        texel_a = high - 1
    else:
        texel_a = size - 1
    texel_b = texel_a + 1
    if texel_b == size:
        texel_b = 0
    weight_b = modulo32(low - 0x80000000) >> 17
    weight_a = ONE_Q15 - weight_b
    block_a, block_b = block_of(texel_a, edge), block_of(texel_b, edge)
    row_a, row_b = texel_a - block_a * edge, texel_b - block_b * edge
    if block_a == block_b:
        return [Span(block_a, row_a, row_b, weight_a, weight_b)]
    return [Span(block_a, row_a, row_a, weight_a, 0), Span(block_b, row_b, row_b, weight_b, 0)]


# ---------------------------------------------------------------- chapter 7


def colour(file, values, cosine_q15):
    """7.1-1, 7.4-2: the three words of a result."""
    if file.cosine_included == 0:
        cosine_q15 = ONE_Q15
    result = []
    for row in range(3):
        x_q20 = matrix_row(values, file.matrix_q13[3 * row : 3 * row + 3])
        if file.transfer == 0:
            result.append(log2_transfer(x_q20, file.parameter, cosine_q15))
        else:
            result.append(linear_transfer(x_q20, as_i32(file.parameter), cosine_q15))
    return result


def matrix_row(values, entries):
    """7.1-2."""
    total = 0
    for value, entry in zip(values, entries):
        total = i32(total + multiply_q13(value, entry))
    return total


def log2_transfer(x_q20, bits, cosine_q15):
    """7.2-1, 7.2-2, 7.2-3."""
    exponent = x_q20 >> 20
    mantissa = exp2_q31(x_q20 & 0xFFFFF)
    if bits == 0:
        return present(mantissa, exponent, cosine_q15)
    offset_exponent = (bits >> 23) - 127
    offset_mantissa = u32(((bits & 0x7FFFFF) | 0x800000) << 8)
    distance = i32(exponent - offset_exponent)
    if distance < 0:
        return 0
    offset = offset_mantissa >> distance if distance < 32 else 0
    if mantissa <= offset:
        return 0
    return present(mantissa - offset, exponent, cosine_q15)


def linear_transfer(x_q20, exponent, cosine_q15):
    """7.3-1, 7.3-2."""
    if x_q20 <= 0:
        return 0
    return present(x_q20, i32(exponent + 11), cosine_q15)


def present(mantissa, exponent, cosine_q15):
    """7.4-1."""
    if cosine_q15 >= ONE_Q15 or mantissa == 0:
        return assemble_binary32(mantissa, exponent)
    shift = leading_zeros(mantissa)
    scaled = product_high(u32(mantissa << shift), u32(cosine_q15 << 17))
    return assemble_binary32(scaled, i32(exponent - shift))


# ---------------------------------------------------------------- chapter 8


def check_pairs(file, kind, channel):
    """1.4, step 12: 8.1-5, 8.1-6, 8.1-7 for one table."""
    section = file.section(kind, channel)
    at = section.offset
    lights, views = file.light_count, file.view_count
    if section.length != 16 + 4 * views * ceil_div(lights, 2):
        file.fail("8.1-5", at, section.length)
    most_base, most_shift = (67108864, 11) if kind == MEANS else (0, 8)
    if abs(as_i32(file.u32(at))) > most_base:
        file.fail("8.1-6", at, file.u32(at))
    if file.u32(at + 4) > most_shift:
        file.fail("8.1-6", at + 4, file.u32(at + 4))
    for reserved in (8, 12):
        if file.u32(at + reserved) != 0:
            file.fail("8.1-6", at + reserved, file.u32(at + reserved))
    check_rows(file, "8.1-7", at + 16, views, lights)


def check_rows(file, rule, at, rows, columns):
    """8.1-7, 10.1-4: entries of rows that are padded to a word."""
    halves = align(columns, 2)
    for row in range(rows):
        for column in range(halves):
            entry = at + 2 * (row * halves + column)
            value = file.u16(entry)
            if value == 0x8000 if column < columns else value != 0:
                file.fail(rule, entry, value)


class Pairs:
    """8.1: a table of means or scales."""

    def __init__(self, file, section):
        self.file = file
        self.base = as_i32(file.u32(section.offset))
        self.shift = file.u32(section.offset + 4)
        self.table = section.offset // 4 + 4
        self.row_words = ceil_div(file.light_count, 2)

    def blend(self, light, view):
        """8.1-1, 8.1-2."""
        blended = 0
        for row, weight in zip(view.rows, view.weights):
            row_sum = 0
            for entry, light_weight in zip(light.rows, light.weights):
                value = self.file.packed_i16(self.table + row * self.row_words, entry)
                row_sum = i32(row_sum + i32(value * light_weight))
            blended = i32(blended + multiply_q15(row_sum, weight))
        return blended

    def mean_q20(self, light, view):
        """8.1-3."""
        return i32(round_shift(self.blend(light, view), 15 - self.shift) + self.base)

    def scale_texture(self, texture, light, view):
        """8.2-1, 8.2-2."""
        scale = round_shift(self.blend(light, view), 15)
        scaled = clamp_magnitude(multiply_q15(texture, scale), VALUE_BOUND >> self.shift)
        return i32(scaled << self.shift)


# ---------------------------------------------------------------- chapter 9


def level_size(size, level):
    """9.1-1."""
    return (size + (1 << level) - 1) >> level


# --------------------------------------------------------------- chapter 10


def factor_rows(file, kind):
    """10.1, 10.2: rows of both tables and the most columns."""
    if kind == ANGULAR:
        return (file.light_count, file.view_count), 1024
    return (file.edge, file.edge), file.edge


def check_factors(file, kind, channel):
    """1.4, step 13.1: 10.1-1 to 10.1-4 for one section."""
    section = file.section(kind, channel)
    at = section.offset
    rows, most = factor_rows(file, kind)
    if section.length < 8:
        file.fail("10.1-1", at, section.length)
    count = file.u32(at)
    if not 1 <= count <= 256 or 8 + 16 * count > section.length:
        file.fail("10.1-2", at, count)
    if file.u32(at + 4) != 0:
        file.fail("10.1-2", at + 4, file.u32(at + 4))
    next_word = 2 + 4 * count
    tables = []
    for k in range(count):
        entry = at + 8 + 16 * k
        columns = (file.u32(entry), file.u32(entry + 4))
        for which in (0, 1):
            if not 1 <= columns[which] <= most:
                file.fail("10.1-2", entry + 4 * which, columns[which])
        for which in (0, 1):
            if file.u32(entry + 8 + 4 * which) != next_word:
                file.fail("10.1-3", entry + 8 + 4 * which, file.u32(entry + 8 + 4 * which))
            tables.append((at + 4 * next_word, rows[which], columns[which]))
            next_word += rows[which] * ceil_div(columns[which], 2)
    if 4 * next_word != section.length:
        file.fail("10.1-1", at, section.length)
    for table, table_rows, columns in tables:
        check_rows(file, "10.1-4", table, table_rows, columns)


def dictionaries_of(file, kind, channel):
    return file.u32(file.section(kind, channel).offset)


def check_dictionary_counts(file, other, channel):
    """10.2-1. `other` is the file that has the angular factors."""
    owner = file if file.section(SPATIAL, channel) is not None else other
    spatial = dictionaries_of(owner, SPATIAL, channel)
    if spatial != dictionaries_of(other, ANGULAR, channel):
        section = file.section(SPATIAL, channel) or file.section(ATOMS, channel)
        file.fail("10.2-1", section.offset, spatial)


class Factors:
    """10.1, 10.2: a section of factors."""

    def __init__(self, file, kind, channel):
        self.file, self.begin = file, file.section(kind, channel).offset // 4

    def columns(self, k, which):
        return self.file.word(self.begin + 2 + 4 * k + which)

    def entry(self, k, which, row, column):
        """10.1-3, 10.2-2: `which` is 0 for light or x and 1 for view or y."""
        table = self.begin + self.file.word(self.begin + 4 + 4 * k + which)
        row_words = ceil_div(self.columns(k, which), 2)
        return self.file.packed_i16(table + row * row_words, column)

    def blend(self, k, which, column, taps):
        """10.6-1 for taps, 10.6-2 for a span."""
        total = 0
        for row, weight in zip(taps.rows, taps.weights):
            total = i32(total + i32(self.entry(k, which, row, column) * weight))
        return i32(total + HALF_Q15) >> 15


class Atom:
    """10.5."""

    def __init__(self, bits, quantiser):
        self.shift = bits & 15
        self.view = (bits >> 4) & 0x3FF
        self.light = (bits >> 14) & 0x3FF
        self.x = (bits >> 24) & 15
        self.y = bits >> 28
        self.base = as_i16(quantiser & 0xFFFF)
        self.step = quantiser >> 16

    def coefficient(self, value, value_bits):
        """10.5-1."""
        half = 1 << (value_bits - 1)
        return i32(self.base + (u32(u32(value * self.step) + half) >> value_bits))


def check_atoms(file, channel, angular, spatial):
    """1.4, step 13.2: 10.5-3 to 10.5-7. Gives the atoms of each dictionary."""
    section = file.section(ATOMS, channel)
    at = section.offset
    count = angular.file.word(angular.begin)
    if section.length < 8 + 8 * count:
        file.fail("10.5-3", at, section.length)
    if file.u32(at) != count:
        file.fail("10.5-4", at, file.u32(at))
    if file.u32(at + 4) != 0:
        file.fail("10.5-4", at + 4, file.u32(at + 4))
    next_word = 2 + 2 * count
    lists = []
    for k in range(count):
        entry = at + 8 + 8 * k
        atoms, start = file.u32(entry), file.u32(entry + 4)
        if atoms > 65536 or start != next_word:
            file.fail("10.5-4", entry, atoms)
        lists.append((start, atoms))
        next_word += 2 * atoms
    if 4 * next_word != section.length:
        file.fail("10.5-3", at, section.length)
    result = []
    for k, (start, atoms) in enumerate(lists):
        before = -1
        parsed = []
        for n in range(atoms):
            place = at + 4 * start + 8 * n
            bits, quantiser = file.u32(place), file.u32(place + 4)
            atom = Atom(bits, quantiser)
            if (
                atom.view >= angular.columns(k, 1)
                or atom.light >= angular.columns(k, 0)
                or atom.x >= spatial.columns(k, 0)
                or atom.y >= spatial.columns(k, 1)
            ):
                file.fail("10.5-5", place, bits)
            if bits >> 4 <= before:
                file.fail("10.5-6", place, bits)
            before = bits >> 4
            if atom.base == -32768 or atom.base + atom.step > 32767:
                file.fail("10.5-7", place + 4, quantiser)
            parsed.append(atom)
        result.append(parsed)
    return result


class Record:
    """10.4: dictionary, shift and the coefficients with their atoms."""

    def __init__(self, dictionary, shift, coefficients):
        self.dictionary, self.shift, self.coefficients = dictionary, shift, coefficients


class Coefficients:
    """10.3: the section of one level, layer and channel."""

    def __init__(self, file, section):
        self.file, self.section = file, section
        at = section.offset
        self.value_bits = file.u8(at)
        self.dictionary_bits = file.u8(at + 1)
        self.count_bits = file.u16(at + 2)
        self.blocks = file.u32(at + 4)
        self.bits = file.u32(at + 8)
        self.largest = file.u32(at + 12)
        self.stream = at // 4 + 4 + self.blocks  # word
        self.end = (at + section.length) // 4
        self.records = []

    def first_bit(self, block):
        return self.file.word(self.section.offset // 4 + 4 + block)

    def field(self, bit, n):
        """10.4-1, 1.2-5."""
        return self.file.bit_window(self.stream, bit, self.end) & ((1 << n) - 1)

    def next_one(self, bit):
        """10.4-4: the first one from `bit` on, or None if the stream ends."""
        while bit < self.bits:
            window = self.file.bit_window(self.stream, bit, self.end)
            if window == 0:
                bit += 32
                continue
            bit += (window & -window).bit_length() - 1
            return bit if bit < self.bits else None
        return None

    def check(self, level, atoms):
        """1.4, step 13.3, from 10.3-3 on."""
        file, section = self.file, self.section
        at = section.offset
        if not 1 <= self.value_bits <= 16 or self.dictionary_bits > 8 or not 1 <= self.count_bits <= 15:
            file.fail("10.3-3", at, file.u32(at))
        blocks_x = blocks_along(level_size(file.width, level), file.edge)
        blocks_y = blocks_along(level_size(file.height, level), file.edge)
        if self.blocks != blocks_x * blocks_y:
            file.fail("10.3-3", at + 4, self.blocks)
        if section.length != 16 + 4 * self.blocks + 4 * ceil_div(self.bits, 32):
            file.fail("10.3-2", at, section.length)
        next_bit = 0
        most = 0
        for block in range(self.blocks):
            next_bit, count = self.check_record(block, next_bit, atoms)
            most = max(most, count)
        if next_bit != self.bits:
            file.fail("10.4-6", at + 8, self.bits)
        if self.bits % 32 != 0:
            unused = file.word(self.end - 1) >> (self.bits % 32)
            if unused != 0:
                file.fail("10.4-9", 4 * (self.end - 1), unused)
        if self.largest != most:
            file.fail("10.3-4", at + 12, self.largest)

    def check_record(self, block, next_bit, atoms):
        """1.4, step 13.3, one record: 10.4-6, 10.4-7, 10.4-8, 10.4-11, 10.7-7."""
        file = self.file
        first = self.first_bit(block)
        if first != next_bit:
            file.fail("10.4-6", self.section.offset + 16 + 4 * block, first)
        place = 4 * (self.stream + (first >> 5))
        fields_bit = first + self.count_bits + self.dictionary_bits + 9
        if fields_bit > self.bits:
            file.fail("10.4-6", place, first)
        # 10.4-2
        bit = first
        count = self.field(bit, self.count_bits)
        bit += self.count_bits
        dictionary = self.field(bit, self.dictionary_bits)
        bit += self.dictionary_bits
        shift = self.field(bit, 5)
        low_bits = self.field(bit + 5, 4)
        # every coefficient has its fields and at least its one
        if fields_bit + count * (low_bits + self.value_bits + 1) > self.bits:
            file.fail("10.4-6", place, first)
        if count == 0:
            bad = dictionary != 0 or shift != 0 or low_bits != 0
        else:
            bad = dictionary >= len(atoms) or low_bits > 12
        if bad:
            file.fail("10.4-7", place, file.bit_window(self.stream, first, self.end))
        # 10.4-4, 10.4-5
        bit = fields_bit + count * (low_bits + self.value_bits)
        high = 0
        positions, coefficients = [], []
        for index in range(count):
            one = self.next_one(bit)
            if one is None:
                file.fail("10.4-6", place, first)
            high += one - bit
            bit = one + 1
            at = fields_bit + index * (low_bits + self.value_bits)
            low = self.field(at, low_bits)
            value = self.field(at + low_bits, self.value_bits)
            position = (high << low_bits) | low
            if position >= len(atoms[dictionary]):
                file.fail("10.4-8", place, modulo32(position))
            positions.append(position)
            atom = atoms[dictionary][position]
            coefficients.append((atom, atom.coefficient(value, self.value_bits)))
        for index in range(1, count):
            if positions[index] <= positions[index - 1]:
                file.fail("10.4-8", place, first)
        if high > 32 * count + 32:
            file.fail("10.4-11", place, high)
        magnitude = sum(ceil_div(abs(coefficient), 1 << atom.shift) for atom, coefficient in coefficients)
        if magnitude > 65535:
            file.fail("10.7-7", place, magnitude)
        self.records.append(Record(dictionary, shift, coefficients))
        return bit, count


def check_ensemble(file, dictionary):
    """1.4, step 13."""
    # 13.1
    for channel in range(3):
        if file.section(ANGULAR, channel) is not None:
            check_factors(file, ANGULAR, channel)
    for channel in file.full:
        if file.section(SPATIAL, channel) is not None:
            check_factors(file, SPATIAL, channel)
    # 13.2; 3.5-7, 3.5-8
    file.angular, file.spatial, file.atoms = {}, {}, {}
    for channel in file.full:
        angular_file = file if dictionary is None else dictionary
        spatial_file = file if file.section(SPATIAL, channel) is not None else dictionary
        check_dictionary_counts(file, angular_file, channel)
        file.angular[channel] = Factors(angular_file, ANGULAR, channel)
        file.spatial[channel] = Factors(spatial_file, SPATIAL, channel)
        file.atoms[channel] = check_atoms(file, channel, file.angular[channel], file.spatial[channel])
    # 13.3; 10.3-1
    file.coefficients = {}
    largest = {}
    for level in range(file.level_count):
        for layer in range(file.layer_count):
            for channel in file.full:
                section = file.section(COEFFICIENTS, level * 256 + layer * 16 + channel)
                if section.length < 16:
                    file.fail("10.3-2", section.offset, section.length)
                coefficients = Coefficients(file, section)
                coefficients.check(level, file.atoms[channel])
                file.coefficients[level, layer, channel] = coefficients
                largest[level, layer, channel] = coefficients.largest
    # 13.4
    if file.operations != stated_cost(file, textures_of_ensemble(file, largest)):
        file.fail("4.2-1", 28, file.operations)


# --------------------------------------------------------------- chapter 12


def bits_that_hold(value):
    """12.2-2, 12.3, 12.4-2: the bits from the lowest up to the highest one, 0 for 0."""
    return value.bit_length()


def light_atom_entry(word):
    """12.1-4: an entry's three channels, each two's complement of ten bits."""
    channels = []
    for channel in range(3):
        bits = (word >> (10 * channel)) & 0x3FF
        channels.append(bits - 1024 if bits >= 512 else bits)
    return tuple(channels)


def fibre_entry(half, light_index_bits):
    """12.2, 12.2-6: which light atom an entry names, and its value in Q15."""
    index = half & ((1 << light_index_bits) - 1)
    return index, as_i16(half - index)


class Tensor:
    """12.1, 12.2: the light atoms and the fibres of a file."""

    def __init__(self):
        self.light_atoms = []  # by light, then by index: three channels
        self.shifts = []  # by ABRDF atom: angular_shift, gain_shift
        self.fibres = []  # by view, then by ABRDF atom: a list of (index, value)

    def blended_light_atom(self, index, light):
        """12.5-1, of the three channels."""
        result = []
        for channel in range(3):
            total = 0
            for row, weight in zip(light.rows, light.weights):
                total = i32(total + i32(self.light_atoms[row][index][channel] * weight))
            result.append(i32(total + (1 << 9)) >> 10)
        return result


def check_tensor_tables(file):
    """1.4, step 13.1 of the method 2: 12.1-1 to 12.1-3, 12.2-1 to 12.2-5."""
    file.tensor = Tensor()
    check_light_atoms(file, file.tensor)
    check_fibres(file, file.tensor)


def check_light_atoms(file, tensor):
    """12.1-1, 12.1-2, 12.1-3."""
    section = file.section(LIGHT_ATOMS)
    at = section.offset
    if section.length < 8:
        file.fail("12.1-1", at, section.length)
    count = file.u32(at)
    if not 1 <= count <= 256:
        file.fail("12.1-2", at, count)
    if file.u32(at + 4) != 0:
        file.fail("12.1-2", at + 4, file.u32(at + 4))
    if section.length != 8 + 4 * file.light_count * count:
        file.fail("12.1-1", at, section.length)
    used = 0  # the bits that may be set
    for channel in file.full:
        used |= 0x3FF << (10 * channel)
    for light in range(file.light_count):
        row = []
        for index in range(count):
            place = at + 8 + 4 * (light * count + index)
            word = file.u32(place)
            if word & ~used != 0:
                file.fail("12.1-3", place, word)
            row.append(light_atom_entry(word))
        tensor.light_atoms.append(row)
    tensor.light_atom_count = count


def check_fibres(file, tensor):
    """12.2-1 to 12.2-5."""
    section = file.section(FIBRES)
    at = section.offset
    if section.length < 8:
        file.fail("12.2-1", at, section.length)
    atoms = file.u32(at)
    if not 1 <= atoms <= 1024:
        file.fail("12.2-2", at, atoms)
    entries, light_index_bits = file.u8(at + 4), file.u8(at + 5)
    good = 1 <= entries <= 32 and light_index_bits == bits_that_hold(tensor.light_atom_count - 1)
    if not good or file.u16(at + 6) != 0:
        file.fail("12.2-2", at + 4, file.u32(at + 4))
    halves = file.view_count * atoms * entries
    if section.length != 8 + 4 * atoms + 4 * ceil_div(halves, 2):
        file.fail("12.2-1", at, section.length)
    for atom in range(atoms):
        place = at + 8 + 4 * atom
        word = file.u32(place)
        if word >> 10 != 0:
            file.fail("12.2-3", place, word)
        tensor.shifts.append((word & 31, (word >> 5) & 31))
    first = at + 8 + 4 * atoms
    for view in range(file.view_count):
        row = []
        for atom in range(atoms):
            begin = first + 2 * (view * atoms + atom) * entries
            fibre = []
            for n in range(entries):
                half = file.u16(begin + 2 * n)
                index, value = fibre_entry(half, light_index_bits)
                if index >= tensor.light_atom_count:
                    file.fail("12.2-4", begin + 2 * n, half)
                fibre.append((index, value))
            magnitude = sum(abs(value) for _, value in fibre)
            if magnitude > 1 << 18:
                file.fail("12.2-5", begin, magnitude)
            row.append(fibre)
        tensor.fibres.append(row)
    if halves % 2 != 0 and file.u16(first + 2 * halves) != 0:
        file.fail("12.2-4", first + 2 * halves, file.u16(first + 2 * halves))
    tensor.atom_count, tensor.entries = atoms, entries


def list_low_bits(count, index_bits):
    """12.4-2."""
    return index_bits - min(index_bits, bits_that_hold(count))


def list_coefficient(value, value_bits):
    """12.4-5."""
    return ((2 * value + 1) << (15 - value_bits)) - (1 << 15)


class Lists:
    """12.3: the section of one level and layer."""

    def __init__(self, file, section, tensor):
        self.file, self.section, self.tensor = file, section, tensor
        at = section.offset
        self.value_bits = file.u8(at)
        self.count_bits = file.u8(at + 1)
        self.index_bits = file.u8(at + 2)
        self.shift = file.u8(at + 3)
        self.texels = file.u32(at + 4)
        self.bits = file.u32(at + 8)
        self.largest = file.u32(at + 12)
        self.groups = ceil_div(self.texels, 8)
        self.stream = at // 4 + 4 + self.groups  # word
        self.end = (at + section.length) // 4
        self.lists = []  # by texel: a list of (index, coefficient)

    def field(self, bit, n):
        """10.4-1, 1.2-5."""
        return self.file.bit_window(self.stream, bit, self.end) & ((1 << n) - 1)

    def place(self, bit):
        """1.4-4: the word of the stream that holds a bit."""
        return 4 * (self.stream + (bit >> 5))

    def check(self, level):
        """1.4, step 13.2 of the method 2, from 12.3-3 on."""
        file, section = self.file, self.section
        at = section.offset
        if (
            not 1 <= self.value_bits <= 15
            or not 1 <= self.count_bits <= 6
            or self.index_bits != bits_that_hold(self.tensor.atom_count - 1)
            or self.shift > 31
        ):
            file.fail("12.3-3", at, file.u32(at))
        if self.texels != level_size(file.width, level) * level_size(file.height, level):
            file.fail("12.3-3", at + 4, self.texels)
        if section.length != 16 + 4 * self.groups + 4 * ceil_div(self.bits, 32):
            file.fail("12.3-2", at, section.length)
        next_bit = 0
        for group in range(self.groups):
            next_bit = self.check_group(group, next_bit)
        if next_bit != self.bits:
            file.fail("12.4-6", at + 8, self.bits)
        if self.bits % 32 != 0:
            unused = file.word(self.end - 1) >> (self.bits % 32)
            if unused != 0:
                file.fail("12.4-9", 4 * (self.end - 1), unused)
        if self.largest != max(len(pairs) for pairs in self.lists):
            file.fail("12.3-4", at + 12, self.largest)

    def check_group(self, group, next_bit):
        """12.4-1, 12.4-3; one group of step 13.2: 12.4-6, 12.4-7 and its lists."""
        file = self.file
        where = self.section.offset + 16 + 4 * group
        first = file.u32(where)
        if first != next_bit:
            file.fail("12.4-6", where, first)
        bit = first + 8 * self.count_bits
        if bit > self.bits:
            file.fail("12.4-6", self.place(first), first)
        for n in range(8):
            count = self.field(first + n * self.count_bits, self.count_bits)
            if 8 * group + n >= self.texels:
                if count != 0:
                    file.fail("12.4-7", self.place(first), count)
                continue
            bit = self.check_list(bit, count)
        return bit

    def check_list(self, first, count):
        """12.4-2, 12.4-4, 12.4-5; one list of step 13.2: 12.4-6, 12.4-8, 12.5-8."""
        file, tensor = self.file, self.tensor
        if count == 0:
            self.lists.append([])
            return first
        low_bits = list_low_bits(count, self.index_bits)
        high_bit = first + count * (low_bits + self.value_bits)
        after = high_bit + count + ((tensor.atom_count - 1) >> low_bits)
        if after > self.bits:
            file.fail("12.4-6", self.place(first), first)
        highs = []
        zeros = 0
        for bit in range(high_bit, after):
            if self.field(bit, 1) == 1:
                highs.append(zeros)
            else:
                zeros += 1
        if len(highs) != count:
            file.fail("12.4-8", self.place(first), first)
        pairs = []
        before = -1
        for n in range(count):
            at = first + n * (low_bits + self.value_bits)
            index = (highs[n] << low_bits) | self.field(at, low_bits)
            if not before < index < tensor.atom_count:
                file.fail("12.4-8", self.place(first), first)
            before = index
            value = self.field(at + low_bits, self.value_bits)
            pairs.append((index, list_coefficient(value, self.value_bits)))
        magnitude = sum(ceil_div(abs(c), 1 << tensor.shifts[index][1]) for index, c in pairs)
        if magnitude > 65534:
            file.fail("12.5-8", self.place(first), magnitude)
        self.lists.append(pairs)
        return after


def check_tensor(file, dictionary):
    """1.4, step 13 with the method 2."""
    textures = 0
    if file.full:
        # 13.1; 3.5-7
        if dictionary is None:
            check_tensor_tables(file)
        else:
            file.tensor = dictionary.tensor
        # 13.2; 12.3-1
        file.lists = {}
        largest = {}
        for level in range(file.level_count):
            for layer in range(file.layer_count):
                section = file.section(LISTS, level * 256 + layer * 16)
                if section.length < 16:
                    file.fail("12.3-2", section.offset, section.length)
                lists = Lists(file, section, file.tensor)
                lists.check(level)
                file.lists[level, layer] = lists
                largest[level, layer] = lists.largest
        textures = textures_of_tensor(file, file.tensor, largest)
    # 13.3
    if file.operations != stated_cost(file, textures):
        file.fail("4.2-1", 28, file.operations)


class AngularAtoms:
    """12.5-1 to 12.5-3 for the taps of one sample; what was computed is kept."""

    def __init__(self, tensor, light, view):
        self.tensor, self.light, self.view = tensor, light, view
        self.light_atoms, self.atoms = {}, {}

    def light_atom(self, index):
        """12.5-1."""
        if index not in self.light_atoms:
            self.light_atoms[index] = self.tensor.blended_light_atom(index, self.light)
        return self.light_atoms[index]

    def angular(self, atom):
        """12.5-2, 12.5-3."""
        if atom not in self.atoms:
            sums = [0, 0, 0]
            for row, weight in zip(self.view.rows, self.view.weights):
                for index, value in self.tensor.fibres[row][atom]:
                    h = i32(i32(value * weight) + (1 << 16)) >> 17
                    if h == 0:
                        continue
                    u = self.light_atom(index)
                    for channel in range(3):
                        sums[channel] = i32(sums[channel] + i32(h * u[channel]))
            angular_shift = self.tensor.shifts[atom][0]
            self.atoms[atom] = [clamp_magnitude(round_shift(total, angular_shift), 32767) for total in sums]
        return self.atoms[atom]


def layer_textures(tensor, lists, width, angular_atoms, axis_x, axis_y):
    """12.5-4, 12.5-5, 12.5-6: the textures of the three channels of one layer."""
    weights = {}  # by ABRDF atom
    for span_y in axis_y:
        for span_x in axis_x:
            # 12.5-4; where both texels of an axis are one, its span has both weights
            weight_x, weight_y = sum(span_x.weights), sum(span_y.weights)
            for atom, coefficient in lists.lists[span_y.block * width + span_x.block]:
                weight = multiply_q15(i32(coefficient * weight_x), weight_y)
                weights[atom] = i32(weights.get(atom, 0) + weight)
    totals = [0, 0, 0]
    for atom, weight in weights.items():
        gain_shift = tensor.shifts[atom][1]
        angular = angular_atoms.angular(atom)
        for channel in range(3):
            summand = round_shift(multiply_q15(weight, angular[channel]), gain_shift)
            totals[channel] = i32(totals[channel] + summand)
    return [clamp_magnitude(round_shift(total, lists.shift), LAYER_BOUND) for total in totals]


# ------------------------------------------------- opening (order of 1.4)


def open_file(data, dictionary=None, limits=None, as_material=False):
    """1.4: checks a file in order. Gives it with all its tables, or raises a Finding."""
    limits = limits or Limits()
    file = File(data, "file")
    check_begin(file)  # step 1
    check_header(file)  # step 2
    check_limits(file, limits)  # step 3
    if file.content == DICTIONARY:
        if as_material:
            file.fail("3.1-7", 16, file.content)  # step 4
        check_dictionary_rest(file)  # step 14
        if dictionary is not None:
            file.fail("3.5-3", 0, 0)
        return file
    check_directory(file)  # steps 5 to 7
    check_sections(file)  # step 8
    check_metadata(file)  # step 9
    other = check_reference(file, dictionary, limits)  # step 10
    check_directions(file)  # step 11
    for channel in range(3):  # step 12
        if file.state[channel] != MISSING:
            check_pairs(file, MEANS, channel)
    for channel in file.full:
        if file.section(SCALES, channel) is not None:
            check_pairs(file, SCALES, channel)
    if file.method == TENSOR:  # step 13
        check_tensor(file, other)
    else:
        check_ensemble(file, other)
    return file


def check(data, dictionary=None, limits=None):
    """The first broken rule as (rule, part, offset, found), or None."""
    try:
        open_file(data, dictionary, limits)
    except Finding as finding:
        return finding.row()
    return None


class Material:
    """A file that answers queries (1.4-3: only one that breaks no rule)."""

    def __init__(self, data, dictionary=None, limits=None, layer_limit=None):
        self.file = file = open_file(data, dictionary, limits, as_material=True)
        self.layer_limit = file.layer_count if layer_limit is None else layer_limit  # 10.8-2
        if not 1 <= self.layer_limit <= file.layer_count:
            raise ValueError("layer_limit is 1 to %d" % file.layer_count)
        self.means = {c: Pairs(file, file.section(MEANS, c)) for c in range(3) if file.state[c] != MISSING}
        self.scales = {c: Pairs(file, file.section(SCALES, c)) for c in range(3) if file.section(SCALES, c)}

    # chapter 10

    def record_texture(self, channel, record, light, view, span_x, span_y):
        """10.6, 10.7-1 to 10.7-4: the texture of a record."""
        angular, spatial = self.file.angular[channel], self.file.spatial[channel]
        k = record.dictionary
        sums = {}  # sum_xy by column along y, then along x
        u_light, u_view = {}, {}
        for atom, coefficient in record.coefficients:
            if atom.light not in u_light:
                u_light[atom.light] = angular.blend(k, 0, atom.light, light)
            if atom.view not in u_view:
                u_view[atom.view] = angular.blend(k, 1, atom.view, view)
            # 10.7-1
            u_angular = i32(i32(u_light[atom.light] * u_view[atom.view]) + HALF_Q15) >> 15
            # 10.7-2
            summand = round_shift(i32(coefficient * u_angular), atom.shift)
            columns = sums.setdefault(atom.y, {})
            columns[atom.x] = i32(columns.get(atom.x, 0) + summand)
        # 10.7-3
        total = 0
        for y, columns in sums.items():
            sum_y = 0
            for x, sum_xy in columns.items():
                u_x = spatial.blend(k, 0, x, span_x)
                sum_y = i32(sum_y + multiply_q15(sum_xy, u_x))
            u_y = spatial.blend(k, 1, y, span_y)
            total = i32(total + multiply_q15(sum_y, u_y))
        # 10.7-4
        return clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND)

    def texture(self, channel, level, light, view, axis_x, axis_y):
        """10.7-5, 10.7-6: the texture of a channel."""
        file = self.file
        blocks_x = blocks_along(level_size(file.width, level), file.edge)
        texture = 0
        for span_y in axis_y:
            for span_x in axis_x:
                block = span_y.block * blocks_x + span_x.block  # 6.2-4
                for layer in range(self.layer_limit):
                    record = file.coefficients[level, layer, channel].records[block]
                    texture = i32(texture + self.record_texture(channel, record, light, view, span_x, span_y))
        return texture

    # chapter 12

    def tensor_textures(self, level, light, view, axis_x, axis_y):
        """12.5-7: the textures of the three channels."""
        file = self.file
        width = level_size(file.width, level)
        angular_atoms = AngularAtoms(file.tensor, light, view)
        textures = [0, 0, 0]
        for layer in range(self.layer_limit):
            lists = file.lists[level, layer]
            of_layer = layer_textures(file.tensor, lists, width, angular_atoms, axis_x, axis_y)
            textures = [i32(texture + more) for texture, more in zip(textures, of_layer)]
        return textures

    # chapter 8

    def textures(self, level, light, view, axis_x, axis_y):
        """The textures of the full channels by 10.7-6 or 12.5-7."""
        if self.file.method == TENSOR and self.file.full:
            return self.tensor_textures(level, light, view, axis_x, axis_y)
        return [
            self.texture(channel, level, light, view, axis_x, axis_y) if channel in self.file.full else None
            for channel in range(3)
        ]

    def value(self, channel, texture, light, view):
        """8.3-1, 8.3-2, 8.3-3."""
        state = self.file.state[channel]
        if state == MISSING:
            return 0
        mean_q20 = self.means[channel].mean_q20(light, view)
        if state == MEAN:
            return clamp_magnitude(mean_q20, VALUE_BOUND)
        if channel in self.scales:
            texture = self.scales[channel].scale_texture(texture, light, view)
        return clamp_magnitude(i32(texture + mean_q20), VALUE_BOUND)

    def values(self, level, light, view, axis_x, axis_y):
        """8.3-4."""
        textures = self.textures(level, light, view, axis_x, axis_y)
        return [self.value(channel, textures[channel], light, view) for channel in range(3)]

    def axes(self, level, u_q32, v_q32):
        """8.4-1."""
        file = self.file
        return (
            axis_of_position(u_q32, level_size(file.width, level), file.edge),
            axis_of_position(v_q32, level_size(file.height, level), file.edge),
        )

    def texel_axes(self, x, y):
        """8.5-2."""
        file = self.file
        return (
            axis_of_texel(min(x, file.width - 1), file.edge),
            axis_of_texel(min(y, file.height - 1), file.edge),
        )

    def locate(self, light, view):
        """8.4-1: taps in the set of each."""
        return self.file.light_set.locate(light), self.file.view_set.locate(view)

    # queries; each gives the words red, green and blue

    def point(self, x, y, light, view):
        """8.5: a texel of level 0 for two sample directions."""
        light_taps = taps_of_sample(min(light, self.file.light_count - 1))
        view_taps = taps_of_sample(min(view, self.file.view_count - 1))
        axis_x, axis_y = self.texel_axes(x, y)
        values = self.values(0, light_taps, view_taps, axis_x, axis_y)
        return colour(self.file, values, ONE_Q15)

    def texel(self, x, y, light, view):
        """8.5: a texel of level 0 for any two directions."""
        light_taps, view_taps = self.locate(light, view)
        axis_x, axis_y = self.texel_axes(x, y)
        values = self.values(0, light_taps, view_taps, axis_x, axis_y)
        return colour(self.file, values, light_taps.cosine_q15)

    def filtered(self, u_q32, v_q32, light, view, level=0):
        """8.4: any position and directions on one level."""
        level = min(level, self.file.level_count - 1)  # 8.4-4
        light_taps, view_taps = self.locate(light, view)
        axis_x, axis_y = self.axes(level, u_q32, v_q32)
        values = self.values(level, light_taps, view_taps, axis_x, axis_y)
        return colour(self.file, values, light_taps.cosine_q15)

    def trilinear(self, u_q32, v_q32, level_q16, light, view):
        """9.2: between levels."""
        level_q16 = min(level_q16, (self.file.level_count - 1) << 16)  # 9.2-1
        level = level_q16 >> 16
        fraction_q15 = (level_q16 & 0xFFFF) >> 1
        light_taps, view_taps = self.locate(light, view)
        values = self.values(level, light_taps, view_taps, *self.axes(level, u_q32, v_q32))
        if fraction_q15 != 0:  # 9.2-2, 9.2-3
            to_values = self.values(level + 1, light_taps, view_taps, *self.axes(level + 1, u_q32, v_q32))
            values = [
                i32(from_value + multiply_q15(i32(to_value - from_value), fraction_q15))
                for from_value, to_value in zip(values, to_values)
            ]
        return colour(self.file, values, light_taps.cosine_q15)  # 9.2-4

    # --------------------------------------------------------- chapter 11

    def digest(self):
        """11.2-1, 11.2-7."""
        words = draw_words()
        hashed = hashlib.sha256()
        for kind in range(3):
            for _ in range(256):
                hashed.update(struct.pack("<3I", *self.drawn(kind, words)))
        return hashed.hexdigest()

    def drawn(self, kind, words):
        """11.2-4, 11.2-5, 11.2-6: the next sample of the sequence."""
        file = self.file
        u, v = next(words), next(words)
        if kind == 0:
            l, w = next(words), next(words)
            return self.point(
                product_high(u, file.width),
                product_high(v, file.height),
                product_high(l, file.light_count),
                product_high(w, file.view_count),
            )
        if kind == 1:
            light = draw_direction(words)
            view = draw_direction(words)
            return self.filtered(u, v, light, view)
        level_q16 = product_high(next(words), file.level_count << 16)
        light = draw_direction(words)
        view = draw_direction(words)
        return self.trilinear(u, v, level_q16, light, view)


def draw_words():
    """11.2-2."""
    state = 0x53454C56
    while True:
        state ^= modulo32(state << 13)
        state ^= state >> 17
        state ^= modulo32(state << 5)
        yield state


def draw_direction(words):
    """11.2-3."""
    first, second = next(words), next(words)
    x_q18 = (((first & 0xFFFF) << 3) | ((second >> 16) & 7)) - 262144
    y_q18 = (((first >> 16) << 3) | ((second >> 19) & 7)) - 262144
    return x_q18, y_q18, second & 0xFFFF


# ------------------------------------------------------------ command line


def read_bytes(path):
    with open(path, "rb") as handle:
        return handle.read()


def options_of(arguments):
    """Splits `--name value` from the rest."""
    plain, options = [], {}
    at = 0
    while at < len(arguments):
        if arguments[at].startswith("--"):
            options[arguments[at][2:]] = arguments[at + 1]
            at += 2
        else:
            plain.append(arguments[at])
            at += 1
    return plain, options


def limits_of(options):
    numbers = [options.get(name) for name in ("max-bytes", "max-operations", "max-texels")]
    return Limits(*[None if number is None else int(number, 0) for number in numbers])


def material_of(path, options):
    dictionary = read_bytes(options["dictionary"]) if "dictionary" in options else None
    layers = int(options["layers"]) if "layers" in options else None
    return Material(read_bytes(path), dictionary, layer_limit=layers)


def answer(material, line):
    """One line of `samples`."""
    word, *rest = line.split()
    n = [int(number) for number in rest]
    sizes = dict(point=4, texel=8, filtered=9, trilinear=9, light=3, view=3, direction=3, fraction=1, layers=1)
    if sizes.get(word) != len(n):
        return "error"
    if word in ("light", "view"):
        directions = material.file.light_set if word == "light" else material.file.view_set
        taps = directions.locate(n)
        return " ".join(str(value) for value in (*taps.rows, *taps.weights, taps.cosine_q15))
    if word == "direction":
        return "%d %d %d" % direction_of_binary32(*n)
    if word == "fraction":
        return "%08x" % fraction_of_binary32(n[0])
    if word == "layers":
        if not 1 <= n[0] <= material.file.layer_count:
            return "error"
        material.layer_limit = n[0]
        return "layers %d" % n[0]
    if word == "point":
        result = material.point(*n)
    elif word == "texel":
        result = material.texel(n[0], n[1], n[2:5], n[5:8])
    elif word == "filtered":
        result = material.filtered(n[1], n[2], n[3:6], n[6:9], level=n[0])
    else:
        result = material.trilinear(n[1], n[2], n[0], n[3:6], n[6:9])
    return "%08x %08x %08x" % tuple(result)


def command_samples(path, options):
    material = material_of(path, options)
    for line in sys.stdin:
        if not line.strip() or line.startswith("#"):
            continue
        try:
            print(answer(material, line), flush=True)
        except ValueError:
            print("error", flush=True)
    return 0


def command_check(path, options):
    dictionary = read_bytes(options["dictionary"]) if "dictionary" in options else None
    finding = check(read_bytes(path), dictionary, limits_of(options))
    if finding is None:
        return 0
    print("\t".join(str(part) for part in finding))
    return 3


def vector(folder, fields):
    """One line of a manifest: what was got where it differs, else None."""
    kind, name, dictionary_name = fields[0:3]
    data = read_bytes(os.path.join(folder, name))
    dictionary = None if dictionary_name == "-" else read_bytes(os.path.join(folder, dictionary_name))
    if kind == "valid":
        finding = check(data, dictionary)
        if finding is not None:
            return "broken by " + " ".join(str(part) for part in finding)
        if fields[3] == "-":
            return None
        digest = Material(data, dictionary).digest()
        return None if digest == fields[3] else "digest " + digest
    # a limit of 0 in a manifest is none
    numbers = [None] * 3 if fields[3] == "-" else [int(n, 0) or None for n in fields[3].split(",")]
    finding = check(data, dictionary, Limits(*numbers))
    wanted = (fields[4], fields[5], int(fields[6], 0), int(fields[7], 0))
    if finding == wanted:
        return None
    got = "nothing" if finding is None else " ".join(str(part) for part in finding)
    return "%s, wanted %s" % (got, " ".join(str(part) for part in wanted))


def command_vectors(folder):
    counts = {"valid": [0, 0], "invalid": [0, 0]}
    rules = set()
    with open(os.path.join(folder, "manifest.tsv"), encoding="utf-8") as manifest:
        for line in manifest:
            line = line.rstrip("\n")
            if not line.strip() or line.startswith("#"):
                continue
            fields = line.split("\t")
            counts[fields[0]][0] += 1
            if fields[0] == "invalid":
                rules.add(fields[4])
            try:
                difference = vector(folder, fields)
            except Exception as error:  # a fault of this program must not end the run
                difference = "fault: %r" % (error,)
            if difference is not None:
                counts[fields[0]][1] += 1
                print("%s\t%s\t%s" % (fields[0], fields[1], difference), flush=True)
    print(
        "%d valid, %d of them differ; %d invalid for %d rules, %d of them differ; "
        "%d values left their word" % (*counts["valid"], counts["invalid"][0], len(rules), counts["invalid"][1], wraps[0])
    )
    return 1 if counts["valid"][1] or counts["invalid"][1] else 0


def bytes_of_fences(text_path, fence):
    """The hex dumps of the text behind a fence by their offsets, or None if two do not agree."""
    found = {}
    inside = False
    # The chapters of methods are texts of their own beside the shared one.
    chapters = os.path.join(os.path.dirname(os.path.abspath(text_path)), "methods")
    paths = [text_path]
    if os.path.isdir(chapters):
        paths += [os.path.join(chapters, name) for name in sorted(os.listdir(chapters)) if name.endswith(".md")]
    for path in paths:
        with open(path, encoding="utf-8") as text:
            lines = text.readlines()
        for line in lines:
            if line.startswith("```"):
                inside = line.strip() == fence
                continue
            if not inside:
                continue
            offset, *numbers = line.split()
            for n, number in enumerate(numbers):
                at = int(offset, 16) + n
                if found.setdefault(at, int(number, 16)) != int(number, 16):
                    print("two values for byte %#x" % at)
                    return None
    return found


def command_example(text_path, out_path):
    """Collects the hex dumps of the text, which overlap and must agree."""
    found = bytes_of_fences(text_path, "```hex")
    if found is None:
        return 1
    length = struct.unpack("<I", bytes(found[at] for at in range(12, 16)))[0]
    missing = [at for at in range(length) if at not in found]
    print("%d bytes from the text, %d not shown: %s" % (len(found), len(missing), [hex(at) for at in missing]))
    with open(out_path, "wb") as out:
        out.write(bytes(found.get(at, 0) for at in range(length)))
    return 0


def command_tensor_example(text_path, path):
    """Chapter 12 shows three sections of the tensor example; the rest is only in the file."""
    found = bytes_of_fences(text_path, "```hex tensor")
    if found is None:
        return 1
    data = read_bytes(path)
    wrong = [at for at in sorted(found) if at >= len(data) or data[at] != found[at]]
    file = open_file(data)
    sections = [file.section(kind) for kind in (LIGHT_ATOMS, FIBRES, LISTS)]
    shown = {at for section in sections for at in range(section.offset, section.offset + section.length)}
    print(
        "%d bytes from the text, %d differ: %s; of the three sections %d are not shown"
        % (len(found), len(wrong), [hex(at) for at in wrong], len(shown - set(found)))
    )
    return 1 if wrong or shown - set(found) else 0


def tensor_of_example():
    """The tensor of chapter 12 as far as its example of 12.5 needs it: light 1, view 2."""
    tensor = Tensor()
    tensor.light_atoms = {1: [(400, 80, 0), (511, -250, 0), (60, 300, 0)]}
    tensor.shifts = [(13, 1), (12, 2)]
    tensor.fibres = {2: [[(0, 24000), (2, -4000)], [(1, 20000), (2, 3000)]]}
    return tensor


def command_selftest():
    """The numeric examples of chapters 1 to 9 and 12 that need no file."""
    tensor = tensor_of_example()
    angular_atoms = AngularAtoms(tensor, taps_of_sample(1), taps_of_sample(2))
    lists = Lists.__new__(Lists)  # texel (0, 0) of 12.4, without its file
    lists.lists, lists.shift = [[(0, 32256), (1, -22016)]], 11
    one_texel = axis_of_texel(0, 1)
    example_matrix = (8192, 0, 9338, 8192, -3233, -4756, 8192, 16647, 0)
    example_values = (as_i32(0xFFEEBE0A), as_i32(0xFFFFFE70), 0)
    pairs = [
        ("1.3", crc32(b"123456789"), 0xCBF43926),
        ("2.1", (as_i32(0xFFFFFFFF) >> 4, 0xFFFFFFFF >> 4), (-1, 0x0FFFFFFF)),
        ("2.2-1", multiply_q15(0x12345, 0x5A82), 0xCDF4),
        ("2.2-1", multiply_q15(-0x12345, 0x5A82) & MASK, 0xFFFF320C),
        ("2.2-1", (multiply_q15(-1, 0x4000), multiply_q15(1, 0x4000)), (0, 1)),
        ("2.2-2", multiply_q13(0x100000, 0x247A), 0x123D00),
        ("2.2-3", (round_shift(0x18, 4), round_shift(-0x18, 4), round_shift(0x7FFFFFFF, 1)), (2, -1, 0x40000000)),
        ("2.2-4", product_high(0xDEADBEEF, 0x12345678), 0x0FD5BDEE),
        ("2.2-5", (divide(3, 7, 15), divide(5, 5, 15)), (0x36DB, 0x8000)),
        ("2.3", [exp2_q31(x) for x in (0, 0x80000, 0x12345, 0xFFFFF)], [0x80000000, 0xB504F336, 0x86779BD1, 0xFFFFF4E0]),
        (
            "2.4",
            [assemble_binary32(*x) for x in ((0x80000000, 0), (1, 0), (0xFFFFFF80, 0), (0xFFFFFF80, -127), (MASK, 127))],
            [0x3F800000, 0x30000000, 0x40000000, 0, 0x7F7FFFFF],
        ),
        ("5.1", limit_direction((0x50000, -0x50000, 0x9000)), (0x40000, -0x40000, 0x8000)),
        ("5.2", direction_of_binary32(0x3F19999A, 0, 0x3F4CCCCD), (0x15555, 0, 0x6666)),
        ("5.2", direction_of_binary32(0x3F19999A, 0, 0xBF4CCCCD), (0x15555, 0, 0)),
        ("5.5", [cell_range(cell, 3) for cell in range(3)], [(-16384, -5462), (-5461, 5461), (5462, 16384)]),
        ("5.5-1", grid_cell(2000, 3), 1),
        ("6.1", (fraction_of_binary32(0xBE800000), fraction_of_binary32(0x3FA00000)), (0xC0000000, 0x40000000)),
        ("6.1-3", texel_under(0x80000000, 3), 1),
        ("6.2", (block_of(2, 2), blocks_along(3, 2), blocks_along(2, 2)), (1, 2, 1)),
        ("6.3", [(s.block, s.rows, s.weights) for s in axis_of_position(0x90000000, 3, 2)],
         [(0, (1, 1), (0x6800, 0)), (1, (0, 0), (0x1800, 0))]),
        ("6.3", [(s.block, s.rows, s.weights) for s in axis_of_position(0x10000000, 3, 2)],
         [(1, (0, 0), (0x2800, 0)), (0, (0, 0), (0x5800, 0))]),
        ("7.1", [matrix_row(example_values, example_matrix[3 * n : 3 * n + 3]) & MASK for n in range(3)],
         [0xFFEEBE0A, 0xFFEEBEA8, 0xFFEEBADD]),
        ("7.2", log2_transfer(as_i32(0xFFD80000), 0x3A800000, ONE_Q15), 0x3E3404F3),
        ("7.2", log2_transfer(as_i32(0xFF600000), 0x3A800000, ONE_Q15), 0),
        ("7.3", linear_transfer(0x180000, 0, ONE_Q15), 0x3FC00000),
        ("7.4", log2_transfer(as_i32(0xFFD80000), 0x3A800000, 0x4000), 0x3DB404F3),
        ("9.1", [(level_size(3, n), level_size(2, n)) for n in range(3)], [(3, 2), (2, 1), (1, 1)]),
        ("9.2", 0x100 + multiply_q15(0x200, 0x4000), 0x200),
        ("12.1", [light_atom_entry(x) for x in (0x000191FF, 0x000CE12C, 0x0007FC00)],
         [(511, 100, 0), (300, -200, 0), (0, 511, 0)]),
        ("12.2", [fibre_entry(x, 2) for x in (0x7FFC, 0xE0C2, 0x5DC0, 0xF062, 0x4E21, 0x0BBA)],
         [(0, 32764), (2, -8000), (0, 24000), (2, -4000), (1, 20000), (2, 3000)]),
        ("12.4", (list_low_bits(2, 1), list_coefficient(63, 6), list_coefficient(10, 6)), (0, 32256, -22016)),
        ("12.5-1", [tensor.blended_light_atom(n, taps_of_sample(1))[0] for n in (0, 2)], [400 * 64, 60 * 64]),
        ("12.5-3", [angular_atoms.angular(n)[0:2] for n in (0, 1)], [[0x23B5, 0x02BF], [0x4F59, -0x1F48]]),
        ("12.5-6", layer_textures(tensor, lists, 3, angular_atoms, one_texel, one_texel)[0:2], [0x43F2, 0x69B2]),
    ]
    bad = 0
    for name, got, wanted in pairs:
        if got != wanted:
            bad += 1
            print("%s: got %r, wanted %r" % (name, got, wanted))
    print("%d numeric examples, %d differ" % (len(pairs), bad))
    return 1 if bad else 0


def command_serve():
    """Answers the queries of a conformance runner: see ../vectors/README.md."""
    while True:
        line = sys.stdin.buffer.readline()
        if not line:
            return 0
        _, length, dictionary_length, *numbers = line.decode().split()
        data = sys.stdin.buffer.read(int(length))
        dictionary = None if dictionary_length == "-" else sys.stdin.buffer.read(int(dictionary_length))
        finding = check(data, dictionary, Limits(*(int(n) for n in numbers)))
        if finding is not None:
            print("broken", *finding, flush=True)
        elif len(data) >= 20 and data[16] == DICTIONARY:
            print("legal", flush=True)
        else:
            print("digest", Material(data, dictionary).digest(), flush=True)


def main(arguments):
    plain, options = options_of(arguments)
    try:
        if plain[0:1] == ["check"] and len(plain) == 2:
            return command_check(plain[1], options)
        if plain[0:1] == ["digest"] and len(plain) == 2:
            print(material_of(plain[1], options).digest())
            return 0
        if plain[0:1] == ["vectors"] and len(plain) == 2:
            return command_vectors(plain[1])
        if plain[0:1] == ["samples"] and len(plain) == 2:
            return command_samples(plain[1], options)
        if plain[0:1] == ["example"] and len(plain) == 3:
            return command_example(plain[1], plain[2])
        if plain[0:1] == ["tensor-example"] and len(plain) == 3:
            return command_tensor_example(plain[1], plain[2])
        if plain == ["serve"]:
            return command_serve()
        if plain == ["selftest"]:
            return command_selftest()
    except Finding as finding:
        print("\t".join(str(part) for part in finding.row()), file=sys.stderr)
        return 3
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
