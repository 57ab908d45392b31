"""The recipe of each stage, and the run that strings them together."""
