"""Chapter 9: levels. The samples between levels are in `material`."""


def level_size(size, level):
    """9.1-1."""
    return (size + (1 << level) - 1) >> level
