"""The laboratory's distribution: it needs the product of its own version, and says which commands it adds."""

import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import materialist
from materialist.cli import plugins

LABORATORY = Path(__file__).resolve().parents[1]


def project(folder):
    return tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))["project"]


def test_product_and_laboratory_have_one_version():
    product = project(LABORATORY.parent)
    laboratory = project(LABORATORY)
    assert laboratory["version"] == product["version"] == materialist.__version__
    assert f"{product['name']}=={product['version']}" in laboratory["dependencies"]


def test_its_commands_are_those_that_the_product_misses_without_it():
    declared = project(LABORATORY)["entry-points"][plugins.GROUP]
    assert set(declared) == set(plugins.LABORATORY_COMMANDS)
    installed = {point.name: point.value for point in entry_points(group=plugins.GROUP)}
    assert installed.items() >= declared.items(), "install it: scripts/setup dev"
