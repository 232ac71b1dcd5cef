"""Chapter 1: words, bytes and bits, checksums, and the report of a finding."""

MASK = 0xFFFFFFFF
ONE_Q14 = 16384
ONE_Q18 = 262144
ONE_Q15 = 32768
HALF_Q15 = 16384
HALF_Q13 = 4096
ONE_Q30 = 0x40000000
BINARY32_MAX = 0x7F7FFFFF
VALUE_BOUND = 0x08000000

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
