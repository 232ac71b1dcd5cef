"""Chapter 3: the header (3.1)."""

from chapters.conventions import MASK, as_i32, crc32
from chapters.file import DICTIONARY, MATERIAL, MEAN
from chapters.levels import level_size
from methods import METHODS, method_of

MAGIC = bytes.fromhex("53454c560d0a1a0a")


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
    if file.method not in METHODS:
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
    if not 1 <= file.edge <= method_of(file).LARGEST_EDGE:
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
        check_header_of_dictionary(file)


def check_header_of_dictionary(file):
    """3.1-19."""
    if file.operations != 0:
        file.fail("3.1-19", 28, file.operations)
    ones = ((32, file.width), (36, file.height), (48, file.level_count), (53, file.layer_count))
    for at, value in ones:
        if value != 1:
            file.fail("3.1-19", at, value)
    for channel in range(3):
        if file.state[channel] == MEAN:
            file.fail("3.1-19", 56 + channel, MEAN)
    for at in range(60, 85, 4):
        if file.u32(at) != 0:
            file.fail("3.1-19", at, file.u32(at))
