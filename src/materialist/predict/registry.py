"""Predictors by name."""

from importlib import import_module

from materialist.errors import InputError
from materialist.predict.protocol import MAPS, MixedPredictor, Predictor
from materialist.types import Prior

CHOICES = (
    "auto, bundled[:FILE], matnet[:FILE], marigold, depth-anything, moge:DIR, maps:DIR, constant"
)
CLASSES = {
    "auto": "bundled.predictor:BundledPredictor",
    "bundled": "bundled.predictor:BundledPredictor",
    "matnet": "matnet.predictor:MatNetPredictor",
    "marigold": "hub:open_marigold",
    "depth-anything": "hub:DepthAnything",
    "moge": "maps:MogeFolder",
    "maps": "maps:MapsPredictor",
    "constant": "protocol:ConstantPredictor",
}
"""Name before the colon of a spec -> module and what makes it of the text behind the colon."""
NETWORKS = ("auto", "bundled", "matnet", "marigold", "depth-anything")
"""Names of predictors that compute on a device."""
ARRAYS = "arrays"
"""What the source of known maps is called."""


def get_predictor(
    spec: str = "auto", *, device: str = "auto", prior: Prior | None = None, **parts: str | None
) -> Predictor:
    """The predictor named by `spec`, one of `CHOICES`, with single maps from others where `parts` says so.

    `parts`: albedo, roughness, metallic, normal or depth = the spec of the source of this map alone, as in
    `get_predictor("matnet", albedo="marigold")`; None means `spec`. Nothing is ever downloaded here.
    `prior`: maps that are known; they go before every source, and a source that nothing is left for is not opened.

    Raises InputError for an unknown name, a folder that is not there, or a source that does not give its map;
    SetupError where an optional library is missing, WeightsError where weights are missing or damaged.
    """
    if unknown := [name for name in parts if name not in MAPS]:
        raise InputError(
            f"There is no map '{unknown[0]}'; a predictor can be named for {', '.join(MAPS)}."
        )
    known = {} if prior is None else prior.known
    if twice := [name for name in known if parts.get(name)]:
        raise InputError(
            f"The {twice[0]} is in the prior and has a predictor of its own; leave one of them out."
        )
    # --- Which source gives which map: known arrays, then a map's own spec, then the common one ---
    chosen = {name: ARRAYS if name in known else parts.get(name) or spec for name in MAPS}
    # --- Each source is opened once, however many maps it gives ---
    sources = {
        source_spec: _source(source_spec, device, prior)
        for source_spec in dict.fromkeys(chosen.values())
    }
    for source_spec, source in sources.items():
        if lacking := [
            name for name in MAPS if chosen[name] == source_spec and name not in source.gives
        ]:
            options = ", ".join(f'`{name}="{source_spec}"`' for name in source.gives)
            raise InputError(
                f"'{source_spec}' gives only {', '.join(source.gives)}, not {lacking[0]}: use it beside another "
                f"predictor, with {options}."
            )
    predictor = (
        MixedPredictor(chosen, sources) if len(sources) > 1 else next(iter(sources.values()))
    )
    predictor.prepare(MAPS)
    return predictor


def parsed(spec: str) -> tuple[str, str]:
    """Name of a predictor, and what follows its colon. Raises InputError for an unknown name."""
    name, _, argument = spec.partition(":")
    if name not in CLASSES or (argument and name in ("auto", "constant")):
        raise InputError(f"There is no predictor '{spec}'; choose one of {CHOICES}.")
    return name, argument


def _source(spec: str, device: str, prior: Prior | None) -> Predictor:
    """The predictor of one source, or the known maps. Raises as `get_predictor`."""
    if spec != ARRAYS or prior is None:
        return _open(spec, device)
    from materialist.predict.maps import ArraysPredictor

    return ArraysPredictor(prior)


def _open(spec: str, device: str) -> Predictor:
    """The predictor of one source. Raises as `get_predictor`."""
    name, argument = parsed(spec)
    module, _, kind = CLASSES[name].partition(":")
    make = getattr(import_module(f"materialist.predict.{module}"), kind)
    if name == "constant":
        return make()
    return make(argument, device=device) if name in NETWORKS else make(argument)
