"""Materials for the surfaces of models: what the catalogue says, varied, and relief that its meshes lack."""

from dataclasses import dataclass, replace

import numpy as np

from materialist.types import Array
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.catalog.look import CatalogLook
from materialist_lab.procedural.materials import Colour, ColourPicture, Material
from materialist_lab.procedural.relief import Relief
from materialist_lab.procedural.staged.stock import Stock

ROUGHNESS: dict[str, tuple[float, float]] = {
    "mirror": (0.05, 0.06),
    "glass": (0.05, 0.15),
    "bulb": (0.2, 0.5),
    "cloth": (0.65, 1.0),
    "leather": (0.3, 0.6),
    "paint": (0.12, 0.55),
    "metal": (0.1, 0.45),
    "wood": (0.2, 0.75),
    "ceramic": (0.06, 0.4),
    "leaf": (0.3, 0.65),
    "skin": (0.4, 0.65),
    "rubber": (0.5, 0.9),
    "stone": (0.25, 0.95),
    "paper": (0.45, 0.95),
    "plastic": (0.12, 0.6),
    "screen": (0.06, 0.3),
    "other": (0.2, 0.7),
}
OUR_FINISHES: dict[str, tuple[m.Maker, ...]] = {
    "wood": (m.wood,),
    "cloth": (m.fabric, m.woven),
    "stone": (m.stone,),
    "ceramic": (m.ceramic,),
    "other": (m.plastic, m.lacquer, m.ceramic),
}
"""What a plain surface of a family may also be."""


EMBOSS = {"cloth": 0.002, "wood": 0.0015, "stone": 0.003}
"""Largest height of the relief of tiles, metres."""


@dataclass(frozen=True)
class ReliefRange:
    """Solid noise of a family of materials."""

    share: float
    kinds: str
    size: tuple[float, float]
    """Metres of a block, log-uniform."""
    slope: tuple[float, float]


RELIEFS: dict[str, tuple[ReliefRange, ...]] = {
    "cloth": (
        ReliefRange(0.4, "folds", (0.25, 0.9), (0.1, 0.35)),
        ReliefRange(0.35, "rough grain hair", (0.02, 0.1), (0.1, 0.4)),
    ),
    "leather": (ReliefRange(0.6, "hammered grain", (0.03, 0.15), (0.06, 0.25)),),
    "wood": (ReliefRange(0.3, "hair rough", (0.1, 0.4), (0.04, 0.15)),),
    "stone": (ReliefRange(0.7, "rough ridges hammered grain", (0.05, 0.6), (0.1, 0.5)),),
    "ceramic": (ReliefRange(0.25, "rough hammered grain", (0.08, 0.5), (0.03, 0.2)),),
    "metal": (ReliefRange(0.25, "hammered rough grain", (0.05, 0.4), (0.03, 0.25)),),
    "rubber": (ReliefRange(0.5, "grain", (0.02, 0.1), (0.1, 0.3)),),
    "leaf": (ReliefRange(0.4, "folds rough", (0.04, 0.2), (0.1, 0.3)),),
    "skin": (ReliefRange(0.3, "grain", (0.02, 0.06), (0.05, 0.15)),),
    "plastic": (ReliefRange(0.15, "grain", (0.01, 0.05), (0.04, 0.15)),),
    "paint": (ReliefRange(0.2, "grain rough", (0.02, 0.2), (0.03, 0.12)),),
    "other": (ReliefRange(0.2, "rough grain", (0.05, 0.4), (0.05, 0.2)),),
}


def relief_of(rng: np.random.Generator, family: str, scale: float = 1.0) -> Relief | None:
    """Relief that suits a family, its size times `scale`; often none."""
    for choice in RELIEFS.get(family, ()):
        if rng.random() < choice.share:
            size = scale * float(np.exp(rng.uniform(*np.log(choice.size))))
            stretch = np.exp(rng.normal(0, 0.25, 3)) if rng.random() < 0.5 else np.ones(3)
            x, y, z = (size * stretch).tolist()
            kind = str(rng.choice(choice.kinds.split()))
            return Relief(kind, (x, y, z), rng.uniform(*choice.slope))
    return None


@dataclass(frozen=True)
class Style:
    """How one instance of a model differs from the catalogue."""

    gain: Array
    """[3] on colours."""
    gloss: float
    """Added to roughness."""
    has_own_finish: bool
    """Whether plain surfaces get finishes of our own."""
    bumpy: float
    """Probability of relief."""


def style(rng: np.random.Generator) -> Style:
    """A random variant; all surfaces of one instance share it."""
    even = np.exp(rng.normal(0, 0.3)) if rng.random() < 0.6 else 1.0
    tint = np.exp(rng.normal(0, 0.25, 3)) if rng.random() < 0.3 else np.ones(3)
    gloss = rng.normal(0, 0.08)
    has_own_finish = rng.random() < 0.6
    return Style(even * tint, gloss, has_own_finish, rng.choice([0.0, 1.0], p=[0.3, 0.7]))


def finish(
    rng: np.random.Generator,
    look: CatalogLook,
    picture: ColourPicture | None,
    variant: Style,
    stock: Stock,
) -> Material:
    """The material of one surface of a model."""
    # --- Roughness and relief ---
    family = look.family
    if family == "mirror":
        return m.uniform((0.9, 0.9, 0.9), 0.05, 1.0)
    # The catalogue's shine is a hint only: most comes from the family's range.
    low, high = ROUGHNESS[family]
    rough = 0.75 * rng.uniform(low, high) + 0.25 * np.clip(look.shine, low, high) + variant.gloss
    rough = float(np.clip(rough, 0.06, 1.0))
    relief = relief_of(rng, family) if rng.random() < variant.bumpy else None
    # --- A picture of the model's own, a finish of ours, or one colour ---
    if picture is not None:
        return replace(pictured(picture, variant.gain, rough), relief=relief)
    if variant.has_own_finish and rng.random() < 0.7:
        material = _own_finish(rng, family, stock)
        if material is not None:
            return replace(material, relief=relief)
    metallic = 0.0
    colour = np.clip(np.array(look.colour) * variant.gain, 0.015, 0.85)
    if family == "metal":
        metallic, colour = _metal(rng, colour)
    material = m.uniform(_triple(colour), rough, metallic, grain=rng.uniform(0, 0.15))
    second = float(np.clip(rough + rng.uniform(0, 0.15), 0.06, 1))
    return replace(material, roughness=(rough, second), repeat=(0.6, 0.6), relief=relief)


def pictured(picture: ColourPicture, gain: Array, rough: float) -> Material:
    """A material whose picture lies by the texture coordinates of a model: v points up."""
    # The picture is the albedo; the colour is a factor on it.
    colour = _triple(np.clip(gain, 0.3, 1.4))
    return Material(
        0,
        (colour,) * 3,
        0.0,
        (rough, min(rough + 0.1, 1.0)),
        (0.0, 0.0),
        repeat=(1.0, -1.0),
        offset=(0.0, 0.0),
        picture=picture,
    )


def covered(rng: np.random.Generator, picture: ColourPicture, size: float, family: str) -> Material:
    """A material whose picture repeats every `size` metres, on surfaces with texture coordinates in metres."""
    h, w = picture.pixels.shape[:2]
    rough = rng.uniform(*ROUGHNESS[family])
    material = pictured(picture, np.exp(rng.normal(0, 0.2)) * np.ones(3), rough)
    turn = rng.choice([0, np.pi / 2]) if rng.random() < 0.3 else 0.0
    relief = relief_of(rng, family)
    return replace(material, repeat=(size, -size * h / w), turn=turn, offset=None, relief=relief)


def _own_finish(rng: np.random.Generator, family: str, stock: Stock) -> Material | None:
    """A finish of ours, or a picture from another model; None for families that stay as they are."""
    if family not in OUR_FINISHES or (family == "other" and rng.random() < 0.6):
        return None
    # A picture of the same family, of another model.
    if rng.random() < 0.5 and family != "ceramic":
        picture = stock.texture(rng, family)
        if picture is not None:
            return covered(rng, picture, rng.uniform(0.3, 1.2), family)
    makers = OUR_FINISHES[family]
    material = makers[rng.integers(len(makers))](rng)
    return replace(material, emboss=rng.uniform(0, EMBOSS.get(family, 0.0)))


def _metal(rng: np.random.Generator, colour: Array) -> tuple[float, Array]:
    """(metallic, colour) of what the catalogue calls a metal: painted where its colour is none of a metal."""
    # No metal is green or blue: that is paint.
    saturation = float(np.ptp(colour) / max(colour.max(), 1e-6))
    warm = colour[0] >= colour[1] >= colour[2]
    if (saturation > 0.35 and not warm) or rng.random() < 0.12:
        return 0.0, colour
    # Grey says metal, not which: silver, steel or iron.
    if saturation < 0.2:
        colour = np.array(m.METALS[rng.choice([0, 1, 1, 5])]) * rng.uniform(0.8, 1.0)
    return 1.0, np.clip(colour / colour.max() * rng.uniform(0.5, 0.95), 0.02, 0.95)


def _triple(colour: Array) -> Colour:
    r, g, b = (float(c) for c in colour)
    return r, g, b
