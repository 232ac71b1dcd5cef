"""The commands of the naive decoder."""

import os
import struct
import sys

from chapters.conventions import MASK, as_i32, wraps
from chapters.cost import Limits
from chapters.directions import direction_of_binary32
from chapters.file import DICTIONARY
from chapters.material import Material
from chapters.opening import check, open_file
from chapters.position import fraction_of_binary32
from methods.sparse_tensor import FIBRES, LIGHT_ATOMS, LISTS


def read_bytes(path):
    with open(path, "rb") as handle:
        return handle.read()


def options_of(arguments):
    """Splits `--name value` from the rest."""
    plain, options = [], {}
    at = 0
    while at < len(arguments):
        if arguments[at].startswith("--"):
            if at + 1 == len(arguments):
                raise ValueError("%s needs a value" % arguments[at])
            options[arguments[at][2:]] = arguments[at + 1]
            at += 2
        else:
            plain.append(arguments[at])
            at += 1
    return plain, options


def limits_of(options):
    numbers = [options.get(name) for name in ("max-bytes", "max-operations", "max-texels")]
    return Limits(*[None if number is None else int(number, 0) for number in numbers])


def material_of(path, options):
    dictionary = read_bytes(options["dictionary"]) if "dictionary" in options else None
    layers = int(options["layers"]) if "layers" in options else None
    return Material(read_bytes(path), dictionary, layer_limit=layers)


def answer(material, line):
    """One line of `samples`."""
    word, *rest = line.split()
    n = [int(number) for number in rest]
    # 11.1: how many unsigned words, then how many signed ones
    shapes = dict(
        point=(4, 0), texel=(2, 6), filtered=(3, 6), trilinear=(3, 6),
        light=(0, 3), view=(0, 3), direction=(3, 0), fraction=(1, 0), layers=(1, 0),
    )
    unsigned, signed = shapes.get(word, (0, 0))
    if len(n) != unsigned + signed or word not in shapes:
        return "error"
    if any(not 0 <= x <= MASK for x in n[:unsigned]) or any(x != as_i32(x & MASK) for x in n[unsigned:]):
        return "error"
    if word in ("light", "view"):
        directions = material.file.light_set if word == "light" else material.file.view_set
        taps = directions.locate(n).taps
        return " ".join(str(value) for value in (*taps.rows, *taps.weights, taps.cosine_q15))
    if word == "direction":
        return "%d %d %d" % direction_of_binary32(*n)
    if word == "fraction":
        return "%08x" % fraction_of_binary32(n[0])
    if word == "layers":
        material.limit_layers(n[0])
        return "layers %d" % material.layer_limit
    if word == "point":
        result = material.point(*n)
    elif word == "texel":
        result = material.texel(n[0], n[1], n[2:5], n[5:8])
    elif word == "filtered":
        result = material.filtered(n[1], n[2], n[3:6], n[6:9], level=n[0])
    else:
        result = material.trilinear(n[1], n[2], n[0], n[3:6], n[6:9])
    return "%08x %08x %08x" % tuple(result)


def command_samples(path, options):
    material = material_of(path, options)
    for line in sys.stdin:
        if not line.strip() or line.startswith("#"):
            continue
        try:
            print(answer(material, line), flush=True)
        except ValueError:
            print("error", flush=True)
    return 0


def command_check(path, options):
    dictionary = read_bytes(options["dictionary"]) if "dictionary" in options else None
    finding = check(read_bytes(path), dictionary, limits_of(options))
    if finding is None:
        return 0
    print("\t".join(str(part) for part in finding))
    return 3


def vector(folder, fields):
    """One line of a manifest: what was got where it differs, else None."""
    kind, name, dictionary_name = fields[0:3]
    data = read_bytes(os.path.join(folder, name))
    dictionary = None if dictionary_name == "-" else read_bytes(os.path.join(folder, dictionary_name))
    if kind == "valid":
        finding = check(data, dictionary)
        if finding is not None:
            return "broken by " + " ".join(str(part) for part in finding)
        if fields[3] == "-":
            return None
        digest = Material(data, dictionary).digest()
        return None if digest == fields[3] else "digest " + digest
    # a limit of 0 in a manifest is none
    numbers = [None] * 3 if fields[3] == "-" else [int(n, 0) or None for n in fields[3].split(",")]
    finding = check(data, dictionary, Limits(*numbers))
    wanted = (fields[4], fields[5], int(fields[6], 0), int(fields[7], 0))
    if finding == wanted:
        return None
    got = "nothing" if finding is None else " ".join(str(part) for part in finding)
    return "%s, wanted %s" % (got, " ".join(str(part) for part in wanted))


def command_vectors(folder):
    counts = {"valid": [0, 0], "invalid": [0, 0]}
    rules = set()
    with open(os.path.join(folder, "manifest.tsv"), encoding="utf-8") as manifest:
        for line in manifest:
            line = line.rstrip("\n")
            if not line.strip() or line.startswith("#"):
                continue
            fields = line.split("\t")
            counts[fields[0]][0] += 1
            if fields[0] == "invalid":
                rules.add(fields[4])
            try:
                difference = vector(folder, fields)
            except Exception as error:  # a fault of this program must not end the run
                difference = "fault: %r" % (error,)
            if difference is not None:
                counts[fields[0]][1] += 1
                print("%s\t%s\t%s" % (fields[0], fields[1], difference), flush=True)
    (valid, valid_wrong), (invalid, invalid_wrong) = counts["valid"], counts["invalid"]
    print(
        "%d valid, %d of them differ; %d invalid for %d rules, %d of them differ; %d values left their word"
        % (valid, valid_wrong, invalid, len(rules), invalid_wrong, wraps[0])
    )
    return 1 if valid_wrong or invalid_wrong else 0


def texts_of(text_path):
    """A text, and the chapters of the methods that lie in `methods/` beside it."""
    folder = os.path.join(os.path.dirname(text_path), "methods")
    names = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    return [text_path] + [os.path.join(folder, name) for name in names if name.endswith(".md")]


def bytes_of_fences(text_path, fence):
    """The hex dumps of the texts behind a fence by their offsets, or None if two do not agree."""
    found = {}
    inside = False
    for path in texts_of(text_path):
        for line in read_bytes(path).decode("utf-8").split("\n"):
            if line.startswith("```"):
                inside = line.strip() == fence
                continue
            if not inside:
                continue
            offset, *numbers = line.split()
            for n, number in enumerate(numbers):
                at = int(offset, 16) + n
                if found.setdefault(at, int(number, 16)) != int(number, 16):
                    print("two values for byte %#x" % at)
                    return None
    return found


def command_example(text_path, out_path):
    """Collects the hex dumps of the text, which overlap and must agree."""
    found = bytes_of_fences(text_path, "```hex")
    if found is None:
        return 1
    length = struct.unpack("<I", bytes(found[at] for at in range(12, 16)))[0]
    missing = [at for at in range(length) if at not in found]
    shown = (len(found), len(missing), [hex(at) for at in missing])
    print("%d bytes from the text, %d not shown: %s" % shown)
    with open(out_path, "wb") as out:
        out.write(bytes(found.get(at, 0) for at in range(length)))
    return 0


def command_tensor_example(text_path, path):
    """Chapter 12 shows three sections of the tensor example; the rest is only in the file."""
    found = bytes_of_fences(text_path, "```hex tensor")
    if found is None:
        return 1
    data = read_bytes(path)
    wrong = [at for at in sorted(found) if at >= len(data) or data[at] != found[at]]
    file = open_file(data)
    shown = set()
    for section in [file.section(kind) for kind in (LIGHT_ATOMS, FIBRES, LISTS)]:
        shown.update(range(section.offset, section.offset + section.length))
    print(
        "%d bytes from the text, %d differ: %s; of the three sections %d are not shown"
        % (len(found), len(wrong), [hex(at) for at in wrong], len(shown - set(found)))
    )
    return 1 if wrong or shown - set(found) else 0


def command_serve():
    """Answers the queries of a conformance runner: see ../vectors/README.md."""
    while True:
        line = sys.stdin.buffer.readline()
        if not line:
            return 0
        _, length, dictionary_length, *numbers = line.decode().split()
        data = sys.stdin.buffer.read(int(length))
        dictionary = None if dictionary_length == "-" else sys.stdin.buffer.read(int(dictionary_length))
        finding = check(data, dictionary, Limits(*(int(n) for n in numbers)))
        if finding is not None:
            print("broken", *finding, flush=True)
        elif len(data) >= 20 and data[16] == DICTIONARY:
            print("legal", flush=True)
        else:
            print("digest", Material(data, dictionary).digest(), flush=True)
