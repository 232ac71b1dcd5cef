"""The numeric examples of the text, and whether each method is whole."""

import pkgutil

import methods
from chapters.colour import linear_transfer, log2_transfer, matrix_row
from chapters.conventions import MASK, ONE_Q15, Finding, as_i32, crc32
from chapters.directions import (
    Directions,
    between_q18,
    cell_range,
    clamp_direction,
    direction_of_binary32,
    dot_product,
    grid_cell,
    reciprocal_of,
    shift_of,
)
from chapters.file import MEANS, SCALES, File
from chapters.fixed_point import (
    assemble_binary32,
    divide,
    exp2_q31,
    multiply_q13,
    multiply_q15,
    product_high,
    round_shift,
)
from chapters.levels import level_size
from chapters.position import axis_of_position, block_of, blocks_along, fraction_of_binary32, texel_under
from methods import METHODS

# What `methods` asks of a module.
OF_A_METHOD = ("NAME", "NUMBER", "LARGEST_EDGE", "SECTIONS")
OF_A_METHOD += ("check_material", "check_dictionary", "dictionary_fits", "textures", "examples")


def faults_of_methods():
    """A module that is not in the list, a part that a method lacks, a kind that is not its own (3.1)."""
    there = {module.name for module in pkgutil.iter_modules(methods.__path__)}
    faults = ["methods/%s.py is not in the list" % name for name in sorted(there - set(methods.NAMES))]
    for method in METHODS.values():
        faults += ["%s has no %s" % (method.NAME, part) for part in OF_A_METHOD if not hasattr(method, part)]
        for row in method.SECTIONS:
            if row.kind not in (MEANS, SCALES) and row.kind >> 8 != method.NUMBER:
                faults.append("%s has a section of kind %#06x" % (method.NAME, row.kind))
    return faults


def finding_on_hull(points, triangles, hull):
    """5.7: the rule and the number that are found in the hull and the cover of a set, or None."""
    directions = Directions.__new__(Directions)
    directions.file = File(b"", "file")
    directions.points, directions.count = points, len(points)
    directions.triangles = [(a, b, c, 0, 0) for a, b, c in triangles]
    directions.hull = []
    for n, a in enumerate(hull):
        end = points[hull[(n + 1) % len(hull)]]
        whole = dot_product(points[a], end, end)
        directions.hull.append((a, shift_of(whole), reciprocal_of(whole)))
    directions.triangle_count, directions.hull_count = len(triangles), len(hull)
    directions.triangles_at, directions.hull_at = 0, 0
    try:
        directions.check_hull()
        directions.check_cover()
    except Finding as finding:
        return finding.rule, finding.found
    return None


def examples_of_hulls():
    """5.7: the numeric examples of findings."""
    points = [(0, 0), (8000, 0), (0, 8000), (-8000, 0), (0, -8000)]
    fan = [(0, 1, 2), (0, 2, 3), (0, 3, 4)]
    pentagon = [(8000, 0), (2472, 7608), (-6472, 4702), (-6472, -4702), (2472, -7608)]
    inner = [(0, 8000), (-7000, -4000), (7000, -4000), (0, 100)]
    six = [(-8000, -8000), (8000, -8000), (8000, 8000), (-8000, 8000), (-1000, -1000), (2000, 1000)]
    overlapping = [(0, 1, 2), (0, 2, 3), (0, 5, 4), (1, 3, 4), (1, 5, 3), (2, 4, 5)]
    return [
        ("5.7", finding_on_hull(points, fan + [(0, 4, 1)], [1, 2, 3, 4]), None),
        ("5.7-7", finding_on_hull(points, fan + [(0, 4, 1)], [1, 4, 3, 2]), ("5.7-7", 0)),
        ("5.7-7", finding_on_hull(pentagon, fan, [0, 2, 4, 1, 3]), ("5.7-7", 8)),
        ("5.7-8", finding_on_hull(points, fan + [(1, 2, 3)], [1, 2, 3, 4]), ("5.7-8", 0)),
        ("5.7-8", finding_on_hull(inner, [(0, 1, 3), (0, 3, 2), (1, 2, 3)], [0, 1, 3]), ("5.7-8", 1)),
        ("5.7-8", finding_on_hull(six, overlapping, [0, 1, 2, 3]), ("5.7-8", 12)),
    ]


def command_selftest():
    """The numeric examples of the text that need no file, then those of each method."""
    example_matrix = (8192, 0, 9338, 8192, -3233, -4756, 8192, 16647, 0)
    example_values = (as_i32(0xFFEEBE0A), as_i32(0xFFFFFE70), 0)
    pairs = [
        ("1.3", crc32(b"123456789"), 0xCBF43926),
        ("2.1", (as_i32(0xFFFFFFFF) >> 4, 0xFFFFFFFF >> 4), (-1, 0x0FFFFFFF)),
        ("2.2-1", multiply_q15(0x12345, 0x5A82), 0xCDF4),
        ("2.2-1", multiply_q15(-0x12345, 0x5A82) & MASK, 0xFFFF320C),
        ("2.2-1", (multiply_q15(-1, 0x4000), multiply_q15(1, 0x4000)), (0, 1)),
        ("2.2-2", multiply_q13(0x100000, 0x247A), 0x123D00),
        ("2.2-3", [round_shift(*x) for x in ((0x18, 4), (-0x18, 4), (0x7FFFFFFF, 1))], [2, -1, 0x40000000]),
        ("2.2-4", product_high(0xDEADBEEF, 0x12345678), 0x0FD5BDEE),
        ("2.2-5", (divide(3, 7, 15), divide(5, 5, 15)), (0x36DB, 0x8000)),
        ("2.3", [exp2_q31(x) for x in (0, 0x80000, 0x12345, 0xFFFFF)],
         [0x80000000, 0xB504F336, 0x86779BD1, 0xFFFFF4E0]),
        ("2.4", [assemble_binary32(*x) for x in ((0x80000000, 0), (1, 0), (0xFFFFFF80, 0))],
         [0x3F800000, 0x30000000, 0x40000000]),
        ("2.4", (assemble_binary32(0xFFFFFF80, -127), assemble_binary32(MASK, 127)), (0, 0x7F7FFFFF)),
        ("5.1", clamp_direction((0x50000, -0x50000, 0x9000)), (0x40000, -0x40000, 0x8000)),
        ("5.2", direction_of_binary32(0x3F19999A, 0, 0x3F4CCCCD), (0x15555, 0, 0x6666)),
        ("5.2", direction_of_binary32(0x3F19999A, 0, 0xBF4CCCCD), (0x15555, 0, 0)),
        ("5.5", [cell_range(cell, 3) for cell in range(3)],
         [(-16384, -5462), (-5461, 5461), (5462, 16384)]),
        ("5.5-1", grid_cell(2000, 3), 1),
        ("5.7-9", (between_q18(8000, 0, 0x4000), between_q18(0, 8000, 0x4000)), (64000, 64000)),
        ("6.1", [fraction_of_binary32(x) for x in (0xBE800000, 0x3FA00000)], [0xC0000000, 0x40000000]),
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
    ]
    pairs += examples_of_hulls()
    for method in METHODS.values():
        pairs += method.examples()
    faults = faults_of_methods()
    for fault in faults:
        print(fault)
    bad = 0
    for name, got, wanted in pairs:
        if got != wanted:
            bad += 1
            print("%s: got %r, wanted %r" % (name, got, wanted))
    print("%d numeric examples, %d differ" % (len(pairs), bad))
    return 1 if bad or faults else 0
