"""Means by category, their averages, and bootstrap intervals of many quantities at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.types import Float64

from .tables import MIN_MODELS, Column, Interval, Role, Row, tidy

_DRAWS = 4_000_000
"""Random numbers at a time; bounds the memory."""


@dataclass(frozen=True, slots=True)
class Figures:
    """Of one quantity: means by category, their average, and the mean over all models.

    Attributes
    ----------
    means : mapping of category to mean
        Without categories of which no model has a figure.
    models : mapping of category to the number of models that have one
    summary, interval
        Average over the categories with at least `MIN_MODELS` such models, and its 95 % interval.
    overall, overall_interval
        The same over all models, the interval where there are so many.
    """

    means: Mapping[str, float]
    models: Mapping[str, int]
    summary: float | None
    interval: Interval | None
    overall: float | None
    overall_interval: Interval | None

    def row(self, label: str, variant: str, role: Role, columns: Sequence[Column]) -> Row:
        """A table's row of it."""
        return Row(
            label,
            variant,
            role,
            tuple(tidy(self.means.get(column.category, np.nan)) for column in columns),
            tuple(self.models.get(column.category, 0) for column in columns),
            self.summary,
            self.interval,
            self.overall,
            self.overall_interval,
        )


def figures(
    values: Float64, category: NDArray[np.str_], resamples: int, rng: np.random.Generator
) -> list[Figures]:
    """The figures of m quantities of n models.

    Parameters
    ----------
    values : (n, m) float64
        nan where a model has no figure.
    category : (n,) str
    resamples : int
    rng : numpy.random.Generator
        A model is drawn with all of its quantities: for averages within each category, for the mean
        over all models among all.
    """
    quantities = values.shape[1]
    means: list[dict[str, float]] = [{} for _ in range(quantities)]
    models: list[dict[str, int]] = [{} for _ in range(quantities)]
    drawn = np.zeros((resamples, quantities))
    averaged: list[list[float]] = [[] for _ in range(quantities)]
    for name in np.unique(category).tolist():
        own = values[category == name]
        number = np.isfinite(own).sum(axis=0)
        large = np.flatnonzero(number >= MIN_MODELS)
        for i in np.flatnonzero(number).tolist():
            means[i][name] = float(np.nanmean(own[:, i]))
            models[i][name] = int(number[i])
            if number[i] >= MIN_MODELS:
                averaged[i].append(means[i][name])
        if len(large):
            drawn[:, large] += bootstrap_means(own[:, large], resamples, rng)
    drawn /= np.maximum([len(own) for own in averaged], 1)
    number = np.isfinite(values).sum(axis=0)
    enough = np.flatnonzero(number >= MIN_MODELS)
    whole = np.full((resamples, quantities), np.nan)
    if len(enough):
        whole[:, enough] = bootstrap_means(values[:, enough], resamples, rng)
    return [
        Figures(
            means[i],
            models[i],
            tidy(float(np.mean(averaged[i]))) if averaged[i] else None,
            _interval(drawn[:, i]) if averaged[i] else None,
            tidy(float(np.nanmean(values[:, i]))) if number[i] else None,
            _interval(whole[:, i]) if number[i] >= MIN_MODELS else None,
        )
        for i in range(quantities)
    ]


def bootstrap_means(values: Float64, resamples: int, rng: np.random.Generator) -> Float64:
    """Means of resampled models.

    Parameters
    ----------
    values : (n, m) float64
        m quantities of n models; a model is drawn with all of its quantities.  One that has no
        figure, nan, takes no part in the mean.
    resamples : int
    rng : numpy.random.Generator

    Returns
    -------
    (resamples, m) float64
        nan where no drawn model has a figure.
    """
    n = len(values)
    means = np.empty((resamples, values.shape[1]))
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    # Many quantities have the same models.
    counted, which = np.unique(known.astype(np.float64), axis=1, return_inverse=True)
    step = max(1, _DRAWS // max(1, n))
    for start in range(0, resamples, step):
        stop = min(start + step, resamples)
        drawn = rng.integers(n, size=(stop - start, n)) + n * np.arange(stop - start)[:, None]
        # How often each model was drawn, so that all quantities' means are one product.
        times = np.bincount(drawn.ravel(), minlength=drawn.size).reshape(drawn.shape)
        weights = times.astype(np.float64)
        number = (weights @ counted)[:, which.reshape(-1)]
        means[start:stop] = np.where(number > 0, weights @ filled, np.nan) / np.maximum(number, 1)
    return means


def _interval(draws: Float64) -> Interval:
    """The middle 95 % of drawn means."""
    low, high = np.nanpercentile(draws, [2.5, 97.5])
    return round(float(low), 6) + 0.0, round(float(high), 6) + 0.0
