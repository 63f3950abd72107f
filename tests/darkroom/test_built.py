"""The page in the package is built from `web/` as it is."""

import re
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

import pytest

WEB = Path(__file__).parents[2] / "web"


@pytest.mark.skipif(not WEB.is_dir(), reason="needs the sources of the page")
def test_the_built_page_is_of_these_sources():
    inside = [file for name in ("src", "public") for file in (WEB / name).rglob("*")]
    names = [file.relative_to(WEB).as_posix() for file in inside if file.is_file()]
    total = sha256()
    for name in sorted([*names, "index.html", "package-lock.json", "vite.config.ts"]):
        total.update(f"{name}\n".encode() + (WEB / name).read_bytes())
    built = files("materialist.darkroom") / "static" / "sources.sha256"
    assert built.read_text("utf-8") == total.hexdigest(), "npm run build in web/, and commit it"


@pytest.mark.skipif(not WEB.is_dir(), reason="needs the sources of the page")
def test_no_colour_is_stated_by_itself():
    for file in (WEB / "src").glob("*.css"):
        assert not re.findall(r"(--[\w-]+): *var\(\1\)", file.read_text("utf-8")), file.name
