"""What catalogue models are for: where they stand in a room."""

import re

from materialist_lab.procedural.catalog.archive import CatalogEntry

LEFT_OUT = re.compile(
    r"arrow|parking|crossing|sidewalk|rails|swimming|sandpit|jacuzzi|escalator|staircase|elevator|bill |eyelash|"
    r"glasses?$|pane|window|glass door|cocktail|aquarium|beer glass|contemporary living|doll house|curtain|"
    r"diving|football goal|basketball net|fountain|shadow|socket|plug|dimmer|plate, glass",
    re.IGNORECASE,
)
NAMES: tuple[tuple[str, str], ...] = (
    ("chair", r"\bchair|stool|class seat|armchair ottoman"),
    ("sofa", r"sofa|couch|armchair|futon$|puff|day bed"),
    ("bed", r"\bbed\b|crib|bunk|mezzanine|captain's bed"),
    ("rug", r"rug|carpet|doormat|bathmat|tatami"),
    ("table", r"table$|table on|table with|\bdesk\b|island$|vanity"),
    ("shelf", r"shel|bookcase|stand$"),
)
_NAMES = tuple((role, re.compile(pattern, re.IGNORECASE)) for role, pattern in NAMES)


def role_of(entry: CatalogEntry) -> str | None:
    """The role of a model, None for those that are not used.

    Storage: what stands by walls. Small: things on tables. Thing: things on floors.
    """
    width, height, depth = entry.size
    if LEFT_OUT.search(entry.name) or entry.category in ("Doors and windows", "Staircases"):
        return None
    if max(entry.size) < 0.03 or (min(width, depth) < 0.004 and entry.elevation == 0):
        return None
    if entry.category == "Vehicles":
        return "vehicle" if max(entry.size) < 7 else None
    if entry.category == "Characters":
        return "person"
    if entry.elevation > 0.1:
        return "ceiling" if _hangs(entry) else "wall"
    if entry.category == "Exterior":
        return "outdoor" if max(entry.size) < 9 else None
    if entry.category == "Lights":
        return "lamp" if height < 1.7 else None
    for role, pattern in _NAMES:
        if pattern.search(entry.name) and max(entry.size) > 0.3:
            return role
    if max(width, depth) < 0.5 and height < 0.55:
        return "small"
    return "storage" if min(width, height) > 0.4 and height < 2.4 else "thing"


def _hangs(entry: CatalogEntry) -> bool:
    lamps = entry.category == "Lights" and "wall" not in entry.name.lower()
    return entry.elevation + entry.size[1] > 2.2 and (lamps or "fan" in entry.name.lower())
