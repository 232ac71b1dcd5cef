"""Chapter 12: the method sparse-tensor."""

from chapters.conventions import as_i16, ceil_div, i32
from chapters.fixed_point import clamp_magnitude, multiply_q15, round_shift
from chapters.file import MEANS, SCALES, Row
from chapters.directions import taps_of_sample
from chapters.position import axis_of_texel
from chapters.levels import level_size
from chapters.lists import Stream, low_and_value

NAME = "sparse-tensor"
NUMBER = 2
LARGEST_EDGE = 1

LAYER_BOUND = 0x08000000
LIGHT_ATOMS = 0x0210
FIBRES = 0x0211
LISTS = 0x0212

# the table of sections of chapter 12
SECTIONS = (
    Row(MEANS, "channel", "required", "required", "foreign"),
    Row(SCALES, "channel", "allowed", "allowed", "foreign"),
    Row(LIGHT_ATOMS, "file", "required", "foreign", "required"),
    Row(FIBRES, "file", "required", "foreign", "required"),
    Row(LISTS, "layer", "required", "required", "foreign"),
)


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
    """Chapter 12, order of checks, 1: 12.1-1 to 12.1-3, 12.2-1 to 12.2-5."""
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


class Lists(Stream):
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

    def check(self, level):
        """Chapter 12, order of checks, 2, from 12.3-3 on."""
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
        self.check_tail("12.4-9")
        if self.largest != max(len(pairs) for pairs in self.lists):
            file.fail("12.3-4", at + 12, self.largest)

    def check_group(self, group, next_bit):
        """12.4-1, 12.4-3; one group: 12.4-6, 12.4-7 and its lists."""
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
        """12.4-2, 12.4-4, 12.4-5; one list: 12.4-6, 12.4-8, 12.5-8."""
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
            low, value = low_and_value(self, at, low_bits, self.value_bits)
            index = (highs[n] << low_bits) | low
            if not before < index < tensor.atom_count:
                file.fail("12.4-8", self.place(first), first)
            before = index
            pairs.append((index, list_coefficient(value, self.value_bits)))
        magnitude = sum(ceil_div(abs(c), 1 << tensor.shifts[index][1]) for index, c in pairs)
        if magnitude > 65534:
            file.fail("12.5-8", self.place(first), magnitude)
        self.lists.append(pairs)
        return after


def check_material(file, dictionary):
    """Chapter 12, order of checks of a material. Gives the method's part of the cost."""
    if not file.full:
        return 0
    # 1; 3.5-7
    if dictionary is None:
        check_tensor_tables(file)
    else:
        file.tensor = dictionary.tensor
    # 2; 12.3-1
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
    return own_cost(file, file.tensor, largest)


def check_dictionary(file):
    """Chapter 12, order of checks of a dictionary."""
    if file.full:
        check_tensor_tables(file)


def dictionary_fits(file, other):
    """3.5-5: chapter 12 asks nothing more of a dictionary."""
    return True


def own_cost(file, tensor, largest_counts):
    """4.2-4 and the cost of chapter 12. `largest_counts[(level, layer)]` is `n`."""
    textures = 0
    for level in range(file.level_count):
        level_sum = 0
        for layer in range(file.layer_count):
            n = largest_counts[level, layer]
            level_sum += 12 * n + min(4 * n, tensor.atom_count) * (39 * tensor.entries + 6)
        textures = max(textures, level_sum)
    return textures


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


def textures(file, layer_limit, place, light, view):
    """12.5-7: the textures of the three channels, with the taps of the located directions."""
    width = level_size(file.width, place.level)
    angular_atoms = AngularAtoms(file.tensor, light.taps, view.taps)
    totals = [0, 0, 0]
    for layer in range(layer_limit):
        lists = file.lists[place.level, layer]
        of_layer = layer_textures(file.tensor, lists, width, angular_atoms, place.axis_x, place.axis_y)
        totals = [i32(total + more) for total, more in zip(totals, of_layer)]
    return totals


def tensor_of_example():
    """The tensor of chapter 12 as far as its example of 12.5 needs it: light 1, view 2."""
    tensor = Tensor()
    tensor.light_atoms = {1: [(400, 80, 0), (511, -250, 0), (60, 300, 0)]}
    tensor.shifts = [(13, 1), (12, 2)]
    tensor.fibres = {2: [[(0, 24000), (2, -4000)], [(1, 20000), (2, 3000)]]}
    return tensor


def examples():
    """The numeric examples of chapter 12 that need no file: name, what was computed, what the text says."""
    tensor = tensor_of_example()
    angular_atoms = AngularAtoms(tensor, taps_of_sample(1), taps_of_sample(2))
    lists = Lists.__new__(Lists)  # texel (0, 0) of 12.4, without its file
    lists.lists, lists.shift = [[(0, 32256), (1, -22016)]], 11
    one_texel = axis_of_texel(0, 1)
    return [
        ("12.1", [light_atom_entry(x) for x in (0x000191FF, 0x000CE12C, 0x0007FC00)],
         [(511, 100, 0), (300, -200, 0), (0, 511, 0)]),
        ("12.2", [fibre_entry(x, 2) for x in (0x7FFC, 0xE0C2, 0x5DC0, 0xF062, 0x4E21, 0x0BBA)],
         [(0, 32764), (2, -8000), (0, 24000), (2, -4000), (1, 20000), (2, 3000)]),
        ("12.4", (list_low_bits(2, 1), list_coefficient(63, 6), list_coefficient(10, 6)), (0, 32256, -22016)),
        ("12.5-1", [tensor.blended_light_atom(n, taps_of_sample(1))[0] for n in (0, 2)], [400 * 32, 60 * 32]),
        ("12.5-3", [angular_atoms.angular(n)[0:2] for n in (0, 1)], [[0x23B5, 0x02BF], [0x4F59, -0x1F48]]),
        ("12.5-6", layer_textures(tensor, lists, 3, angular_atoms, one_texel, one_texel)[0:2],
         [0x43F2, 0x69B2]),
    ]
