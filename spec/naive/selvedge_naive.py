#!/usr/bin/env python3
"""A second decoder and checker of Selvedge, format version 1.

Written from the text of the specification alone, to be compared with the
decoder bit for bit. It is slow and plain on purpose: a module of `chapters/`
follows each chapter of the text, uses its names, and every function names its
rules. Only the standard library is used. This file is the command line.

Commands
  check FILE [--dictionary F] [--max-bytes N] [--max-operations N] [--max-texels N]
      prints the first broken rule as "rule part offset found", tab separated,
      or nothing; exit code 0 or 3.
  digest FILE [--dictionary F] [--layers N]
      prints the decode digest of 11.2.
  vectors DIR
      compares everything in DIR/manifest.tsv; a line for each disagreement,
      then a summary; exit code 1 if anything disagrees.
  samples FILE [--dictionary F] [--layers N]
      reads queries from standard input, prints one line of results for each.
  example TEXT OUT
      collects the bytes of the worked example from the text, and from the chapters
      of the methods in `methods/` beside it, and writes them.
  tensor-example TEXT FILE
      compares the bytes of the tensor example that chapter 12 shows with those of FILE.
  selftest
      computes the numeric examples of the text that need no file.

Protocol of `samples`: a line has a word and decimal integers, separated by
spaces; a query's direction is x_q18 y_q18 z_q15. Empty lines and lines that
begin with # are skipped. The answer has one line for each line asked.

  point x y light view
  texel x y  light_x light_y light_z  view_x view_y view_z
  filtered level u_q32 v_q32  light_x light_y light_z  view_x view_y view_z
  trilinear level_q16 u_q32 v_q32  light_x light_y light_z  view_x view_y view_z
      -> red green blue, each as eight hexadecimal digits
  light x_q18 y_q18 z_q15
  view x_q18 y_q18 z_q15
      -> the taps: a b c weight_a weight_b weight_c cosine, in decimal
  direction x_bits y_bits z_bits        (binary32 patterns, 5.2)
      -> x_q18 y_q18 z_q15, in decimal
  fraction bits                         (binary32 pattern, 6.1-2)
      -> the fraction as eight hexadecimal digits
  layers n
      -> "layers n"; from here on layer_limit is n, moved into its range (10.8-2)

A line that is not understood is answered with "error".
"""

import sys

from chapters.conventions import Finding
from chapters.cost import Limits
from chapters.material import Material
from chapters.opening import check
from commands import (
    command_check,
    command_example,
    command_samples,
    command_serve,
    command_tensor_example,
    command_vectors,
    material_of,
    options_of,
)
from selftest import command_selftest

# What a program that imports this module uses.
__all__ = ["Finding", "Limits", "Material", "check", "main"]


def main(arguments):
    try:
        plain, options = options_of(arguments)
        if plain[0:1] == ["check"] and len(plain) == 2:
            return command_check(plain[1], options)
        if plain[0:1] == ["digest"] and len(plain) == 2:
            print(material_of(plain[1], options).digest())
            return 0
        if plain[0:1] == ["vectors"] and len(plain) == 2:
            return command_vectors(plain[1])
        if plain[0:1] == ["samples"] and len(plain) == 2:
            return command_samples(plain[1], options)
        if plain[0:1] == ["example"] and len(plain) == 3:
            return command_example(plain[1], plain[2])
        if plain[0:1] == ["tensor-example"] and len(plain) == 3:
            return command_tensor_example(plain[1], plain[2])
        if plain == ["serve"]:
            return command_serve()
        if plain == ["selftest"]:
            return command_selftest()
    except Finding as finding:
        print("\t".join(str(part) for part in finding.row()), file=sys.stderr)
        return 3
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
