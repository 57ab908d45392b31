"""Writes what the code already says: pages/settings.md, from pnabs.settings, and
pages/abstraction.schema.json, from the reader of abstraction.json.

Run it from the repository's root: `python docs/reference.py`.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from pnabs import settings
from pnabs.formats.json_format import schema
from pnabs.renamed import RENAMED
from pnabs.stages.plan import VERSIONS, recipe_digest
from pnabs.stages.presets import PRESETS

PAGE = Path(__file__).parent / "pages" / "settings.md"
SCHEMA = PAGE.with_name("abstraction.schema.json")

HEAD = """\
# Settings

<!-- Written by docs/reference.py from pnabs/settings.py; run it again rather than edit. -->

Every setting there is, as `pnabs.settings` declares them; nothing else is accepted in a job file
but the [old names](#old-names) of some. How job files, presets, variants and `--set` work is told
in [Job files](jobs.md).

*Redoes* names the stages whose results depend on a setting: in a run that exists already, a
changed value is refused, and with `--accept-changes` those stages are done again (see
[Running](running.md#changes)). A dash means that no result depends on it; for the settings of
`dataset`, see [there](#dataset).

Lengths are in the normalised frame (the longest side of a shape's bounding box is 1) unless a
unit is given.
"""

WORDS = {
    "weights": "`abstract`; training and `difference` are left out",
    "preset": "what it changes",
    "variants": "what they change",
}
"""Settings whose effect isn't that of one value."""

DATASET_NOTE = """\
These settings choose the models, and the catalogue tells what changed in them: added models get
shards of their own, models whose file, split or place changed have their shards done again.
`layout` and `shard_size` are fixed once a run folder exists. `root`, `limit` and `categories` may
change without being refused themselves, only for the models they add; models that were in the run
stay in it. See [Datasets](datasets.md).
"""

PRESET_NOTE = """\
A preset's values stand below those of the job file and of `--set`. `best` is the defaults
themselves; `paper` changes these:
"""


OLD_NAMES = """\
These are still read, in job files, variants, `--set` and the library's `settings`, with a warning
that tells the new name. Both names of a setting at once are an error. Run folders hold new names
alone.
"""


def render() -> str:
    """The whole page."""
    schema = settings.Settings.model_json_schema()
    example = settings.Settings(dataset=settings.Dataset(root=Path("DATA")), out=Path("OUT"))
    parts = [HEAD]
    for prefix, model in _groups(settings.Settings, ""):
        definition = schema if model is settings.Settings else schema["$defs"][model.__name__]
        parts.append(f"## {prefix.rstrip('.') or 'The job'}\n\n{inspect.getdoc(model)}\n")
        if prefix == "dataset.":
            parts.append(DATASET_NOTE)
        rows = [
            "| Setting | Values | Default | Meaning | Redoes |",
            "| --- | --- | --- | --- | --- |",
        ]
        for name, field in definition["properties"].items():
            annotation = model.model_fields[name].annotation
            if isinstance(annotation, type) and issubclass(annotation, settings.Group):
                continue
            needed = name in definition.get("required", ())
            cells = (
                f"`{prefix}{name}`",
                _values(field, schema["$defs"]),
                "*needed*" if needed else f"`{_literal(field['default'])}`",
                " ".join(field["description"].split()),
                "" if prefix == "dataset." else _redoes(example, f"{prefix}{name}", field),
            )
            rows.append(f"| {' | '.join(_escape(cell) for cell in cells)} |")
        parts.append("\n".join(rows) + "\n")
    paper = yaml.safe_dump(PRESETS["paper"], sort_keys=False, default_flow_style=None)
    parts.append(f"## Presets\n\n{PRESET_NOTE}\n```yaml\n{paper}```\n")
    names = [f"| `{old}` | `{new}` |\n" for old, new in RENAMED.items()]
    parts.append(f"## Old names\n\n{OLD_NAMES}\n| Old | New |\n| --- | --- |\n{''.join(names)}")
    return "\n".join(parts)


def _groups(model: type[BaseModel], prefix: str) -> Iterator[tuple[str, type[BaseModel]]]:
    yield prefix, model
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, settings.Group):
            yield from _groups(field.annotation, f"{prefix}{name}.")


def _values(field: dict[str, Any], definitions: dict[str, Any]) -> str:
    """What a setting takes, in words."""
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    if "const" in field:
        return f"`{field['const']}`"
    if "anyOf" in field:
        return " or ".join(dict.fromkeys(_values(each, definitions) for each in field["anyOf"]))
    if field.get("format") == "path":
        return "path"
    if field.get("type") == "array":
        items = field.get("prefixItems") or [field["items"]]
        count = field.get("minItems", 0) if field.get("minItems") == field.get("maxItems") else 0
        inner = _values(items[0], definitions)
        return f"{count} of: {inner}" if count else f"list of: {inner}"
    if field.get("type") in ("integer", "number"):
        noun = "integer" if field["type"] == "integer" else "number"
        signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
        bounds = [f"{sign} {field[key]:g}" for key, sign in signs.items() if key in field]
        if field.get("exclusiveMaximum") == 2**32:
            bounds[-1] = "< 2^32"
        return f"{noun} {', '.join(bounds)}".strip()
    names = {"boolean": "`true`, `false`", "null": "`null`", "string": "text", "object": "mapping"}
    return names[field["type"]]


def _literal(value: Any) -> str:
    if isinstance(value, float) and value not in (0.0, 1.0):
        return f"{value:g}" if float(f"{value:g}") == value else f"{value:.4f}"
    return json.dumps(value)


def _redoes(job: settings.Settings, key: str, field: dict[str, Any]) -> str:
    """Stages whose recipe another value of the setting changes, by trying one."""
    if key in WORDS:
        return WORDS[key]
    tree = job.model_dump(mode="python")
    *parents, last = key.split(".")
    node = tree
    for part in parents:
        node = node[part]
    node[last] = _other(node[last], field)
    changed = _construct(settings.Settings, tree)
    stages = [s for s in VERSIONS if recipe_digest(s, job) != recipe_digest(s, changed)]
    if stages == list(VERSIONS):
        return "all"
    return ", ".join(f"`{stage}`" for stage in stages) or "–"


def _other(value: Any, field: dict[str, Any]) -> Any:
    """A value that isn't the given one."""
    if "enum" in field:
        return next(other for other in field["enum"] if other != value)
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, tuple):
        return value[::-1] or (1,)
    return Path("other")


def _construct(model: type[BaseModel], tree: dict[str, Any]) -> Any:
    """A model from a tree, unchecked: the values tried need not make sense together."""
    values = {}
    for name, field in model.model_fields.items():
        inner, value = field.annotation, tree[name]
        if isinstance(inner, type) and issubclass(inner, settings.Group):
            value = _construct(inner, value)
        values[name] = value
    return model.model_construct(**values)


def _escape(cell: str) -> str:
    return re.sub(r"(?<!\\)\|", r"\\|", cell)


if __name__ == "__main__":
    PAGE.write_text(render())
    SCHEMA.write_text(json.dumps(schema(), indent=1) + "\n")
