"""A list of edits as a file, so that they can be replayed and batched: `materialist apply SCENE edits.yaml`."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from materialist.edits.drop.drop import settle
from materialist.edits.glass.glass import glass
from materialist.edits.insert.insert import insert
from materialist.edits.light.relight import relight
from materialist.edits.material.material import edit
from materialist.edits.remove.remove import remove
from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.io.atomic import write_whole
from materialist.io.text import read_text
from materialist.option_kinds import (
    OFF,
    ON,
    OperationOptions,
    beside,
    declarations,
    parse_numbers,
    several,
)
from materialist.options import Drop, Glass, Insertion, MaterialEdit, Relight, Removal
from materialist.threads import fixed_threads
from materialist.types import Array, Scene

OPTIONS: dict[str, type[OperationOptions]] = {
    kind.operation: kind for kind in (MaterialEdit, Relight, Insertion, Drop, Glass, Removal)
}
"""Kind of step -> its options."""
REGION = ("mask", "click", "box", "with")
PLACE = ("mesh", "at")
WHERE = {"insert": PLACE, "drop": PLACE}
"""Kind of step -> what says where it acts; a region for the others."""
KINDS = {
    name: (
        *WHERE.get(name, REGION),
        *(key for key, (declared, _) in declarations(kind).items() if declared.written),
    )
    for name, kind in OPTIONS.items()
}
"""Kind of step -> what it may say."""


@dataclass(frozen=True)
class Step:
    """One edit."""

    kind: str
    """One of KINDS."""
    options: dict[str, Any] = field(default_factory=dict)
    """As in the file: texts, lists of texts, lists of lists."""
    folder: Path = Path(".")
    """What file names in it are relative to."""
    seed: int = field(default=0, compare=False)
    """Where the step names none of its own."""
    device: str = field(default="auto", compare=False)

    @property
    def skipped(self) -> bool:
        """Whether the step is kept in the list without being applied (`skip: true`)."""
        return str(self.options.get("skip", "")).lower() in ON


def read_recipe(path: str | Path) -> list[Step]:
    """The steps of a YAML file; see docs/editing.md. Raises InputError with the step and the key at fault."""
    import yaml

    path = Path(path)
    try:
        if path.stat().st_size > 1_000_000:
            raise InputError(f"{path} is larger than 1 MB; a list of edits is a short text.")
        content = yaml.load(read_text(path), Loader=_loader())
    except UnicodeDecodeError as error:
        raise InputError(
            f"The list of edits {path} is not text in UTF-8; save it as UTF-8."
        ) from error
    except OSError as error:
        raise InputError(f"The list of edits {path} cannot be read: {error}.") from error
    except yaml.YAMLError as error:
        raise InputError(f"{path} is not valid YAML: {' '.join(str(error).split())}.") from error
    # --- Either the list itself, or a mapping with the one key `edits` ---
    unknown = [str(key) for key in content if key != "edits"] if isinstance(content, dict) else []
    if unknown and "edits" in content:
        raise InputError(f"{path} says '{unknown[0]}' beside its edits; it knows edits alone.")
    entries = content.get("edits") if isinstance(content, dict) else content
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f"{path} holds no list of edits; begin each with '- edit:' or '- relight:'."
        )
    return [_step(entry, number, path) for number, entry in enumerate(entries, 1)]


def _loader() -> Any:
    import yaml

    class Texts(yaml.BaseLoader):
        """Scalars stay texts: YAML would read the shift +0.5 as the value 0.5. No key is given twice, and nothing is
        an alias: aliases of aliases can stand for more than memory holds."""

        depth = 0

        def compose_node(self, parent, index):
            self.depth += 1
            if self.check_event(yaml.AliasEvent) or self.depth > 20:  # a list of edits has 7 levels
                said = "an alias (*) or lists nested too deeply; write them out flat"
                raise yaml.composer.ComposerError(None, None, said, self.peek_event().start_mark)
            node = super().compose_node(parent, index)
            self.depth -= 1
            return node

        def construct_mapping(self, node, deep=False):
            names = Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
            # YAML keeps the last of two equal keys without a word.
            twice = [name for name, count in names.items() if count > 1]
            if twice:
                raise yaml.constructor.ConstructorError(
                    None, None, f"'{twice[0]}' is given twice", node.start_mark
                )
            return super().construct_mapping(node, deep)

    return Texts


def _step(entry: Any, number: int, path: Path) -> Step:
    if not isinstance(entry, dict) or len(entry) != 1 or next(iter(entry)) not in KINDS:
        said = (
            f"'{next(iter(entry))}'"
            if isinstance(entry, dict) and len(entry) == 1
            else "not one kind of edit"
        )
        known = ", ".join(KINDS)
        raise InputError(
            f"Step {number} of {path} is {said}; it must be one of {known} with its options below it."
        )
    # --- The step's options: only those that its kind has ---
    kind, options = next(iter(entry.items()))
    if not isinstance(options, dict):
        raise InputError(
            f"Step {number} of {path} has no options; give some of {', '.join(KINDS[kind])}."
        )
    unknown = sorted(set(options) - {*KINDS[kind], "skip"})
    if unknown:
        raise InputError(
            f"Step {number} of {path} says '{unknown[0]}'; {kind} knows {', '.join(KINDS[kind])}."
        )
    if str(options.get("skip", "false")).lower() not in (*ON, *OFF):
        raise InputError(
            f"Step {number} of {path}: The skip must be true or false, not {options['skip']!r}."
        )
    return Step(kind, options, path.parent)


def with_files(step: Step, use: Callable[[str, Any], Any]) -> Step:
    """The step with `use(option, value)` in place of each file that it names; words such as `auto` stay."""
    known = declarations(OPTIONS[step.kind])
    files = {name: declared for name, (declared, _) in known.items() if declared.kind == "file"}
    words = {name: declared.choices for name, declared in files.items()}
    words |= {"mask": (), "mesh": ()}
    options = dict(step.options)
    for name in words.keys() & options:
        values = [
            value if value in words[name] else use(name, value) for value in _listed(options[name])
        ]
        options[name] = values if isinstance(options[name], list) else values[0]
    return replace(step, options=options)


def write_recipe(path: str | Path, steps: list[Step]) -> None:
    """Write steps as a YAML file that `read_recipe` gives back. Raises OutputError when it cannot be written."""
    import yaml

    class Unquoted(yaml.SafeDumper):
        """Texts stay without quotes, also those that spell numbers: `read_recipe` takes all for texts."""

        yaml_implicit_resolvers: dict[Any, Any] = {}

    for kind in (bool, int, float):
        Unquoted.add_representer(
            kind, lambda dumper, value: dumper.represent_str(str(value).lower())
        )
    entries = [{step.kind: step.options} for step in steps]
    text = yaml.dump(
        entries,
        Dumper=Unquoted,
        default_flow_style=None,
        sort_keys=False,
        width=200,
        allow_unicode=True,
    )
    write_whole(path, text)


@fixed_threads()
def apply(
    scene: Scene,
    steps: list[Step],
    *,
    seed: int = 0,
    device: str = "auto",
    onto: Scene | None = None,
) -> Scene:
    """The scene after all steps, in order. Regions are chosen on the original photo, whatever came before.

    seed: of random numbers, for steps that name none. onto: the scene after earlier steps.
    """
    edited = scene if onto is None else onto
    for number, step in enumerate(steps, 1):
        if step.skipped:
            continue
        try:
            edited = _MAKERS.get(step.kind, _in_region)(
                scene, edited, replace(step, seed=seed, device=device)
            )
        except InputError as error:
            raise InputError(f"Step {number} ({step.kind}): {error}") from error
    return edited


def region_of(scene: Scene, step: Step) -> Array:
    """[H, W] bool of the step's mask, click or box. Raises InputError."""
    options = step.options
    where: dict[str, Any] = {}
    if "click" in options:
        where["click"] = [parse_numbers(click, 2, "click") for click in several(options["click"])]
    if "box" in options:
        where["box"] = parse_numbers(options["box"], 4, "box")
    if "mask" in options:
        where["mask"] = beside(step.folder, "mask", options["mask"])
    return select(scene, method=options.get("with", "network"), device=step.device, **where)


def _left(scene: Scene, edited: Scene, region: Array) -> Array:
    """[H, W] bool: what of a region chosen on the original photo earlier steps have not taken away."""
    gone = region & (edited.depth != scene.depth)
    if 2 * gone.sum() > region.sum():
        raise InputError(
            "An earlier step took away what is there; leave this one out, or save the edited scene and edit that one."
        )
    return region & ~gone


def options_of(step: Step) -> Any:
    """The dataclass of the step's options, of what it says beside its region or place. Raises InputError."""
    kind = OPTIONS[step.kind]
    known = declarations(kind)
    shared = {name: getattr(step, name) for name in ("seed", "device") if name in known}
    # Region and place are read elsewhere.
    said = {name: value for name, value in step.options.items() if name in known}
    return kind.read(said, folder=step.folder, **shared)


def _relight(scene: Scene, edited: Scene, step: Step) -> Scene:
    if not step.options:
        raise InputError(
            "A relight changes nothing; give envmap, rotate, sun, lamps, ambient or dim."
        )
    region = [name for name in REGION if name in step.options]
    if region and "dim" not in step.options:
        raise InputError(
            f"relight: {region[0]} says which lights are dimmed; give dim, too, or leave it out."
        )
    options = options_of(step)
    return relight(edited, options, lights=region_of(scene, step) if region else None, fitted=scene)


def _put(scene: Scene, edited: Scene, step: Step) -> Scene:
    """Meshes at places: inserted one by one, or dropped together."""
    for name in PLACE:
        if name not in step.options:
            raise InputError(
                f"The {step.kind} needs its {name}, as in {step.kind}: {{mesh: mug.glb, at: [310, 220]}}."
            )
    options = options_of(step)
    mesh = step.options["mesh"]
    places: list[Any] = [parse_numbers(pair, 2, "at") for pair in several(step.options["at"])]
    if step.kind == "drop":
        files = [beside(step.folder, "mesh", name) for name in _listed(mesh)]
        return settle(edited, files, places, options)
    for place in places:
        edited = insert(edited, beside(step.folder, "mesh", mesh), place, options)
    return edited


def _in_region(scene: Scene, edited: Scene, step: Step) -> Scene:
    """Edits of a region: material, glass, removal."""
    region = _left(scene, edited, region_of(scene, step))
    options = options_of(step)
    if step.kind == "edit":
        return edit(edited, region, options)
    return (glass if step.kind == "glass" else remove)(edited, region, options, fitted=scene)


_MAKERS = {"relight": _relight, "insert": _put, "drop": _put}
"""Kind of step -> (original scene, scene so far, step) -> scene; `_in_region` for the others."""


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) and value else [value]
