"""Job files: YAML to settings, with errors that name the key and the line."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from pnabs.renamed import BothNamesError, Renaming, with_new_names
from pnabs.settings import Settings
from pnabs.stages.presets import PRESETS, written_out
from pnabs.stages.trees import assign, dotted, flattened, leaves, merge

_T = TypeVar("_T")

_SHARED = ("dataset", "ingest", "out", "seed", "preset", "runtime", "report", "variants")
"""Settings that no variant may give."""


class JobError(Exception):
    """A job file or an override that can't be used; names the key and, in a file, the line."""


@dataclass(frozen=True, slots=True)
class Job:
    """A job's settings, where each came from, and the file they were read from.

    `where` says for each key of the file, and of the overrides, where it stands.
    """

    settings: Settings
    origins: dict[str, str]
    path: Path
    where: Mapping[tuple[str, ...], str] = field(default_factory=dict)

    def variants(self) -> dict[str, Settings]:
        """The settings of every variant, `main` first."""
        names = ["main", *(name for name in self.settings.variants if name != "main")]
        return {name: self.variant(name) for name in names}

    def in_order_of(self, run: Mapping[str, Any] | None) -> Job:
        """The same job with its variants in the order of a run folder's run.json, new ones last.

        What variants share lies with the first of them, so the run folder's order is kept
        whatever the job file's has become.
        """
        known = run.get("variants", ()) if run is not None else ()
        own = self.settings.variants
        order = [name for name in known if name in own] + [
            name for name in own if name not in known
        ]
        settings = self.settings.model_copy(
            update={"variants": {name: own[name] for name in order}}
        )
        return replace(self, settings=settings)

    def variant(self, name: str) -> Settings:
        """The settings of one variant.

        Raises
        ------
        JobError
            When the variant's overrides are wrong.
        """
        tree = self.settings.model_dump(mode="json", exclude={"variants"})
        prefix = variant_place(self.where, name)
        for key, value in self.settings.variants[name].items():
            if key.partition(".")[0] in _SHARED:
                raise JobError(
                    f"{prefix}{key}: variants share dataset, ingest, seed, runtime and report; "
                    "only settings from training on may differ"
                )
            assign(tree, key, value)
        return _absolute(_validate(tree, {}, prefix))


def _warn(message: str) -> None:
    warnings.warn(message, FutureWarning, stacklevel=3)


def load_job(
    path: Path,
    overrides: Sequence[str] = (),
    out: Path | None = None,
    say: Callable[[str], None] = _warn,
) -> Job:
    """Read a job file and apply `--set key=value` overrides.

    Parameters
    ----------
    say
        Takes warnings about the file and the overrides; Python's own when left out.

    Raises
    ------
    JobError
        When the file can't be read, isn't YAML, or a key or value is wrong.
    """
    try:
        text = path.read_text()
        tree = yaml.safe_load(text)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        lines = dict(_lines(node, (), path))
    except OSError as error:
        raise JobError(f"can't read the job file {path}: {error.strerror or error}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise JobError(f"{path} is not valid YAML: {error}") from None
    if not isinstance(tree, dict):
        raise JobError(f"{path}: a job file is a mapping with at least `dataset` and `out`")
    places = {key: f"{path}, line {line}" for key, line in lines.items()}
    tree, found = _renamed(tree, places, str(path))
    notices = _notices(found, places, str(path))
    for item in found:
        lines |= dict.fromkeys(_new(item, lines), _nearest(lines, item.before, 1))
    where = {key: f"{path}, line {line}" for key, line in lines.items()}
    origins = {".".join(key): f"{path}:{_nearest(lines, key, 1)}" for key in leaves(tree)}
    notices += _override(tree, overrides, where, origins)
    for notice in dict.fromkeys(notices):
        say(notice)
    if out is not None:
        tree["out"] = str(out)
        origins["out"] = where["out",] = "--out"
    preset = tree.get("preset", "best")
    if isinstance(preset, str) and preset in PRESETS:
        origins.update(dict.fromkeys(dotted(PRESETS[preset]) - set(origins), "preset"))
        tree = merge(PRESETS[preset], tree)
    settings = _validate(tree, where, f"{path}: ")
    settings = _absolute(settings)
    said = {key for key, place in origins.items() if place != "preset"}
    variants = {}
    for name, changes in settings.variants.items():
        try:
            variants[name] = _here(written_out(changes, settings.preset, said))
        except ValueError as error:
            raise JobError(f"{variant_place(where, name)}{error}") from None
    settings = settings.model_copy(update={"variants": variants})
    job = Job(settings, origins, path, where)
    if not settings.variants or "main" not in settings.variants:
        raise JobError(f"{path}: variants must have one named `main`")
    for name in settings.variants:
        if not name.replace("-", "").replace("_", "").isalnum():
            raise JobError(f"{path}: variant {name!r}: use letters, digits, - and _")
    job.variants()
    root = settings.dataset.root
    if isinstance(root, Path) and settings.out.is_relative_to(root):
        place = where.get(("out",), str(path))
        raise JobError(f"{place}: out lies inside dataset.root; put the run folder elsewhere")
    return job


def variant_place(where: Mapping[tuple[str, ...], str], variant: str) -> str:
    """How an error about a variant begins."""
    place = where.get(("variants", variant))
    return f"{place}: variants.{variant}: " if place else f"variants.{variant}: "


def _here(changes: dict[str, Any]) -> dict[str, Any]:
    """A variant's changes with paths made absolute, as `_absolute` makes the job's."""
    paths = {
        key: str(Path(value).absolute())
        for key in ("weights", "training.init_from")
        if isinstance(value := changes.get(key), str) and value != "shipped"
    }
    return changes | paths


def _absolute(settings: Settings) -> Settings:
    """Workers run elsewhere: paths are made absolute where the job is read."""
    dataset = settings.dataset
    root, weights, init = dataset.root, settings.weights, settings.training.init_from
    paths: dict[str, Any] = {"root": root if isinstance(root, str) else root.absolute()}
    if isinstance(dataset.split, Path):
        paths["split"] = dataset.split.absolute()
    return settings.model_copy(
        update={
            "out": settings.out.absolute(),
            "weights": weights.absolute() if isinstance(weights, Path) else weights,
            "dataset": dataset.model_copy(update=paths),
            "training": settings.training.model_copy(
                update={"init_from": init.absolute() if isinstance(init, Path) else init}
            ),
        }
    )


def _validate(
    tree: dict[str, Any], where: Mapping[tuple[str, ...], str], fallback: str
) -> Settings:
    try:
        return Settings.model_validate(tree)
    except ValidationError as error:
        raise JobError(
            "\n".join(_explain(item, where, fallback) for item in error.errors())
        ) from None


def _explain(item: Any, where: Mapping[tuple[str, ...], str], fallback: str) -> str:
    location = tuple(str(part) for part in item["loc"])
    known = next((location[:n] for n in range(len(location), 0, -1) if location[:n] in where), None)
    place = f"{where[known]}: " if known else fallback
    key = ".".join(location)
    if item["type"] == "extra_forbidden":
        parent = _group(location[:-1])
        near = difflib.get_close_matches(location[-1], parent, n=1)
        hint = f"; did you mean {near[0]}?" if near else f"; known here: {', '.join(parent)}"
        if "." in location[-1]:
            first, _, rest = location[-1].partition(".")
            hint = f"; dotted keys are for variants and --set, here write {first}: {{{rest}: ...}}"
        return f"{place}unknown key {key}{hint}"
    if location[:2] == ("dataset", "categories") and isinstance(item["input"], int):
        return f"{place}{key}: quote synsets, as in '03001627'; YAML reads them as numbers"
    if item["type"] == "missing":
        return f"{place}{key} is missing"
    got = "" if isinstance(item["input"], dict) else f" (got {item['input']!r})"
    return f"{place}{key}: {item['msg']}{got}"


def _group(location: tuple[str, ...]) -> list[str]:
    model: type[BaseModel] = Settings
    for part in location:
        annotation = model.model_fields[part].annotation if part in model.model_fields else None
        if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
            return []
        model = annotation
    return list(model.model_fields)


def with_overrides(job: Job, overrides: Sequence[str], say: Callable[[str], None] = _warn) -> Job:
    """A job with `--set key=value` overrides on top.

    Parameters
    ----------
    say
        Takes warnings about the overrides; Python's own when left out.

    Raises
    ------
    JobError
        When a key or value is wrong.
    """
    if any(override.startswith("preset=") for override in overrides):
        raise JobError("--set preset: its values are settled already; give settings one by one")
    tree = job.settings.model_dump(mode="json", exclude_unset=False)
    where, origins = dict(job.where), dict(job.origins)
    for notice in dict.fromkeys(_override(tree, overrides, where, origins)):
        say(notice)
    settings = _absolute(_validate(tree, where, ""))
    variants = {name: _here(flattened(own)) for name, own in settings.variants.items()}
    settings = settings.model_copy(update={"variants": variants})
    return Job(settings, origins, job.path, where)


def _override(
    tree: dict[str, Any],
    overrides: Sequence[str],
    where: dict[tuple[str, ...], str],
    origins: dict[str, str],
) -> list[str]:
    """Put overrides into a tree of settings, and note where each came from; returns warnings."""
    notices = []
    given: dict[str, Any] = {}
    places: dict[tuple[str, ...], str] = {}
    for override in overrides:
        key, equals, value = override.partition("=")
        if not equals or not key:
            raise JobError(f"--set {override}: write it as key=value, such as training.epochs=50")
        try:
            parsed = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise JobError(f"--set {override}: the value is not valid YAML: {error}") from None
        place = f"--set {override}"
        parts = tuple(key.split("."))
        places[parts] = place
        assign(given, key, parsed)
        # By both names is an error only here: an override may replace what the file says.
        _renamed(given, places, place)
        own: dict[str, Any] = {}
        assign(own, key, parsed)
        own, found = _renamed(own, {}, place)
        notices += _notices(found, {}, place)
        for name, value in own.items():
            assign(tree, name, value)
        whole = {item.before: item.after for item in found}.get(parts, parts)
        for depth in range(1, len(whole)):
            where.setdefault(whole[:depth], place)
        where[whole] = place
        for item in found:
            where.update(dict.fromkeys(_new(item, where), place))
        said = {".".join(whole)} if whole[0] == "variants" else dotted(own)
        origins.update(dict.fromkeys(said, "--set"))
    return notices


def _renamed(
    tree: Mapping[str, Any], where: Mapping[tuple[str, ...], str], fallback: str
) -> tuple[dict[str, Any], list[Renaming]]:
    """A tree with new names in the place of old ones, and which they were."""
    try:
        return with_new_names(tree)
    except BothNamesError as error:
        raise JobError(f"{_nearest(where, error.before, fallback)}: {error}") from None


def _notices(
    found: Iterable[Renaming], where: Mapping[tuple[str, ...], str], fallback: str
) -> list[str]:
    return [f"{_nearest(where, item.before, fallback)}: {item}" for item in found]


def _new(item: Renaming, known: Mapping[tuple[str, ...], Any]) -> list[tuple[str, ...]]:
    """The path of a new name, and the groups above it that aren't known yet."""
    above = [item.after[:depth] for depth in range(1, len(item.after))]
    return [*(path for path in above if path not in known), item.after]


_TEXT, _MERGE = "tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"


def _nearest(known: Mapping[tuple[str, ...], _T], key: tuple[str, ...], otherwise: _T) -> _T:
    """What is known of a key or, where it comes with an alias, of what holds it."""
    return next((known[key[:n]] for n in range(len(key), 0, -1) if key[:n] in known), otherwise)


def _lines(
    node: yaml.Node | None, prefix: tuple[str, ...], path: Path
) -> Iterator[tuple[tuple[str, ...], int]]:
    if not isinstance(node, yaml.MappingNode):
        return
    seen: dict[str, int] = {}
    for key, value in node.value:
        name, line = str(key.value), key.start_mark.line + 1
        if key.tag not in (_TEXT, _MERGE):
            raise JobError(
                f"{path}, line {line}: YAML doesn't read the key {name} as text: put it in quotes"
            )
        if name in seen:
            raise JobError(f"{path}, line {line}: {name} stands in line {seen[name]} already")
        seen[name] = line
        yield (*prefix, name), line
        yield from _lines(value, (*prefix, name), path)
