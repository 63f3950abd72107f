"""The plan of a batch: which photos are finished, and which tasks are left."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from materialist.batches.edits import edits_key
from materialist.batches.ledger import Ledger
from materialist.batches.photos import Listed, unique_names
from materialist.batches.remote import fingerprint
from materialist.batches.results import file_hash, package_size
from materialist.batches.task import OF_THE_SCENE, PhotoTask
from materialist.errors import InputError
from materialist.options import InvertOptions
from materialist.predict.protocol import MAPS
from materialist.predict.registry import parsed


def check_options(options: dict[str, Any]) -> None:
    """Refuse options that would fail every photo in the same way. Raises InputError."""
    InvertOptions.merged(**options)
    for part in ("predictor", *MAPS):
        if options.get(part) is not None:
            parsed(str(options[part]))
    try:
        json.dumps(options)
    except TypeError as error:
        raise InputError(
            f"The options of a batch are written down, so they must be texts and numbers: {error}."
        ) from error


def plan(photos: list[Listed], ledger: Ledger, template: PhotoTask) -> list[PhotoTask]:
    """Tasks for the unfinished photos; `template` holds the common fields of all tasks.

    A photo is finished when the ledger says so with the same options, the photo (by hash) and the edits are what they
    were, and the results are whole. Where only the edit is missing or another, the task keeps the scene.
    """
    known = {id: entry["name"] for id, entry in ledger.last.items()}
    names = unique_names([photo.id for photo in photos], known)

    def left(photo: Listed) -> PhotoTask | None:
        task = replace(template, id=photo.id, name=names[photo.id], location=photo.location)
        entry = ledger.last.get(photo.id, {})
        if entry.get("key") != ledger.key or not _inverted(entry, task):
            return task
        return (
            None
            if _edited(entry, task)
            else replace(task, kept={k: entry[k] for k in OF_THE_SCENE if k in entry})
        )

    with ThreadPoolExecutor(
        8
    ) as threads:  # reading and hashing: the disk's time, not the interpreter's
        return [task for task in threads.map(left, photos) if task is not None]


def _inverted(entry: dict[str, Any], task: PhotoTask) -> bool:
    """Whether the scene of the ledger's last entry is there, whole, and of the photo as it is now."""
    size = entry.get("scene_bytes")
    version = entry.get("photo_version")
    return (
        bool(size and version)
        and size == package_size(task.scene)
        and version == fingerprint(task.location)
    )


def _edited(entry: dict[str, Any], task: PhotoTask) -> bool:
    """Whether nothing is to be edited, or the edited photo is there and of the same edits."""
    if entry.get("event") != "done" or task.batch_options.recipe is None:
        return entry.get("event") == "done"
    try:
        same = entry.get("edits") == edits_key(
            task.batch_options.recipe, task.name, task.batch_options.spp, task.batch_options.quality
        )
        return same and entry.get("picture_hash") == file_hash(task.picture)
    except OSError:
        return False
