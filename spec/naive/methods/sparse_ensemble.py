"""Chapter 10: the method sparse-ensemble."""

from chapters.conventions import HALF_Q15, as_i16, ceil_div, i32, modulo32, u32
from chapters.fixed_point import clamp_magnitude, multiply_q15, round_shift
from chapters.file import MEANS, SCALES, Row
from chapters.position import blocks_along
from chapters.levels import level_size
from chapters.lists import Stream, low_and_value

NAME = "sparse-ensemble"
NUMBER = 1
LARGEST_EDGE = 16

RECORD_BOUND = 0x02000000
ANGULAR = 0x0110
SPATIAL = 0x0111
ATOMS = 0x0112
COEFFICIENTS = 0x0113

# the table of sections of chapter 10
SECTIONS = (
    Row(MEANS, "channel", "required", "required", "foreign"),
    Row(SCALES, "channel", "allowed", "allowed", "foreign"),
    Row(ANGULAR, "channel", "required", "foreign", "required"),
    Row(SPATIAL, "channel", "required", "allowed", "allowed"),
    Row(ATOMS, "channel", "required", "required", "foreign"),
    Row(COEFFICIENTS, "layer and channel", "required", "required", "foreign"),
)


def factor_rows(file, kind):
    """10.1, 10.2: rows of both tables and the most columns."""
    if kind == ANGULAR:
        return (file.light_count, file.view_count), 1024
    return (file.edge, file.edge), file.edge


def check_factors(file, kind, channel):
    """Chapter 10, order of checks, 1: 10.1-1 to 10.1-4 for one section."""
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
        file.check_rows("10.1-4", table, table_rows, columns)


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
    """Chapter 10, order of checks, 2: 10.5-3 to 10.5-7. Gives the atoms of each dictionary."""
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


class Coefficients(Stream):
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

    def check(self, level, atoms):
        """Chapter 10, order of checks, 3, from 10.3-3 on."""
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
        self.check_tail("10.4-9")
        if self.largest != most:
            file.fail("10.3-4", at + 12, self.largest)

    def check_record(self, block, next_bit, atoms):
        """Chapter 10, order of checks, 3, one record: 10.4-6, 10.4-7, 10.4-8, 10.4-11, 10.7-7."""
        file = self.file
        first = self.first_bit(block)
        if first != next_bit:
            file.fail("10.4-6", self.section.offset + 16 + 4 * block, first)
        place = self.place(first)
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
            low, value = low_and_value(self, at, low_bits, self.value_bits)
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


def check_material(file, dictionary):
    """Chapter 10, order of checks of a material. Gives the method's part of the cost."""
    # 1
    for channel in range(3):
        if file.section(ANGULAR, channel) is not None:
            check_factors(file, ANGULAR, channel)
    for channel in file.full:
        if file.section(SPATIAL, channel) is not None:
            check_factors(file, SPATIAL, channel)
    # 2; 3.5-7, 3.5-8
    file.angular, file.spatial, file.atoms = {}, {}, {}
    for channel in file.full:
        angular_file = file if dictionary is None else dictionary
        spatial_file = file if file.section(SPATIAL, channel) is not None else dictionary
        check_dictionary_counts(file, angular_file, channel)
        file.angular[channel] = Factors(angular_file, ANGULAR, channel)
        file.spatial[channel] = Factors(spatial_file, SPATIAL, channel)
        file.atoms[channel] = check_atoms(file, channel, file.angular[channel], file.spatial[channel])
    # 3; 10.3-1
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
    return own_cost(file, largest)


def check_dictionary(file):
    """Chapter 10, order of checks of a dictionary."""
    for channel in file.full:
        check_factors(file, ANGULAR, channel)
        if file.section(SPATIAL, channel) is not None:
            check_factors(file, SPATIAL, channel)
            check_dictionary_counts(file, file, channel)


def dictionary_fits(file, other):
    """3.5-5: what chapter 10 asks of the dictionary `other` of a material."""
    for channel in file.full:
        if file.section(SPATIAL, channel) is None:
            if other.section(SPATIAL, channel) is None or other.edge != file.edge:
                return False
    return True


def own_cost(file, largest_counts):
    """4.2-2 and the cost of chapter 10. `largest_counts[(level, layer, channel)]` is `n`."""
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


def record_texture(file, channel, record, light, view, span_x, span_y):
    """10.6, 10.7-1 to 10.7-4: the texture of a record."""
    angular, spatial = file.angular[channel], file.spatial[channel]
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


def texture(file, channel, layer_limit, place, light, view):
    """10.7-5, 10.7-6: the texture of a channel."""
    blocks_x = blocks_along(level_size(file.width, place.level), file.edge)
    texture = 0
    for span_y in place.axis_y:
        for span_x in place.axis_x:
            block = span_y.block * blocks_x + span_x.block  # 6.2-4
            for layer in range(layer_limit):
                record = file.coefficients[place.level, layer, channel].records[block]
                texture = i32(texture + record_texture(file, channel, record, light, view, span_x, span_y))
    return texture


def textures(file, layer_limit, place, light, view):
    """10.7-6 for each full channel, with the taps of the located directions; 0 for the others."""
    return [
        texture(file, channel, layer_limit, place, light.taps, view.taps) if channel in file.full else 0
        for channel in range(3)
    ]


def examples():
    """The numeric examples of chapter 10 that need no file: name, what was computed, what the text says."""
    atoms = [Atom(0x00000000, 0x7D00C180), Atom(0x00004002, 0x3E80E0C0), Atom(0x01000003, 0x7FFF0000)]
    return [
        ("10.5", [(a.light, a.view, a.x, a.y, a.shift, a.base, a.step) for a in atoms],
         [(0, 0, 0, 0, 0, -16000, 32000), (1, 0, 0, 0, 2, -8000, 16000), (0, 0, 1, 0, 3, 0, 32767)]),
        ("10.5", (atoms[0].coefficient(15, 4), atoms[2].coefficient(7, 4)), (0x36B0, 0x3800)),
    ]
