"""Commands that install work where pip, uv or pipx made the environment, and name no other project."""

import sys

import pytest

from materialist import install


def test_a_command_is_of_this_very_python(monkeypatch):
    assert (
        install.install_command("rawpy>=0.21") == f"{sys.executable} -m pip install 'rawpy>=0.21'"
    )
    monkeypatch.setattr(install, "find_spec", lambda name: None)  # as in an environment of uv
    expected = f"uv pip install --python {sys.executable} 'rawpy>=0.21'"
    assert install.install_command("rawpy>=0.21") == expected


@pytest.mark.parametrize(
    ("extra", "package"), [("usd", "usd-core"), ("hub", "diffusers"), ("app", "gradio")]
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
