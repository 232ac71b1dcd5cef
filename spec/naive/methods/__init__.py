"""The methods: a module each, which follows the chapter of the method, and a line each in NAMES.

A module of a method has
  NAME, NUMBER        as in 3.1
  LARGEST_EDGE        3.1-12
  SECTIONS            the table of sections of its chapter, a `Row` for each of its rows
  check_material(file, dictionary)
                      its order of checks of a material (1.4, step 13); gives its part of the cost (4.2-1)
  check_dictionary(file)
                      its order of checks of a dictionary (1.4, step 14)
  dictionary_fits(file, other)
                      what it asks of the dictionary `other` of a material, beyond what 3.5-5 asks of all
  textures(file, layer_limit, place, light, view)
                      the textures of the three channels at a `Place`, for two `Located` directions
  examples()          the numeric examples of its chapter that need no file
"""

from importlib import import_module

# in the order of their numbers
NAMES = (
    "sparse_ensemble",
    "sparse_tensor",
)

METHODS = {}
for module in (import_module("methods." + name) for name in NAMES):
    if module.NUMBER in METHODS:
        raise ImportError("%s and %s have one number" % (METHODS[module.NUMBER].NAME, module.NAME))
    METHODS[module.NUMBER] = module


def method_of(file):
    """The module of the method of a file. What is not in the list is refused by its number (3.1-8)."""
    if file.method not in METHODS:
        known = ", ".join("%d %s" % (method.NUMBER, method.NAME) for method in METHODS.values())
        raise LookupError("method %d is not known; known are %s" % (file.method, known))
    return METHODS[file.method]
