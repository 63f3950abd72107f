"""`bench paper`: its table of the paper's figures, the page from made-up rows, resuming, and one real row."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from materialist import __version__
from materialist.errors import InputError
from materialist_lab import bench
from materialist_lab.bench import benchmark_class, edits, paper

MEASURES, TABLES = paper.published()


def test_every_measure_has_a_table_and_options_that_its_benchmark_takes():
    assert {table.measure for table in TABLES if table.measure} == set(MEASURES)
    for measure in MEASURES.values():
        for size in (measure.quick, measure.full):
            benchmark_class(measure.bench).merged(**measure.options | size)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.title)
def test_every_table_names_figures_and_methods_that_there_are(table):
    if table.absent:
        assert not table.measure and not table.lines
        return
    measure = MEASURES[table.measure]
    assert set(table.columns) <= {column.key for column in benchmark_class(measure.bench).columns}
    assert all(
        len(figures) <= len(table.columns) and methods for _, figures, methods in table.lines
    )
    assert table.paper and table.differs
    methods = {method for line in table.lines for method in line[2]}
    if measure.bench == "light":
        assert methods <= set(measure.options["methods"].split(","))
    if measure.bench == "invert":
        sizes = {
            size for sized in (measure.quick, measure.full) for size in sized["sizes"].split(",")
        }
        assert {f"{size} × {size}" for size in sizes} <= methods
    if measure.bench in ("edit", "photo-alone"):
        kinds = {method.removeprefix("ceiling ").partition(":")[0] for method in methods}
        assert kinds <= {*edits.KINDS, "maps"}


@pytest.fixture
def stubs(monkeypatch):
    """Every benchmark answers at once with one method; the names of those that ran."""
    ran = []

    def stub(name):
        def run(data, folder):
            ran.append(name)
            if name == "glass":
                raise InputError("No <glass> here.")
            means = {"samples": 2, "render_psnr": 31.25, "whdr": 0.25}
            content = {
                "machine": {"cores": 2},
                "means": {"paper predicted": means, "bundled": means},
            }
            (folder / "report.json").write_text(json.dumps(content))

        there = benchmark_class(name)
        return SimpleNamespace(
            columns=there.columns, merged=lambda **options: SimpleNamespace(run=run)
        )

    monkeypatch.setattr(paper, "benchmark_class", stub)
    return ran


def test_the_page_has_the_papers_figures_beside_ours_and_says_what_was_not_run(stubs, tmp_path):
    out = bench.run("paper", output=tmp_path / "out", quick=True, only="light,glass,iiw")
    text, page = ((out / f"report.{kind}").read_text("utf-8") for kind in ("md", "html"))
    head = next(line for line in text.splitlines() if "envmap SSIM" in line)
    assert head.count("|") == text.splitlines()[text.splitlines().index(head) + 1].count("|")
    assert "| w/ mat | published | 0.52 | 0.811 | 17.175 | 20.048 |" in text
    assert "| w/ mat | paper predicted | – | – | – | 31.25 |" in text
    assert (
        "Not run: it needs --data DIR with iiw." in text
        and "Not run yet: materialist bench paper -o REPORT --resume --only glass-room." in text
        and "They need people." in text
    )
    assert "No <glass> here." in text and "No &lt;glass&gt; here." in page
    assert "<td>31.25</td>" in page and "http" not in page.replace("http-equiv", "")
    assert paper.commit() in page and page.count("<section>") == len(TABLES)


def test_finished_rows_are_kept_until_the_commit_or_the_settings_change(
    stubs, tmp_path, monkeypatch
):
    def run(**options):
        stubs.clear()
        bench.run(
            "paper",
            output=tmp_path,
            data=tmp_path,
            only="light,iiw",
            **{"quick": True, "resume": True, **options},
        )
        return list(stubs)

    (tmp_path / "iiw").mkdir()
    assert run() == ["light", "whdr"] and run() == []
    assert "| w/ mat | paper predicted |" in (tmp_path / "report.md").read_text("utf-8")
    assert run(seed=1) == ["light", "whdr"]
    assert run(seed=1, quick=False) == ["light", "whdr"]
    monkeypatch.setattr(paper, "commit", lambda: "abc1234")
    assert run(seed=1, quick=False) == ["light", "whdr"]
    assert json.loads((tmp_path / "rows" / "light.json").read_text())["commit"] == "abc1234"


def test_an_installed_package_names_its_version_for_a_commit(stubs, tmp_path, monkeypatch):
    def no_git(*words, **options):
        raise FileNotFoundError(words[0][0])

    monkeypatch.setattr(paper.subprocess, "run", no_git)
    monkeypatch.setattr(paper, "commit", paper.commit.__wrapped__)
    bench.run("paper", output=tmp_path, quick=True, only="light")
    text = (tmp_path / "report.md").read_text("utf-8")
    version = f"of version {__version__}"
    assert f"Written at commit {version}, " in text and f"\nCommit {version}, " in text


def test_a_name_that_is_no_measure_is_refused(tmp_path):
    with pytest.raises(InputError, match="'glas' is unknown; choose from light"):
        bench.run("paper", output=tmp_path / "out", only="glas")
    assert not (tmp_path / "out" / "rows").exists()


@pytest.mark.slow
def test_one_row_from_end_to_end(mitsuba, tmp_path, monkeypatch):
    small = replace(
        MEASURES["fov"], quick={"scenes": 1, "size": 24, "spp": 4, "predictor": "truth"}
    )
    monkeypatch.setitem(MEASURES, "fov", small)
    out = bench.run("paper", output=tmp_path / "out", quick="true", only="fov", device="cpu")
    row = json.loads((out / "rows" / "fov.json").read_text())
    assert (
        row["means"]["fov x 1"]["psnr"] > 15
        and row["seconds"] > 0
        and row["settings"]["size"] == 24
    )
    assert f"| 35 degrees | fov x 1 | {row['means']['fov x 1']['psnr']:.2f} |" in (
        out / "report.md"
    ).read_text("utf-8")


def test_quick_and_full_rows_stand_on_one_page_each_marked(stubs, tmp_path):
    for quick, resume, only in ((True, False, "light,mirrors"), (False, True, "light")):
        out = bench.run("paper", output=tmp_path / "out", quick=quick, resume=resume, only=only)
    runs = [
        line
        for line in (out / "report.md").read_text("utf-8").splitlines()
        if "s of one core)" in line
    ]
    assert 0 < sum("one core), quick;" in line for line in runs) < len(runs)


def test_the_page_can_be_read_without_other_files(stubs, tmp_path, browser):
    out = bench.run("paper", output=tmp_path / "out", only="light")
    page = browser.new_page(viewport={"width": 900, "height": 900})
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((out / "report.html").as_uri())
    assert page.locator("tr.paper").count() > 10 and page.locator("h2").first.is_visible()
    assert len(asked) == 1 and page.evaluate("document.body.scrollWidth <= innerWidth")
    page.close()
