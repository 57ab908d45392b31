"""Names of categories."""

from __future__ import annotations

import pytest

from pnabs.dataset import synsets
from pnabs.dataset.errors import DatasetError


def test_the_55_synsets_have_names_of_their_own() -> None:
    assert len(synsets.SYNSETS) == 55
    assert len(set(synsets.SYNSETS.values())) == 55
    assert all(len(synset) == 8 and synset.isdigit() for synset in synsets.SYNSETS)
    for synset, name in synsets.SYNSETS.items():
        assert synsets.synset_of(name) == synsets.synset_of(synset) == synset
        assert synsets.name_of(synset) == name


def test_the_papers_categories() -> None:
    names = ["airplane", "chair", "bench", "lamp", "sofa", "bus", "ship"]
    assert [synsets.synset_of(name) for name in names] == [
        "02691156",
        "03001627",
        "02828884",
        "03636649",
        "04256520",
        "02924116",
        "04530566",
    ]


@pytest.mark.parametrize(
    ("asked", "available", "found"),
    [
        ("03001627", ["03001627", "04379243"], "03001627"),
        ("chair", ["03001627", "04379243"], "03001627"),
        ("couch", ["04256520"], "04256520"),
        ("Vessel", ["04530566"], "04530566"),
        ("watercraft", ["boat"], "boat"),
        ("03001627", ["chair"], "chair"),
        ("file cabinet", ["03337140"], "03337140"),
        ("Animal", ["animal"], "animal"),
        ("chair", ["chair", "03001627"], "chair"),
    ],
)
def test_a_category_by_any_of_its_names(asked: str, available: list[str], found: str) -> None:
    assert synsets.resolve_category(asked, available) == found


@pytest.mark.parametrize(
    ("asked", "available", "hint"),
    [
        ("chiar", ["03001627", "animal"], "did you mean chair (03001627)?"),
        ("annimal", ["03001627", "animal"], "did you mean animal?"),
        ("03001672", ["03001627", "animal"], "did you mean 03001627?"),
        ("vesel", ["04530566"], "did you mean vessel (04530566)?"),
    ],
)
def test_a_near_match_is_hinted_at(asked: str, available: list[str], hint: str) -> None:
    with pytest.raises(DatasetError) as error:
        synsets.resolve_category(asked, available)
    assert hint in str(error.value)


def test_a_known_category_that_is_not_there_is_not_replaced_by_another() -> None:
    with pytest.raises(DatasetError, match=r"no category 'lamp' \(03636649\).*03001627 \(chair\)"):
        synsets.resolve_category("lamp", ["03001627"])
