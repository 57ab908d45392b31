"""A model's own random numbers, and choices that come round evenly over a category.

Everything follows from a digest of (seed, category, index): a model is the same
whichever others are made, in whatever order, and a longer collection contains the
shorter one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def _digest(*key: object) -> bytes:
    return hashlib.sha256("/".join(str(part) for part in key).encode()).digest()


def _generator(*key: object) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(int.from_bytes(_digest(*key)[:16], "little")))


def model_id(seed: int, category: str, index: int) -> str:
    """Name of a sample model: 32 hexadecimal characters, spread evenly whatever the index."""
    return _digest("pnabs-sample", seed, category, index).hex()[:32]


class Draw:
    """The choices of one model.

    Parameters
    ----------
    seed, category, index
        Which collection, which category of it, and which model of the category.

    Attributes
    ----------
    rng : numpy.random.Generator
        The model's own numbers.
    """

    def __init__(self, seed: int, category: str, index: int) -> None:
        self.seed, self.category, self.index = seed, category, index
        self.rng = _generator("model", seed, category, index)
        self._turn = 0

    def cycle(self, factor: str, options: Sequence[T]) -> T:
        """An option that comes round evenly: n models in a row hold each of n options once.

        The order is shuffled anew every round and for every `factor`, so that
        different factors meet in ever new combinations.
        """
        turn, place = divmod(self.index, len(options))
        order = _generator("cycle", self.seed, self.category, factor, turn).permutation(
            len(options)
        )
        return options[int(order[place])]

    def kind(self, options: Sequence[T]) -> T:
        """What sort of model this is, as `cycle`; `variant` then goes by the round."""
        self._turn = self.index // len(options)
        return self.cycle("kind", options)

    def variant(self, factor: str, options: Sequence[T]) -> T:
        """An option that differs each time the category's kinds have come round once."""
        order = _generator("variant", self.seed, self.category, factor).permutation(len(options))
        return options[int(order[self._turn % len(options)])]

    def between(self, low: float, high: float) -> float:
        """A number from [low, high)."""
        return low + (high - low) * float(self.rng.random())

    def whole(self, low: int, high: int) -> int:
        """A whole number from low to high, both included."""
        return low + int(self.rng.random() * (high - low + 1))

    def chance(self, share: float) -> bool:
        """True for this share of the calls."""
        return float(self.rng.random()) < share

    def pick(self, options: Sequence[T]) -> T:
        """One of the options, each as likely."""
        return options[self.whole(0, len(options) - 1)]
