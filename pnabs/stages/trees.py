"""Trees of settings: mappings in mappings, and the dotted keys that lead into them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any


def leaves(tree: Mapping[str, Any], parents: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The path of every key that holds a value: a variant counts as one, an empty group as none."""
    for key, value in tree.items():
        path = (*parents, key)
        if not isinstance(value, Mapping) or parents == ("variants",):
            yield path
        else:
            yield from leaves(value, path)


def dotted(tree: Mapping[str, Any]) -> set[str]:
    """The leaves as dotted keys."""
    return {".".join(path) for path in leaves(tree)}


def flattened(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys and groups as dotted leaves, each once: what comes last stands.

    So their order, which a file with sorted keys doesn't keep, says nothing any more.
    """
    flat: dict[str, Any] = {}
    for key, value in changes.items():
        if isinstance(value, Mapping):
            flat |= {f"{key}.{'.'.join(path)}": at(value, path) for path in leaves(value)}
        else:
            flat[key] = value
    return flat


def and_parents(key: str) -> list[str]:
    """`a.b.c` -> `a`, `a.b`, `a.b.c`."""
    return list(accumulate(key.split("."), "{}.{}".format))


def at(tree: Mapping[str, Any], path: Sequence[str]) -> Any:
    """What stands at a path."""
    value: Any = tree
    for part in path:
        value = value[part]
    return value


def merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Both trees, the second one's values where they meet."""
    out = dict(below)
    for key, value in above.items():
        if isinstance(value, dict) and isinstance(out.get(key), dict):
            out[key] = merge(out[key], value)
        else:
            out[key] = value
    return out


def assign(tree: dict[str, Any], key: str, value: Any) -> None:
    """Put a value at a dotted key; a mapping is merged with what stands there."""
    *parents, last = key.split(".")
    for part in parents:
        child = tree.get(part)
        tree[part] = child = dict(child) if isinstance(child, dict) else {}
        tree = child
    both = isinstance(value, dict) and isinstance(tree.get(last), dict)
    tree[last] = merge(tree[last], value) if both else value
