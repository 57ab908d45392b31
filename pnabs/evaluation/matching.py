"""Which result belongs to which shape: by id, whatever folders and file names there are around it.

A result's *path* is what it is known by, as components: of `chair/ab12/part0.obj` chair, ab12,
part0.  How many components at its end are not the id's (a file's own name, `models`) is one
number for a whole set of results: the one with which most shapes have exactly one result.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

from pnabs.dataset.synsets import synset_of
from pnabs.stages.errors import UsageError

MOST_TRAILING = 3
"""`<id>/models/model_normalized.obj` has two."""

TOLD = 3
"""Names that a message tells."""


@dataclass(frozen=True, slots=True)
class Key:
    """What a result is known by.

    Attributes
    ----------
    path
        Components, the outermost first; not empty.
    label
        How messages name it.
    trailing
        Components at the end that are certainly no id's.
    above
        Name of the folder that the path begins in.
    """

    path: tuple[str, ...]
    label: str
    trailing: int = 0
    above: str = ""

    def without(self, trailing: int) -> tuple[str, ...]:
        """The path without so many components more at its end."""
        left = len(self.path) - self.trailing - trailing
        if left == 0 and self.above:
            return (self.above,)
        return self.path[: max(left, 0)]

    @property
    def folder(self) -> tuple[str, ...]:
        """All but the last component."""
        return self.path[:-1]


@dataclass(frozen=True, slots=True)
class Matched:
    """Which results belong where.

    Attributes
    ----------
    of_shape
        Number of a shape -> numbers of its results; several are its parts.
    without
        Numbers of the results that belong to no shape.
    """

    of_shape: dict[int, list[int]]
    without: list[int]


class ShapeIndex:
    """Shapes by id.

    Parameters
    ----------
    shapes
        Category (may be empty) and id of each.
    others
        The same of shapes that results may be of, but that aren't asked for.
    """

    def __init__(
        self, shapes: Sequence[tuple[str, str]], others: Sequence[tuple[str, str]] = ()
    ) -> None:
        self.wanted = len(shapes)
        """Shapes with lower numbers are asked for."""
        self.names: list[str] = []
        self._full: list[tuple[str, ...]] = []
        self._own: list[int] = []
        self._by_last: dict[str, list[int]] = defaultdict(list)
        every = [(category, tuple(name.split("/"))) for category, name in (*shapes, *others)]
        common = _common_ending([parts for category, parts in every if not category])
        for number, (category, parts) in enumerate(every):
            self.names.append("/".join((category, *parts) if category else parts))
            own = parts if category else parts[: len(parts) - common]
            self._full.append((_category(category), *own) if category else own)
            self._own.append(len(own))
            self._by_last[own[-1]].append(number)

    def __len__(self) -> int:
        return len(self.names)

    def find(self, path: Sequence[str]) -> list[int]:
        """Shapes that a path may mean, as well as any: none, one, or several that it can't tell.

        It means a shape if it ends in the shape's id, or the shape's category and id end in it.
        """
        best, found = 0, list[int]()
        for number in self._by_last.get(path[-1], ()) if path else ():
            length = self._common(path, number)
            if length < min(len(path), self._own[number]):
                continue
            if length > best:
                best, found = length, []
            if length == best:
                found.append(number)
        wanted = [number for number in found if number < self.wanted]
        return wanted if len(wanted) == 1 else found

    def _common(self, path: Sequence[str], number: int) -> int:
        """How many components, from the end, a path has in common with a shape's."""
        full, own = self._full[number], self._own[number]
        length = 0
        for one, other in zip(reversed(path), reversed(full), strict=False):
            if one != other and (length < own or _category(one) != other):
                break
            length += 1
        return length


def _common_ending(ids: Sequence[tuple[str, ...]]) -> int:
    """Components that all ids end in, as of `a/model` and `b/model`: they tell nothing apart."""
    if len(ids) < 2:
        return 0
    count = 0
    while len({parts[len(parts) - 1 - count :][:1] for parts in ids}) == 1:
        count += 1
        if min(len(parts) for parts in ids) == count:
            return 0
    return count


def _category(name: str) -> str:
    return synset_of(name) or name


@dataclass(slots=True)
class _Attempt:
    """What comes of one number of trailing components."""

    groups: dict[int, dict[tuple[str, ...], list[int]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )
    without: list[int] = field(default_factory=list)
    unclear: dict[int, list[int]] = field(default_factory=dict)

    @property
    def matched(self) -> int:
        """Shapes with exactly one result, asked for or not."""
        return sum(len(groups) == 1 for groups in self.groups.values())


def match(index: ShapeIndex, keys: Sequence[Key], name: str) -> Matched:
    """Find the shape of each result.

    Parameters
    ----------
    index
    keys
        One a result.  Results of one folder that belong to one shape are its parts.
    name
        Of the set of results, for messages.

    Raises
    ------
    UsageError
        When no result has the id of a shape, one could belong to several, or a shape has several.
    """
    attempts = [_attempt(index, keys, trailing) for trailing in range(MOST_TRAILING + 1)]
    best = max(attempts, key=lambda attempt: attempt.matched)
    if not best.matched:
        best = next((one for one in attempts if one.unclear or one.groups), best)
    _refuse_unclear(index, keys, name, best)
    if not best.matched:
        mine = ", ".join(plain(key.label) for key in keys[:TOLD])
        theirs = ", ".join(plain(one) for one in index.names[:TOLD])
        raise UsageError(
            f"none of the {len(keys)} results of {name!r} has the id of a shape: results are named "
            f"such as {mine}; shapes such as {theirs}"
        )
    of_shape = {
        number: next(iter(groups.values()))
        for number, groups in best.groups.items()
        if number < index.wanted
    }
    return Matched(of_shape, best.without)


def _attempt(index: ShapeIndex, keys: Sequence[Key], trailing: int) -> _Attempt:
    attempt = _Attempt()
    for number, key in enumerate(keys):
        shapes = index.find(key.without(trailing))
        if len(shapes) == 1:
            # A file named by the id stands alone, others beside it in its folder with it.
            group = key.folder if trailing else key.path
            attempt.groups[shapes[0]][group].append(number)
        elif shapes:
            attempt.unclear[number] = shapes
        else:
            attempt.without.append(number)
    return attempt


def _refuse_unclear(index: ShapeIndex, keys: Sequence[Key], name: str, attempt: _Attempt) -> None:
    for number, shapes in attempt.unclear.items():
        first, second = (plain(index.names[shape]) for shape in shapes[:2])
        raise UsageError(
            f"results of {name!r}: {plain(keys[number].label)} could belong to {first} or to "
            f"{second}: give results by category, as <category>/<id>"
        )
    for shape, groups in attempt.groups.items():
        if len(groups) > 1:
            first, second = (plain(keys[group[0]].label) for group in list(groups.values())[:2])
            raise UsageError(
                f"results of {name!r}: both {first} and {second} have the id of "
                f"{plain(index.names[shape])}: leave just one"
            )


def plain(name: str) -> str:
    """A name that is safe to show."""
    # Loads pictures and pages with it: only where there is something to say.
    from pnabs.report.text import plain as shown

    return shown(name)


def told(names: Sequence[str]) -> str:
    """A few names of many, for a message."""
    rest = len(names) - TOLD
    return ", ".join(plain(name) for name in names[:TOLD]) + (f" and {rest} more" * (rest > 0))


def as_path(category: str, model_id: str) -> tuple[str, ...]:
    """Components of an id with its category."""
    parts = tuple(model_id.split("/"))
    return (category, *parts) if category else parts
