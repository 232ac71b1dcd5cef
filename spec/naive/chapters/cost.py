"""Chapter 4: limits of the caller and the stated cost."""

from chapters.conventions import MASK
from chapters.file import MEANS, SCALES


class Limits:
    """4.1: what the caller allows; None is no limit."""

    def __init__(self, max_bytes=None, max_operations=None, max_texels=None):
        self.max_bytes = max_bytes
        self.max_operations = max_operations
        self.max_texels = max_texels


def check_limits(file, limits):
    """1.4, step 3: 4.1-1, 4.1-2, 4.1-4."""
    if limits.max_bytes is not None and len(file.data) > limits.max_bytes:
        file.fail("4.1-1", 12, len(file.data))
    if limits.max_operations is not None and file.operations > limits.max_operations:
        file.fail("4.1-2", 28, file.operations)
    texels = file.width * file.height
    if limits.max_texels is not None and texels > limits.max_texels:
        file.fail("4.1-4", 32, min(texels, MASK))


def stated_cost(file, textures):
    """4.2-1. `textures` is the method's own part."""
    locate_light = operations_to_locate(file.light_set)
    locate_view = operations_to_locate(file.view_set)
    means = sum(1 for channel in range(3) if file.section(MEANS, channel) is not None)
    scales = sum(1 for channel in range(3) if file.section(SCALES, channel) is not None)
    return min(18 + locate_light + locate_view + 15 * means + 17 * scales + textures + 102, MASK)


def operations_to_locate(directions):
    """4.2-3."""
    return 2 + 6 * directions.most_candidates() + 6 * directions.hull_count + 7
