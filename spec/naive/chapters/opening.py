"""1.4: opening a file, all checks in their order; with 3.5, which opens a dictionary."""

import hashlib

from chapters.conventions import Finding
from chapters.cost import Limits, check_limits, stated_cost
from chapters.directions import check_directions
from chapters.directory import check_directory, check_sections
from chapters.file import DICTIONARY, FULL, MEANS, REFERENCE, SCALES, File
from chapters.header import check_begin, check_header
from chapters.interpolation import check_pairs
from chapters.metadata import check_metadata
from methods import method_of


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
    same = same and method_of(file).dictionary_fits(file, other)
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
    method_of(file).check_dictionary(file)


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
    for kind in (MEANS, SCALES):  # step 12
        for channel in range(3):
            if file.section(kind, channel) is not None:
                check_pairs(file, kind, channel)
    textures = method_of(file).check_material(file, other)  # step 13
    if file.operations != stated_cost(file, textures):
        file.fail("4.2-1", 28, file.operations)
    return file


def check(data, dictionary=None, limits=None):
    """The first broken rule as (rule, part, offset, found), or None."""
    try:
        open_file(data, dictionary, limits)
    except Finding as finding:
        return finding.row()
    return None
