"""Opens a material through the shared library and prints what sample.c prints, with the standard library alone.

    python3 sample.py LIBRARY FILE [DICTIONARY]

Exit codes are those of the program `selvedge`: 0 good, 1 bad usage, 2 I/O, 3 invalid file, 4 over the limits,
5 unsupported.
"""

import ctypes
import sys
from ctypes import POINTER, Structure, byref, c_char_p, c_float, c_int32, c_size_t, c_uint8, c_uint32, c_uint64, c_void_p

ABI_VERSION = 2
BAD_USAGE, BAD_IO, NULL_POINTER = 1, 2, 16


class Material(Structure):
    _fields_ = [("opaque", c_uint64 * 64)]


class Finding(Structure):
    _fields_ = [(name, c_uint32) for name in ("rule", "part", "offset", "found")]


class Header(Structure):
    _fields_ = (
        [(name, c_uint32) for name in ("minor_version", "file_length", "content", "method", "section_count", "operations")]
        + [(name, c_uint32) for name in ("width", "height", "light_count", "view_count", "level_count", "edge", "layer_count")]
        + [("states", c_uint32 * 3)]
        + [(name, c_uint32) for name in ("transfer", "cosine_included", "transfer_parameter")]
        + [("matrix_q13", c_int32 * 9)]
    )


class Text(Structure):
    _fields_ = [("text", c_void_p), ("length", c_size_t)]

    def __str__(self):
        return ctypes.string_at(self.text, self.length).decode("utf-8")


class Metadata(Structure):
    _fields_ = [(name, c_uint32) for name in ("texel_width_nm", "texel_height_nm", "frame", "image_origin", "primaries")] + [
        (name, Text) for name in ("name", "origin", "licence")
    ]


class Direction(Structure):
    _fields_ = [(name, c_int32) for name in ("x_q18", "y_q18", "z_q15")]


class Rgb(Structure):
    _fields_ = [(name, c_uint32) for name in ("r", "g", "b")]


class Failure(Exception):
    """A status that is not zero."""

    def __init__(self, status, text):
        super().__init__(text)
        self.code = status if status < NULL_POINTER else BAD_USAGE


class Library:
    """The functions that are used here. Sizes that Python would guess wrong are spelled out."""

    FUNCTIONS = {
        "selvedge_abi_version": (c_uint32, []),
        "selvedge_material_size": (c_size_t, []),
        "selvedge_status_text": (c_char_p, [c_int32]),
        "selvedge_rule_id": (c_char_p, [c_uint32]),
        "selvedge_rule_title": (c_char_p, [c_uint32]),
        "selvedge_open": (c_int32, [c_char_p, c_size_t, c_char_p, c_size_t, c_void_p, POINTER(Material), POINTER(Finding)]),
        "selvedge_read_header": (c_int32, [POINTER(Material), POINTER(Header)]),
        "selvedge_read_metadata": (c_int32, [POINTER(Material), POINTER(Metadata)]),
        "selvedge_direction_from_vector": (c_int32, [POINTER(c_float), POINTER(Direction)]),
        "selvedge_sample_point": (c_int32, [POINTER(Material)] + [c_uint32] * 4 + [POINTER(Rgb)]),
        "selvedge_sample_filtered": (c_int32, [POINTER(Material), c_uint32, c_uint32, POINTER(Direction), POINTER(Direction), POINTER(Rgb)]),
        "selvedge_sample_trilinear": (
            c_int32,
            [POINTER(Material), c_uint32, c_uint32, c_uint32, POINTER(Direction), POINTER(Direction), POINTER(Rgb)],
        ),
        "selvedge_decode_digest": (c_int32, [POINTER(Material), POINTER(c_uint8)]),
    }

    def __init__(self, path):
        self.dll = ctypes.CDLL(path)
        for name, (result, arguments) in self.FUNCTIONS.items():
            function = getattr(self.dll, name)
            function.restype, function.argtypes = result, arguments
        if self.dll.selvedge_abi_version() != ABI_VERSION or self.dll.selvedge_material_size() != ctypes.sizeof(Material):
            raise Failure(BAD_USAGE, "the library has another interface")

    def call(self, name, *arguments):
        status = getattr(self.dll, name)(*arguments)
        if status != 0:
            raise Failure(status, self.dll.selvedge_status_text(status).decode("ascii"))


class Opened:
    """An open material. It keeps the bytes that the library refers to."""

    def __init__(self, library, path, data, dictionary=None):
        self.library, self.data, self.dictionary = library, data, dictionary
        self.material = Material()
        finding = Finding()
        length = len(dictionary) if dictionary is not None else 0
        status = library.dll.selvedge_open(data, len(data), dictionary, length, None, byref(self.material), byref(finding))
        if 0 < status < NULL_POINTER:
            rule = library.dll.selvedge_rule_id(finding.rule).decode("ascii")
            title = library.dll.selvedge_rule_title(finding.rule).decode("ascii")
            part = "dictionary: " if finding.part == 1 else ""
            raise Failure(status, f"{path}: {part}{rule} at byte {finding.offset}: {title}; found {finding.found} ({finding.found:#x})")
        if status != 0:
            raise Failure(status, library.dll.selvedge_status_text(status).decode("ascii"))

    def get(self, function, result, *arguments):
        self.library.call(function, byref(self.material), *arguments, byref(result))
        return result


def show(library, material):
    header = material.get("selvedge_read_header", Header())
    print(f"name: {material.get('selvedge_read_metadata', Metadata()).name}")
    print(f"texels: {header.width} x {header.height}")
    print(f"directions: {header.light_count} light, {header.view_count} view")

    def direction(vector):
        result = Direction()
        library.call("selvedge_direction_from_vector", (c_float * 3)(*vector), byref(result))
        return result

    def tell(label, function, *arguments):
        rgb = material.get(function, Rgb(), *arguments)
        print(f"{label}: {rgb.r:08x} {rgb.g:08x} {rgb.b:08x}")

    lights = [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-0.28, 0.96, 0.0)]
    views = [(0.0, 0.6, 0.8), (0.0, 0.0, 1.0), (-0.48, -0.36, 0.8)]
    for n, (light, view) in enumerate(zip(map(direction, lights), map(direction, views))):
        u_q32 = (0x12345678 + n * 0x50000000) & 0xFFFFFFFF
        v_q32 = (0x0FEDCBA9 + n * 0x70000000) & 0xFFFFFFFF
        tell("point", "selvedge_sample_point", n * 7, n * 11, n * 13, n * 17)
        tell("filtered", "selvedge_sample_filtered", u_q32, v_q32, byref(light), byref(view))
        tell("trilinear", "selvedge_sample_trilinear", n * 0x8000, u_q32, v_q32, byref(light), byref(view))
    digest = (c_uint8 * 32)()
    library.call("selvedge_decode_digest", byref(material.material), digest)
    print("digest: " + bytes(digest).hex())


def main(arguments):
    if len(arguments) not in (2, 3):
        print("usage: sample.py LIBRARY FILE [DICTIONARY]", file=sys.stderr)
        return BAD_USAGE
    try:
        library = Library(arguments[0])
        files = []
        for path in arguments[1:]:
            with open(path, "rb") as stream:
                files.append(stream.read())
        show(library, Opened(library, arguments[1], *files))
    except Failure as failure:
        print(failure, file=sys.stderr)
        return failure.code
    except OSError as error:
        print(error, file=sys.stderr)
        return BAD_IO
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
