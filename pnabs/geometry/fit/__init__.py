"""The per-shape fit: a few boxes, added and taken away, that agree with a solid cell by cell."""
