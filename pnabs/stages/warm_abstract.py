"""Importing this module makes ready what finishing an abstraction loads and compiles.

As `warm_ingest`, for the children of the abstract stage.
"""

from pnabs.geometry import measure
from pnabs.geometry.fit import fit

measure.warm_up()
fit.warm_up()
