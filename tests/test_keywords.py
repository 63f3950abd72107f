"""Keywords that type checkers know: those of the options, no more and no fewer."""

import inspect
import sys
from dataclasses import fields

import pytest

import materialist as mt
from materialist import keywords, options
from materialist.batches.options import BatchOptions
from materialist.edits.registry import OPERATIONS
from materialist.errors import InputError

KEYWORDS = {
    name: taken
    for module in (
        keywords,
        *(sys.modules[kind.options.__module__] for kind in OPERATIONS.values()),
    )
    for name, taken in vars(module).items()
    if name.endswith("Keywords")
}
PAIRS = {
    "MaterialKeywords": mt.MaterialEdit,
    "RemovalKeywords": mt.Removal,
    "GlassKeywords": mt.Glass,
    "RelightKeywords": mt.Relight,
    "InsertionKeywords": mt.Insertion,
    "DropKeywords": mt.Drop,
    "InvertKeywords": options.InvertOptions,
    "ExportKeywords": options.ExportOptions,
}
FUNCTIONS = (
    mt.edit,
    mt.remove,
    mt.glass,
    mt.relight,
    mt.insert,
    mt.drop,
    mt.settle,
    mt.invert,
    mt.export,
    mt.batch,
)


@pytest.mark.parametrize("name", PAIRS)
def test_each_has_the_fields_of_its_options(name):
    assert set(KEYWORDS[name].__annotations__) == {field.name for field in fields(PAIRS[name])}


def test_a_batch_takes_its_own_and_those_of_inversions():
    both = {field.name for kind in (BatchOptions, options.InvertOptions) for field in fields(kind)}
    assert set(keywords.BatchKeywords.__annotations__) == both


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_functions_declare_them(function):
    (loose,) = [
        p for p in inspect.signature(function).parameters.values() if p.kind is p.VAR_KEYWORD
    ]
    assert "Keywords" in str(loose.annotation)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_docstrings_list_every_option(function):
    (loose,) = [
        p for p in inspect.signature(function).parameters.values() if p.kind is p.VAR_KEYWORD
    ]
    name = next(name for name in (*PAIRS, "BatchKeywords") if name in str(loose.annotation))
    kind = PAIRS.get(name, BatchOptions)
    for field in fields(kind):
        line = f"    {field.name}: {field.metadata['option'].help}"
        assert line in function.__doc__ and line in kind.__doc__
    assert function.__doc__.index("Options:") > 50


def test_a_line_says_what_is_taken_and_the_default():
    assert (
        "    ior: Index of refraction, 1 to 3: water 1.33, glass 1.5. Takes [1, 3]. Default: 1.5."
        in mt.Glass.__doc__
    )
    assert "Takes 'closed' or 'two-interface'. Default: 'closed'." in mt.glass.__doc__


def test_a_misspelt_keyword_is_named_with_the_one_that_is_meant():
    with pytest.raises(
        InputError, match=r"edit has no option 'ruoghness'; .* Do you mean 'roughness'\?"
    ):
        mt.MaterialEdit(ruoghness=1)
    with pytest.raises(InputError, match=r"no option 'qqq'; it takes .*feather\.$"):
        mt.MaterialEdit.merged(qqq=1)
    for function in (
        mt.read_photo,
        mt.save_image,
        mt.select,
        mt.composite,
        mt.render_scene,
        mt.Prior,
    ):
        with pytest.raises(InputError, match=f"^{function.__name__} has no option 'qqq'"):
            function(qqq=1)
    with pytest.raises(InputError, match=r"^batch has no option 'sizee'; .* Do you mean 'size'"):
        mt.batch("photos", "runs", sizee=1)


@pytest.mark.slow
def test_a_type_checker_refuses_a_misspelt_keyword(tmp_path):
    from mypy import api

    lines = (
        "import materialist as mt",
        "scene = mt.load_scene('a')",
        "mt.edit(scene, scene.depth, {}=1)",
    )
    for word, expected in (("roughness", 0), ("ruoghness", 1)):
        file = tmp_path / f"{word}.py"
        file.write_text("\n".join(lines).format(word))
        out, _, code = api.run(
            [str(file), "--ignore-missing-imports", "--cache-dir", str(tmp_path / "cache")]
        )
        assert code == expected and (
            expected == 0 or 'Unexpected keyword argument "ruoghness"' in out
        ), out
