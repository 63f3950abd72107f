"""What a catalogue says of its models."""

import pytest
from made_catalog import MODELS, make_archive

from materialist.errors import InputError
from materialist_lab.procedural.catalog.archive import entries
from materialist_lab.procedural.catalog.roles import role_of


@pytest.fixture(scope="module")
def catalog(tmp_path_factory):
    return entries(make_archive(tmp_path_factory.mktemp("catalog") / "made.sh3f"))


def test_sizes_are_metres_and_names_are_decoded(catalog):
    assert len(catalog) == len(MODELS)
    table = catalog[0]
    sign = catalog[5]
    assert (
        table.key == "made-001"
        and table.path == "made/table/table.obj"
        and table.creator == "Somebody"
    )
    assert table.size == pytest.approx((1.2, 0.75, 0.6))
    assert sign.name == "Café sign" and sign.elevation == pytest.approx(1.5)
    assert catalog[4].lights == (pytest.approx((0.1, 0.35, 0.1)),)
    assert catalog[8].turn == (1, 0, 0, 0, 0, -1, 0, 1, 0)


def test_roles(catalog):
    assert [role_of(entry) for entry in catalog] == [
        "table",
        "chair",
        "small",
        "storage",
        "lamp",
        "wall",
        "small",
        "small",
        "small",
    ]


@pytest.mark.parametrize("content", [b"no zip", None])
def test_a_damaged_catalogue_is_named(tmp_path, content):
    path = tmp_path / "broken.sh3f"
    if content:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"broken\.sh3f"):
        entries(path)
