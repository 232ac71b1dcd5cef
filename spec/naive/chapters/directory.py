"""Chapter 3: the directory (3.2), and the sections that header and method call for (3.3)."""

from chapters.conventions import align, crc32
from chapters.file import (
    DICTIONARY,
    DIRECTIONS,
    MATERIAL,
    MEAN,
    MEANS,
    METADATA,
    OPTIONAL,
    REFERENCE,
    SCALES,
    Section,
)
from methods import METHODS, method_of

# 3.2-1: the critical kinds of the table of 3.3 and of those of the methods
KNOWN_KINDS = {METADATA, REFERENCE, DIRECTIONS, MEANS, SCALES}
for known in METHODS.values():
    KNOWN_KINDS.update(row.kind for row in known.SECTIONS)


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
    """3.3, 3.3-6: the required sections in the order of step 8, and the allowed ones."""
    called = {"required": [(METADATA, 0)], "allowed": [], "foreign": []}
    if file.content == MATERIAL:
        called["allowed"].append((REFERENCE, 0))
        called["required"].append((DIRECTIONS, 0))
        called["allowed" if file.view_count == file.light_count else "required"].append((DIRECTIONS, 1))
        called["required"] += [(MEANS, channel) for channel in range(3) if file.state[channel] == MEAN]
    rows = sorted(method_of(file).SECTIONS, key=lambda row: row.kind)
    for row in rows:
        if not row.of_levels:
            called[call_of(row, file)] += [(row.kind, instance) for instance in row.instances(file)]
    called["required"].sort()
    for level in range(file.level_count):
        for layer in range(file.layer_count):
            first = level * 256 + layer * 16
            for row in rows:
                if row.of_levels:
                    called[call_of(row, file)] += [(row.kind, first + n) for n in row.instances(file)]
    return called["required"], called["allowed"]


def call_of(row, file):
    """3.3: what a row of the method's table says of its section in this file."""
    if file.content == DICTIONARY:
        return row.in_dictionary
    return row.in_material if file.section(REFERENCE) is None else row.in_referring


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
