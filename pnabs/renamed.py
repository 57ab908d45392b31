"""Settings that were renamed: they are still read by their old names, with a warning."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

RENAMED = {
    "abstract.price": "abstract.min_gain",
    "training.begin": "training.init_from",
}
"""Old dotted key -> new one."""


@dataclass(frozen=True, slots=True)
class Renaming:
    """An old name that was found.

    Attributes
    ----------
    old, new
        Dotted keys, as `RENAMED` has them.
    before, after
        Where the value stood in the tree, and where it stands now; below `variants` the paths begin
        with the variant's.
    """

    old: str
    new: str
    before: tuple[str, ...]
    after: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.old} is called {self.new} now; rename it"


class BothNamesError(ValueError):
    """A setting is given by its old name and by its new one.

    Parameters
    ----------
    old, new
        Dotted keys.
    before
        Where the old name stands in the tree.
    """

    def __init__(self, old: str, new: str, before: tuple[str, ...]) -> None:
        super().__init__(f"{old} is called {new} now, which is given too: leave {old} out")
        self.before = before


def with_new_names(tree: Mapping[str, Any]) -> tuple[dict[str, Any], list[Renaming]]:
    """A tree of settings with old names replaced, and which they were.

    Variants may also give dotted keys.  The tree itself stays as it is.

    Raises
    ------
    BothNamesError
        When the tree, or one variant in it, gives a setting by both names.
    """
    out, found = _replaced(tree, (), dots=False)
    variants = out.get("variants")
    if isinstance(variants, Mapping):
        renamed = {}
        for name, changes in variants.items():
            renamed[name] = changes
            if isinstance(changes, Mapping):
                renamed[name], more = _replaced(changes, ("variants", name), dots=True)
                found += more
        out["variants"] = renamed
    return out, found


def warned(settings: Mapping[str, Any] | None) -> dict[str, Any]:
    """The settings that a library call was given, by their new names; warns that call's caller.

    Raises
    ------
    BothNamesError
        When a setting is given by both names.
    """
    tree, found = with_new_names(settings or {})
    for item in found:
        warnings.warn(f"settings: {item}", FutureWarning, stacklevel=3)
    return tree


def _replaced(
    tree: Mapping[str, Any], base: tuple[str, ...], *, dots: bool
) -> tuple[dict[str, Any], list[Renaming]]:
    out, found = dict(tree), []
    for old, new in RENAMED.items():
        for path in list(_paths(out, old)):
            if not dots and any("." in part for part in path):
                continue
            if any(True for _ in _paths(tree, new)):
                raise BothNamesError(old, new, (*base, *path))
            after = (new,) if path == (old,) else tuple(new.split("."))
            out, value = _taken(out, path)
            out = _put(out, after, value)
            found.append(Renaming(old, new, (*base, *path), (*base, *after)))
    return out, found


def _paths(tree: Mapping[str, Any], key: str) -> Iterator[tuple[str, ...]]:
    """The paths that lead to a dotted key, whether by groups or by keys with dots."""
    for name, value in tree.items():
        if name == key:
            yield (name,)
        elif key.startswith(f"{name}.") and isinstance(value, Mapping):
            yield from ((name, *rest) for rest in _paths(value, key[len(name) + 1 :]))


# Mappings are copied rather than changed: YAML's aliases make one of several places the same.
def _taken(tree: Mapping[str, Any], path: tuple[str, ...]) -> tuple[dict[str, Any], Any]:
    """A tree without what stands at a path, and that."""
    first, *rest = path
    out = dict(tree)
    if not rest:
        return out, out.pop(first)
    out[first], value = _taken(out[first], tuple(rest))
    return out, value


def _put(tree: Mapping[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """A tree with a value at a path."""
    first, *rest = path
    below = tree.get(first)
    inner = below if isinstance(below, Mapping) else {}
    return {**tree, first: _put(inner, tuple(rest), value) if rest else value}
