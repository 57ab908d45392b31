"""Building: add boxes where they earn most, improve all, take the least away, and again.

Greedy on the exact number of cells set right and wrong, so no step is in vain and nothing
depends on a temperature.  A box has a price; what earns less goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pnabs.geometry.fit.assembly import Assembly, Box, Target
from pnabs.geometry.fit.seeds import proposal


@dataclass(frozen=True, slots=True)
class Effort:
    """How hard to try.

    Attributes
    ----------
    extra : int
        Boxes beyond the budget that are added before the least are taken away.
    tries : int
        Seeds for each addition.
    rounds, patience : int
        Times that the least boxes are exchanged for others, and how many of these may come to
        nothing in a row.
    """

    extra: int = 4
    tries: int = 2
    rounds: int = 4
    patience: int = 3


@dataclass(frozen=True, slots=True)
class Terms:
    """What is asked for.

    Attributes
    ----------
    budget : int
        Boxes at most, negatives included.
    price : float
        IoU that a box must add, or the like in `cover`.
    cover : float
        What covering all of the outer surface counts beside IoU.
    positives, negatives : int, optional
        At most so many of them; as many as the budget allows when left out.
    """

    budget: int
    price: float
    cover: float = 0.0
    positives: int | None = None
    negatives: int | None = None

    @property
    def tilt(self) -> float:
        """IoU that turning a box away from the grid's axes must add."""
        return self.price / 4

    def most(self, sign: int) -> int:
        """Boxes at most of one sign."""
        most = self.positives if sign > 0 else self.negatives
        return self.budget if most is None else min(most, self.budget)


@dataclass(frozen=True, slots=True)
class Start:
    """What to begin with.

    Attributes
    ----------
    boxes : list of Box
    rate : float
        The first rate (`pnabs.geometry.fit.search.worth`).  With 1, a box stays in the shape,
        and the shape is put together of positives; with less, it may reach beyond, and negatives
        carve the shape out of it.
    """

    boxes: list[Box]
    rate: float


def build(
    target: Target,
    starts: Sequence[Start],
    terms: Terms,
    effort: Effort,
    rng: np.random.Generator,
) -> Assembly:
    """Boxes for a target.

    Parameters
    ----------
    target : Target
    starts : sequence of Start
        The best of what comes of them is kept.
    terms : Terms
    effort : Effort
    rng : numpy.random.Generator

    Returns
    -------
    Assembly
    """
    begun = [_begun(target, start, terms, effort, rng) for start in starts]
    return max(begun, key=lambda assembly: merit(assembly, terms))


def _begun(
    target: Target, start: Start, terms: Terms, effort: Effort, rng: np.random.Generator
) -> Assembly:
    """More boxes than there may be, improved together, and the least taken away."""
    assembly, rate = Assembly(target, start.boxes), start.rate
    tilt = terms.tilt * assembly.total
    assembly.refine(rate, 4.0, 0.5, tilt)
    prune(assembly, terms, rate, terms.budget)
    grow(assembly, terms, effort, rate, terms.budget + effort.extra, rng)
    for _ in range(2):
        assembly.refine(rate, 2.0, 0.5, tilt)
        rate = assembly.iou()
    while assembly.size > terms.budget:
        prune(assembly, terms, rate, max(terms.budget, assembly.size - 4))
        assembly.refine(rate, 2.0, 0.5, tilt)
    prune(assembly, terms, rate, terms.budget)
    for _ in range(2):
        assembly.refine(rate, 1.0, 0.25, tilt)
        rate = assembly.iou()
    return assembly


def polish(assembly: Assembly, terms: Terms, effort: Effort, rng: np.random.Generator) -> Assembly:
    """Boxes of a coarser grid fitted to a finer one, and some of the least exchanged for others.

    Coarse cells make thin parts thick, so how many boxes these are worth, and which, shows here.
    """
    tilt = terms.tilt * assembly.total
    for step in (3.0, 1.5, 1.0):
        assembly.refine(assembly.iou(), step, 0.5, tilt)
    prune(assembly, terms, assembly.iou(), terms.budget)
    vain = 0
    for attempt in range(effort.rounds):
        rate = assembly.iou()
        trial = assembly.copy()
        prune(trial, terms, rate, max(0, trial.size - 2 * (attempt % 3)))
        trial.refine(rate, 2.0, 1.0, tilt)
        grow(trial, terms, effort, rate, terms.budget, rng)
        trial.refine(rate, 4.0, 1.0, tilt)
        trial.refine(rate, 1.0, 0.5, tilt)
        prune(trial, terms, rate, terms.budget)
        vain += 1
        if merit(trial, terms) > merit(assembly, terms):
            assembly, vain = trial, 0
        if vain == effort.patience:
            break
    assembly.refine(assembly.iou(), 1.0, 0.25, tilt)
    return assembly


def merit(assembly: Assembly, terms: Terms) -> float:
    """IoU, and what covers the surface, less the price of the boxes."""
    return assembly.merit() - terms.price * assembly.size


def grow(
    assembly: Assembly,
    terms: Terms,
    effort: Effort,
    rate: float,
    size: int,
    rng: np.random.Generator,
) -> None:
    """Add the box that earns most, until there are `size` or none earns half its price."""
    fee, tilt = terms.price * assembly.total / 2, terms.tilt * assembly.total
    spare = size - terms.budget
    while assembly.size < size:
        found = []
        for sign in (1, -1):
            most = terms.most(sign)
            room = min(size - assembly.size, most + spare - assembly.size_of(sign))
            if most and room > 0 and (sign > 0 or len(assembly)):
                found.append(proposal(assembly, sign, rate, fee, tilt, room, effort.tries, rng))
        best = max((one for one in found if one), key=lambda one: one[1], default=None)
        if best is None:
            return
        assembly.add(best[0])


def prune(assembly: Assembly, terms: Terms, rate: float, size: int) -> None:
    """Take away the box that earns least, while there are too many or it isn't worth its price."""
    fee = terms.price * assembly.total
    while len(assembly):
        spare = max(size - terms.budget, 0)
        over = [s for s in (1, -1) if assembly.size_of(s) > terms.most(s) + spare]
        gains = [
            assembly.gain(index, rate) / assembly.cost(box)
            if not over or box.sign in over
            else np.inf
            for index, box in enumerate(assembly.boxes)
        ]
        least = int(np.argmin(gains))
        if not over and assembly.size <= size and gains[least] >= max(fee, 1):
            return
        assembly.remove(least)
