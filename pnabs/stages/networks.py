"""Whether what a job asks of its networks can be, before anything is done."""

from __future__ import annotations

from pathlib import Path

from pnabs.settings import Network, Settings
from pnabs.stages.job import Job, JobError, variant_place
from pnabs.stages.plan import MODULES
from pnabs.stages.trees import and_parents

OCTANTS = 8


def check_networks(job: Job) -> None:
    """Check every variant's given weights, and what can't be trained.

    Raises
    ------
    JobError
        When a module's file is missing, training is to begin with another network's weights, or
        can't be shared out; names the place in the job file.
    """
    for name, settings in job.variants().items():
        for module in MODULES[: 1 + settings.abstract.negatives]:
            key, error = _checked(settings, module)
            if error is None:
                continue
            if job.settings.variants[name].keys() & and_parents(key):
                raise JobError(f"{variant_place(job.where, name)}{key}: {error}")
            which = "" if name == "main" else f" (variant {name})"
            place = job.where.get(tuple(key.split(".")), job.path)
            raise JobError(f"{place}: {key}: {error}{which}")


def _checked(settings: Settings, module: str) -> tuple[str, str | None]:
    """The key that a module's start depends on, and what is wrong with it."""
    if settings.weights_folder is not None:
        return "weights", _missing(settings.weights_folder / f"{module}.safetensors")
    training = settings.training
    if training.batch_size < training.workers:
        return "training.batch_size", (
            f"{training.batch_size} is less than a shape for each of the {training.workers} workers"
        )
    init, network = training.init_weights(module), settings.network
    if init is not None:
        return "training.init_from", _missing(init) or _another(init, network, module)
    count = _count(network, module)
    if network.start == "octants" and count != OCTANTS:
        return "network.start", (
            f"octants needs exactly {OCTANTS} cuboids, and network.{module}s is {count}"
        )
    return "network.start", None


def _missing(path: Path) -> str | None:
    return None if path.is_file() else f"there is no {path.name} in {path.parent}"


def _another(path: Path, network: Network, module: str) -> str | None:
    """How the network of some weights differs from the one to be trained."""
    from pnabs.model.checkpoint import CheckpointError, load_network

    try:
        begun = load_network(path)
    except CheckpointError as error:
        return str(error)
    pairs = {f"{module}s": (begun.count, _count(network, module))}
    for name in ("channels", "hidden", "refine_input"):
        pairs[name] = (getattr(begun.options, name), getattr(network, name))
    differing = [
        f"network.{name} is {ours!r}, theirs {theirs!r}"
        for name, (theirs, ours) in pairs.items()
        if theirs != ours
    ]
    if not differing:
        return None
    return f"the weights in {path} are of another network: " + "; ".join(differing)


def _count(network: Network, module: str) -> int:
    return network.positives if module == "positive" else network.negatives
