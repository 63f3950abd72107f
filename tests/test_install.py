"""Commands that install work in environments of pip, uv and pipx, and name no other project."""

import re
import shlex
import sys

import pytest

from materialist import install


def test_a_command_is_of_this_very_python(monkeypatch):
    assert (
        install.install_command("rawpy>=0.21")
        == f"{shlex.quote(sys.executable)} -m pip install 'rawpy>=0.21'"
    )
    monkeypatch.setattr(install, "find_spec", lambda name: None)  # as in an environment of uv
    expected = f"uv pip install --python {shlex.quote(sys.executable)} 'rawpy>=0.21'"
    assert install.install_command("rawpy>=0.21") == expected


def test_an_environment_of_pipx_is_changed_by_pipx(monkeypatch, tmp_path):
    (tmp_path / "materialist-photo").mkdir()
    (tmp_path / "materialist-photo" / "pipx_metadata.json").touch()
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "materialist-photo"))
    command = "pipx inject materialist-photo 'rawpy>=0.21' usd-core"
    assert install.install_command("rawpy>=0.21", "usd-core") == command


def test_a_python_in_a_folder_with_a_space_is_quoted(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/home/a b/bin/python")
    assert shlex.split(install.install_command("rawpy"))[0] == "/home/a b/bin/python"
    monkeypatch.setattr(install, "find_spec", lambda name: None)
    assert "/home/a b/bin/python" in shlex.split(install.install_command("rawpy"))


@pytest.mark.parametrize(
    ("extra", "package"), [("usd", "usd-core"), ("hub", "diffusers"), ("app", "starlette")]
)
def test_an_extra_is_installed_by_its_packages(extra, package):
    command = install.extra_command(extra)
    assert f"'{package}" in command
    assert "materialist" not in command.partition(" install ")[2]


def test_an_extra_that_this_installation_does_not_know_names_our_distribution(monkeypatch):
    def unknown(name):
        raise install.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(install.metadata, "requires", unknown)
    assert install.extra_requirements("usd") == ["materialist-photo[usd]"]


def test_the_laboratory_is_installed_by_name_or_from_a_checkout(monkeypatch):
    assert install.laboratory_advice().endswith("/lab") and " -e " in install.laboratory_advice()
    monkeypatch.setattr(install, "__file__", "/usr/lib/site-packages/materialist/install.py")
    assert re.search(
        "install materialist-photo-lab, or in a checkout.* install ./lab$",
        install.laboratory_advice(),
    )
