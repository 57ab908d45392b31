"""Importing this module makes ready what finishing an abstraction loads and compiles.

As `warm_ingest`, for the children of the abstract stage.
"""

from pnabs.geometry import metrics
from pnabs.geometry.fit import fit

metrics.warm_up()
fit.warm_up()
