"""Shape abstraction of mesh collections: positive cuboids cropped by negative ones."""

__version__ = "0.1.0"
