"""Chapter 3: metadata (3.4)."""

from chapters.conventions import align
from chapters.file import METADATA


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
