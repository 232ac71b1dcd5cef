"""Chapter 16: lists and layers."""


class Stream:
    """16.1: a stream of bits within a section; a subclass sets `file`, `stream`, `end` and `bits`."""

    def field(self, bit, n):
        """10.4-1, 1.2-5."""
        return self.file.bit_window(self.stream, bit, self.end) & ((1 << n) - 1)

    def place(self, bit):
        """1.4-4: the word of the stream that holds a bit."""
        return 4 * (self.stream + (bit >> 5))

    def next_one(self, bit):
        """10.4-4: the first one from `bit` on, or None if the stream ends."""
        while bit < self.bits:
            window = self.file.bit_window(self.stream, bit, self.end)
            if window == 0:
                bit += 32
                continue
            bit += (window & -window).bit_length() - 1
            return bit if bit < self.bits else None
        return None

    def check_tail(self, rule):
        """10.4-9, 12.4-9: the bits after the end are zero."""
        if self.bits % 32 != 0:
            unused = self.file.word(self.end - 1) >> (self.bits % 32)
            if unused != 0:
                self.file.fail(rule, 4 * (self.end - 1), unused)


def low_and_value(stream, at, low_bits, value_bits):
    """10.4-5: the low part of a position and the value, side by side."""
    return stream.field(at, low_bits), stream.field(at + low_bits, value_bits)
