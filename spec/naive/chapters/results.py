"""Chapter 11: the decode digest."""

import hashlib
import struct

from chapters.conventions import modulo32
from chapters.fixed_point import product_high


def decode_digest(material):
    """11.2-1, 11.2-7."""
    words = draw_words()
    hashed = hashlib.sha256()
    for kind in range(3):
        for _ in range(256):
            hashed.update(struct.pack("<3I", *drawn(material, kind, words)))
    return hashed.hexdigest()


def drawn(material, kind, words):
    """11.2-4, 11.2-5, 11.2-6: the next sample of the sequence."""
    file = material.file
    u, v = next(words), next(words)
    if kind == 0:
        l, w = next(words), next(words)
        return material.point(
            product_high(u, file.width),
            product_high(v, file.height),
            product_high(l, file.light_count),
            product_high(w, file.view_count),
        )
    if kind == 1:
        light = draw_direction(words)
        view = draw_direction(words)
        return material.filtered(u, v, light, view)
    level_q16 = product_high(next(words), file.level_count << 16)
    light = draw_direction(words)
    view = draw_direction(words)
    return material.trilinear(u, v, level_q16, light, view)


def draw_words():
    """11.2-2."""
    state = 0x53454C56
    while True:
        state ^= modulo32(state << 13)
        state ^= state >> 17
        state ^= modulo32(state << 5)
        yield state


def draw_direction(words):
    """11.2-3."""
    first, second = next(words), next(words)
    x_q18 = (((first & 0xFFFF) << 3) | ((second >> 16) & 7)) - 262144
    y_q18 = (((first >> 16) << 3) | ((second >> 19) & 7)) - 262144
    return x_q18, y_q18, second & 0xFFFF
