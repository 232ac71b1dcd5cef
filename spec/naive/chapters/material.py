"""Chapter 8 and 9.2: the value of a channel (8.3), and the samples that a caller can ask for."""

from chapters.colour import colour
from chapters.conventions import ONE_Q15, VALUE_BOUND, i32
from chapters.file import MEAN, MEANS, MISSING, SCALES
from chapters.fixed_point import clamp_magnitude, multiply_q15
from chapters.interpolation import Pairs
from chapters.levels import level_size
from chapters.opening import open_file
from chapters.position import Place, axis_of_position, axis_of_texel
from chapters.results import decode_digest
from methods import method_of


class Material:
    """A file that answers queries (1.4-3: only one that breaks no rule)."""

    def __init__(self, data, dictionary=None, limits=None, layer_limit=None):
        self.file = file = open_file(data, dictionary, limits, as_material=True)
        self.limit_layers(file.layer_count if layer_limit is None else layer_limit)
        self.means = {c: Pairs(file, file.section(MEANS, c)) for c in range(3) if file.section(MEANS, c)}
        self.scales = {c: Pairs(file, file.section(SCALES, c)) for c in range(3) if file.section(SCALES, c)}

    def limit_layers(self, layer_limit):
        """10.8-2: a choice out of range is moved to the nearest."""
        self.layer_limit = max(1, min(layer_limit, self.file.layer_count))

    def textures(self, place, light, view):
        """8.3-3: the textures of the full channels, by the method of the file."""
        if not self.file.full:
            return [0, 0, 0]
        return method_of(self.file).textures(self.file, self.layer_limit, place, light, view)

    def value(self, channel, texture, light, view):
        """8.3-1, 8.3-2, 8.3-3."""
        state = self.file.state[channel]
        if state == MISSING:
            return 0
        # 8.1-8
        mean_q20 = self.means[channel].mean_q20(light, view) if channel in self.means else 0
        if state == MEAN:
            return clamp_magnitude(mean_q20, VALUE_BOUND)
        if channel in self.scales:
            texture = self.scales[channel].scale_texture(texture, light, view)
        return clamp_magnitude(i32(texture + mean_q20), VALUE_BOUND)

    def values(self, place, light, view):
        """8.3-4."""
        textures = self.textures(place, light, view)
        return [self.value(channel, textures[channel], light.taps, view.taps) for channel in range(3)]

    def place(self, level, u_q32, v_q32):
        """8.4-1."""
        file = self.file
        return Place(
            level,
            axis_of_position(u_q32, level_size(file.width, level), file.edge),
            axis_of_position(v_q32, level_size(file.height, level), file.edge),
        )

    def texel_place(self, x, y):
        """8.5-2."""
        file = self.file
        return Place(
            0,
            axis_of_texel(min(x, file.width - 1), file.edge),
            axis_of_texel(min(y, file.height - 1), file.edge),
        )

    def locate(self, light, view):
        """8.4-1: each in its own set."""
        return self.file.light_set.locate(light), self.file.view_set.locate(view)

    # queries; each gives the words red, green and blue

    def point(self, x, y, light, view):
        """8.5: a texel of level 0 for two sample directions."""
        light = self.file.light_set.sample(min(light, self.file.light_count - 1))  # 8.5-1
        view = self.file.view_set.sample(min(view, self.file.view_count - 1))
        values = self.values(self.texel_place(x, y), light, view)
        return colour(self.file, values, ONE_Q15)

    def texel(self, x, y, light, view):
        """8.5: a texel of level 0 for any two directions."""
        light, view = self.locate(light, view)
        values = self.values(self.texel_place(x, y), light, view)
        return colour(self.file, values, light.taps.cosine_q15)

    def filtered(self, u_q32, v_q32, light, view, level=0):
        """8.4: any position and directions on one level."""
        level = min(level, self.file.level_count - 1)  # 8.4-4
        light, view = self.locate(light, view)
        values = self.values(self.place(level, u_q32, v_q32), light, view)
        return colour(self.file, values, light.taps.cosine_q15)

    def trilinear(self, u_q32, v_q32, level_q16, light, view):
        """9.2: between levels."""
        level_q16 = min(level_q16, (self.file.level_count - 1) << 16)  # 9.2-1
        level = level_q16 >> 16
        fraction_q15 = (level_q16 & 0xFFFF) >> 1
        light, view = self.locate(light, view)
        values = self.values(self.place(level, u_q32, v_q32), light, view)
        if fraction_q15 != 0:  # 9.2-2, 9.2-3
            to_values = self.values(self.place(level + 1, u_q32, v_q32), light, view)
            values = [
                i32(from_value + multiply_q15(i32(to_value - from_value), fraction_q15))
                for from_value, to_value in zip(values, to_values)
            ]
        return colour(self.file, values, light.taps.cosine_q15)  # 9.2-4

    def digest(self):
        """11.2."""
        return decode_digest(self)

