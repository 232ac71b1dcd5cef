"""Chapter 8: means and scales (8.1, 8.2)."""

from chapters.conventions import VALUE_BOUND, as_i32, ceil_div, i32
from chapters.fixed_point import clamp_magnitude, multiply_q15, round_shift
from chapters.file import MEANS


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
    file.check_rows("8.1-7", at + 16, views, lights)


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
