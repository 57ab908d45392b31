"""Meshes and cuboids as arrays: no Ray, no run folder, no torch."""
