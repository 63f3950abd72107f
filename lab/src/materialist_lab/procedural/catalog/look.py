"""What the surfaces of catalogue models are made of, by the names and numbers of their MTL files."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.color import srgb_to_linear

FAMILIES: tuple[tuple[str, str], ...] = (
    ("mirror", r"mirror|miroir|espejo|reflector"),
    ("glass", r"glass|crist|vidr|verre|water|agua|liquid|transpar|lens|window|pane"),
    ("screen", r"screen|display|pantalla|lcd|monitor"),
    ("bulb", r"bulb|flame|ampoul|bombilla|neon|emit|lumier|^light$|^lights$|fluoresc"),
    (
        "cloth",
        r"fabric|cloth|tissu|cushion|pillow|mattress|matela|sheet|tela|couch|sofa|curtain|towel|carpet|rug|"
        r"velvet|cotton|coussin|seat|cojin|shade|wool|felt|hair|fur|blanket|cover|upper|lower|shirt|short|jean",
    ),
    ("leather", r"leather|cuir|piel|cuero"),
    (
        "paint",
        r"(white|black).?metal|metal.?(white|black|red|blue|green)|paint|lacquer|(white|black)(ex|in)terior",
    ),
    (
        "metal",
        r"metal|chrome|cromo|alum|steel|acero|inox|brass|gold|silver|iron|hierro|copper|handle|screw|nickel|"
        r"argent|zinc|tap$|faucet|bronze|blade|spring|fork|knife|spoon",
    ),
    (
        "wood",
        r"wood|madera|bois|oak|teak|pear|alder|walnut|pine|parquet|plank|trunk|bark|branch|wicker|rattan|cane|"
        r"roble|wenge|haya|tabla|drawer|cabinet|cupboard|legs|table|bambu|bamboo",
    ),
    (
        "ceramic",
        r"ceramic|porcel|china|vase|plate|toilet|basin|bath|tile|enamel|cup|bowl|sink|pot$|^pot",
    ),
    ("leaf", r"leaf|leaves|hoja|plant|petal|flower|grass|stem|needle|green$|tallo|flor"),
    ("skin", r"skin|face|head|hand|body_|lips|rlskin"),
    ("rubber", r"rubber|tire|tyre|caucho|goma|wheel"),
    (
        "stone",
        r"stone|marble|granit|concrete|brick|rock|worktop|counter|soil|sand|terra|clay|pottery|marmol",
    ),
    ("paper", r"paper|book|card|page|label|box|news"),
    ("plastic", r"plast|button|knob|key|switch|cable|wire"),
)
"""Family of materials -> the names that speak of it, the first one that fits."""
_COMPILED = tuple((family, re.compile(pattern)) for family, pattern in FAMILIES)
CLEAR = 0.75
"""Opacity below which a surface is glass."""


@dataclass(frozen=True)
class CatalogLook:
    """One material of a model."""

    family: str
    """One of FAMILIES, or 'other'."""
    colour: tuple[float, float, float]
    """Linear; of a textured one the mean of its picture."""
    shine: float
    """Roughness by the file's exponent of highlights, in [0, 1]."""
    picture: str
    """Name of its picture in the cache, or nothing."""
    clear: bool
    """Whether one sees through it."""


def catalog_look(
    name: str, mtl: dict[str, Any], picture: str, mean: tuple[float, float, float] | None
) -> CatalogLook:
    """The look of a material by its name and the entries of its MTL, as trimesh gives them."""
    family = _family(name)
    # MTL: d is opacity, kd and ks diffuse and specular colour, ns the exponent of highlights.
    opacity = _number(mtl.get("d"), 1.0)
    kd = np.clip(np.asarray(mtl.get("kd", (0.6, 0.6, 0.6)), float)[:3], 0, 1)
    ks = float(np.max(np.asarray(mtl.get("ks", (0, 0, 0)), float)[:3], initial=0.0))
    exponent = min(max(_number(mtl.get("ns"), 0.0), 0.0), 1000.0)
    # The usual match of Phong and microfacets: alpha^2 = 2 / (n + 2), roughness = sqrt(alpha).
    shine = (2 / (exponent + 2)) ** 0.25
    # No highlight at all: matt, whatever the exponent says.
    if ks < 0.02:
        shine = max(shine, 0.75)
    colour = mean or tuple(srgb_to_linear(kd).tolist())
    return CatalogLook(family, colour, float(shine), picture, opacity < CLEAR)  # type: ignore[arg-type]


def _family(name: str) -> str:
    # The first family that fits: "painted metal" is paint.
    plain = name.lower()
    return next((family for family, pattern in _COMPILED if pattern.search(plain)), "other")


def _number(value: Any, default: float) -> float:
    try:
        return float(value[0] if isinstance(value, list) else value)
    except (TypeError, ValueError, IndexError):
        return default
