"""A list of edits as a file, so that they can be replayed and batched: `materialist apply SCENE edits.yaml`."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from materialist.edits.core.operation import PLACE, Operation, Placement, Target
from materialist.edits.registry import OPERATIONS
from materialist.edits.select.select import select
from materialist.errors import InputError, OutputError
from materialist.io.atomic import write_whole
from materialist.io.text import read_text
from materialist.option_kinds import OFF, ON, beside, declarations, parse_numbers, several
from materialist.types import Array, Scene

MAX_BYTES = 1_000_000
"""Of a list of edits: an ordinary one has a few thousand."""


@dataclass(frozen=True)
class Step:
    """One edit."""

    kind: str
    """The name of its operation."""
    options: dict[str, Any] = field(default_factory=dict)
    """What it says, as in the file: texts, lists of texts, lists of lists."""
    folder: Path = Path(".")
    """What file names in it are relative to."""
    seed: int = field(default=0, compare=False)
    """Where the step names none of its own."""
    device: str = field(default="auto", compare=False)

    @property
    def operation(self) -> Operation:
        return OPERATIONS[self.kind]

    @property
    def skipped(self) -> bool:
        """Whether the step is kept in the list without being applied (`skip: true`)."""
        return str(self.options.get("skip", "")).lower() in ON


def read_recipe(path: str | Path) -> list[Step]:
    """The steps of a YAML file; see docs/editing.md. Raises InputError with the step and the key at fault."""
    import yaml

    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
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
    if not isinstance(entry, dict) or len(entry) != 1 or next(iter(entry)) not in OPERATIONS:
        said = (
            f"'{next(iter(entry))}'"
            if isinstance(entry, dict) and len(entry) == 1
            else "not one kind of edit"
        )
        known = ", ".join(OPERATIONS)
        raise InputError(
            f"Step {number} of {path} is {said}; it must be one of {known} with its options below it."
        )
    # --- The step's options: only those that its kind has ---
    kind, options = next(iter(entry.items()))
    keys = OPERATIONS[kind].keys
    if not isinstance(options, dict):
        raise InputError(f"Step {number} of {path} has no options; give some of {', '.join(keys)}.")
    unknown = sorted(set(options) - {*keys, "skip"})
    if unknown:
        raise InputError(
            f"Step {number} of {path} says '{unknown[0]}'; {kind} knows {', '.join(keys)}."
        )
    for name in ("skip", "same_material"):
        if str(options.get(name, "false")).lower() not in (*ON, *OFF):
            raise InputError(
                f"Step {number} of {path}: The {name} must be true or false, not {options[name]!r}."
            )
    return Step(kind, options, path.parent)


def with_files(step: Step, use: Callable[[str, Any], Any]) -> Step:
    """The step with `use(option, value)` in place of each file that it names; words such as `auto` stay."""
    known = declarations(step.operation.options)
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
    """Write steps as a YAML file that `read_recipe` gives back.

    Raises OutputError when it cannot be written, or would be larger than `read_recipe` takes.
    """
    import yaml

    # All values are texts on reading, so that none of them needs quotes.
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
    ).encode()
    if len(text) > MAX_BYTES:
        raise OutputError(
            f"{path} would have {len(text) / 1e6:.2g} MB; a list of edits may have 1 MB: take some away first."
        )
    write_whole(path, text)


def check_libraries(steps: list[Step]) -> None:
    """Raise SetupError where a step needs a library that is not installed: before any step is applied."""
    for step in steps:
        if step.operation.check_libraries is not None and not step.skipped:
            step.operation.check_libraries()


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
    check_libraries(steps)
    edited = scene if onto is None else onto
    for number, step in enumerate(steps, 1):
        if step.skipped:
            continue
        try:
            edited = _applied(scene, edited, replace(step, seed=seed, device=device))
        except InputError as error:
            raise InputError(f"Step {number} ({step.kind}): {error}") from error
    return edited


def _applied(scene: Scene, edited: Scene, step: Step) -> Scene:
    """The scene so far after one more step; `scene` is the original one."""
    target = _target(scene, edited, step)
    return step.operation.apply(edited, target, options_of(step), scene)


def _target(scene: Scene, edited: Scene, step: Step) -> Any:
    """What a step acts on: a `Placement`, a region, or None for the light as a whole. Raises InputError."""
    operation = step.operation
    if operation.target is Target.PLACE:
        return _placement(step)
    if operation.target is Target.REGION:
        return _left(scene, edited, region_of(scene, step))
    if not step.options:
        raise InputError(f"A {step.kind} changes nothing; give {', '.join(operation.needed)}.")
    marked = any(key in step.options for key in operation.target.keys)
    return region_of(scene, step) if marked else None


def _placement(step: Step) -> Placement:
    for name in PLACE:
        if name not in step.options:
            raise InputError(
                f"The {step.kind} needs its {name}, as in {step.kind}: {{mesh: mug.glb, at: [310, 220]}}."
            )
    meshes = _listed(step.options["mesh"])
    places = several(step.options["at"])
    return Placement(
        tuple(beside(step.folder, "mesh", mesh) for mesh in meshes),
        tuple(parse_numbers(place, 2, "at") for place in places),
    )


def region_of(scene: Scene, step: Step) -> Array:
    """[H, W] bool of the step's mask, click or box. Raises InputError."""
    options = step.options
    where: dict[str, Any] = {}
    for name in ("click", "exclude"):
        if name in options:
            where[name] = [parse_numbers(pixel, 2, name) for pixel in several(options[name])]
    if "box" in options:
        where["box"] = parse_numbers(options["box"], 4, "box")
    if "mask" in options:
        where["mask"] = beside(step.folder, "mask", options["mask"])
    where["same_material"] = str(options.get("same_material", "false")).lower() in ON
    names = {"method": "with", "extent": "extent"}
    where |= {name: options[key] for name, key in names.items() if key in options}
    return select(scene, device=step.device, **where)


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
    kind = step.operation.options
    known = declarations(kind)
    shared = {name: getattr(step, name) for name in ("seed", "device") if name in known}
    # Region and place are read elsewhere.
    named = {name: value for name, value in step.options.items() if name in known}
    return kind.read(named, folder=step.folder, **shared)


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) and value else [value]
