"""Importing this module makes ready what finishing an abstraction loads and compiles.

As `warm_ingest`, for the children of the abstract stage.
"""

from pnabs.geometry.metrics import warm_up

warm_up()
