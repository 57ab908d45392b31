"""ShapeNetCore's categories: WordNet synset offsets and the names people use for them."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection

from pnabs.dataset.errors import DatasetError

SYNSETS: dict[str, str] = {
    "02691156": "airplane",
    "02747177": "trash_bin",
    "02773838": "bag",
    "02801938": "basket",
    "02808440": "bathtub",
    "02818832": "bed",
    "02828884": "bench",
    "02843684": "birdhouse",
    "02871439": "bookshelf",
    "02876657": "bottle",
    "02880940": "bowl",
    "02924116": "bus",
    "02933112": "cabinet",
    "02942699": "camera",
    "02946921": "can",
    "02954340": "cap",
    "02958343": "car",
    "02992529": "cellphone",
    "03001627": "chair",
    "03046257": "clock",
    "03085013": "keyboard",
    "03207941": "dishwasher",
    "03211117": "display",
    "03261776": "earphone",
    "03325088": "faucet",
    "03337140": "file_cabinet",
    "03467517": "guitar",
    "03513137": "helmet",
    "03593526": "jar",
    "03624134": "knife",
    "03636649": "lamp",
    "03642806": "laptop",
    "03691459": "loudspeaker",
    "03710193": "mailbox",
    "03759954": "microphone",
    "03761084": "microwave",
    "03790512": "motorbike",
    "03797390": "mug",
    "03928116": "piano",
    "03938244": "pillow",
    "03948459": "pistol",
    "03991062": "flowerpot",
    "04004475": "printer",
    "04074963": "remote",
    "04090263": "rifle",
    "04099429": "rocket",
    "04225987": "skateboard",
    "04256520": "sofa",
    "04330267": "stove",
    "04379243": "table",
    "04401088": "telephone",
    "04460130": "tower",
    "04468005": "train",
    "04530566": "ship",
    "04554684": "washer",
}
"""Name of each of ShapeNetCore's 55 synsets; `name_of` and `synset_of` go both ways."""

_ALIASES: dict[str, str] = {
    "aeroplane": "02691156",
    "plane": "02691156",
    "ashcan": "02747177",
    "tub": "02808440",
    "tin_can": "02946921",
    "automobile": "02958343",
    "mobile_phone": "02992529",
    "monitor": "03211117",
    "headphone": "03261776",
    "tap": "03325088",
    "speaker": "03691459",
    "microwaves": "03761084",
    "motorcycle": "03790512",
    "pot": "03991062",
    "remote_control": "04074963",
    "couch": "04256520",
    "phone": "04401088",
    "boat": "04530566",
    "vessel": "04530566",
    "watercraft": "04530566",
    "washing_machine": "04554684",
}

_BY_NAME = {name: synset for synset, name in SYNSETS.items()} | _ALIASES


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", "_", name.strip().casefold())


def name_of(category: str) -> str:
    """Name to show for a category: `chair` for 03001627, itself when it has no other."""
    return SYNSETS.get(category, category)


def synset_of(category: str) -> str | None:
    """Synset that a category means, by offset, name or alias; None when it means none."""
    return category if category in SYNSETS else _BY_NAME.get(_plain(category))


def resolve_category(name: str, available: Collection[str]) -> str:
    """Find the category that a user means.

    Parameters
    ----------
    name : str
        A folder's name, a synset, its name or an alias; an exact folder name wins.
    available : collection of str
        The dataset's categories (folder names).

    Returns
    -------
    str
        One of `available`.

    Raises
    ------
    DatasetError
        If none matches; names the nearest and what there is.
    """
    if name in available:
        return name
    synset = synset_of(name)
    for category in sorted(available):
        same = synset is not None and synset_of(category) == synset
        if same or _plain(category) == _plain(name):
            return category

    spellings = {_plain(category): category for category in available}
    spellings |= {alias: c for alias, s in _BY_NAME.items() for c in available if synset_of(c) == s}
    near = difflib.get_close_matches(_plain(name), spellings, n=1)
    hint = ""
    if near:
        category = spellings[near[0]]
        same_word = near[0] == category
        hint = f"; did you mean {near[0]}{'' if same_word else f' ({category})'}?"
    meant = f" ({synset})" if synset and synset != name else ""
    raise DatasetError(
        f"no category {name!r}{meant} in the dataset{hint or '.'} {describe_categories(available)}"
    )


def describe_categories(available: Collection[str], most: int = 12) -> str:
    """One sentence on what there is, for error messages."""
    if not available:
        return "There are no categories."
    shown = [
        f"{category} ({name_of(category)})" if category in SYNSETS else category
        for category in sorted(available)[:most]
    ]
    rest = len(available) - len(shown)
    return "There are: " + ", ".join(shown) + (f" and {rest} more." if rest else ".")
