"""The studio: the public API behind a web page, for people who never open a terminal. It holds no logic of its own.

The page (`darkroom`) turns clicks into calls of a `session.Session`; what takes long is a function of `tasks` that
`jobs` runs in a process of its own, which can be stopped at any time. Scenes and edits lie in a `workspace.WorkFolder`.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True)
class StudioSettings:
    """Limits and sizes of the studio; tuned by eye."""

    # What one sender may send and keep.
    upload_megabytes: float = 60  # largest upload
    request_bytes: int = 2_000_000  # largest body of any other request
    upload_pixels: int = 60_000_000  # largest picture, from its header
    storage_quota: int = 3_000_000_000  # bytes that one address may store in an hour, uploads and what they unpack to
    disk_left: int = 2_000_000_000  # bytes of the disk that stay free
    opening_memory: int = 2_000_000_000  # bytes of data of the process that opens an upload
    opening_seconds: float = 30.0  # in which it must be done
    openings: int = 3  # uploads opened at a time, one of each sender; falls count among them
    uploads: int = 8  # that one sender sends at a time
    body_seconds: float = 60.0  # in which the next part of an upload must come
    pages: int = 40  # that one sender has open
    channels: int = 4  # of one page; after a reload the one before may still be closing
    message_bytes: int = 4096  # largest message of a page; none is expected
    connections: int = 200  # of one address
    request_seconds: float = 30.0  # in which a new connection must have sent a request
    requests: int = 12  # of one sender at a time; `openings` senders leave some of 40 threads
    # What is read of it.
    edit_pixels: int = 8_000_000  # largest picture of an edit, to which a larger one is shrunk
    mesh_faces: int = 200_000  # of an object's mesh
    scene_pixels: int = 1_500_000  # largest zipped scene, at working size
    fall_seconds: float = 60.0  # in which a thing must have come to rest
    job_memory: int = 10_000_000_000  # bytes of data of a fit or a rendering
    job_seconds: float = 3600.0  # in which it must be done
    edits: int = 200  # longest list of edits of a photo
    unpacked_bytes: int = 1_500_000_000  # largest zip once unpacked
    decoded_bytes: int = 1_000_000_000  # largest zipped scene in memory, by its files' headers
    # Who may work at a time.
    jobs_a_person: int = 6  # that wait or run, counted by address: people behind one share them
    jobs: int = 60  # of all
    wrong_passwords: int = 20  # a minute, of one address
    addresses: int = 10_000  # whose wrong passwords are remembered
    people: int = 10_000  # whose last photo is remembered
    person_seconds: int = 31_536_000  # a browser stays the same person: a year
    # After which idle things are forgotten.
    page_seconds: float = 60.0  # since the last request of a page whose channel is closed
    unfinished_seconds: float = 86_400.0  # photos not taken apart to the end, uploads, results
    # Bytes of memory that must be free.
    free_for_scene: float = 0.8e9  # before another scene is opened, and
    free_a_pixel: float = 2600.0  # for each of its pixels at working size; from 1.2 megapixels
    free_for_glass: float = 2.0e9  # before glass is traced
    # The processes that wait for the next photo.
    ready_seconds: float = 300.0  # after which they end
    # The process of a photo's live preview.
    preview_idle: float = 900.0  # seconds without a question after which it ends
    # The process that traces glass.
    glass_idle: float = 900.0  # seconds without a request after which it ends
    glass_niceness: int = 3  # between previews and inversions: somebody waits at a slider
    glass_bodies: int = 2  # that it keeps: going between two objects builds nothing anew
    # The live preview.
    quiet_seconds: float = 1.5  # since the last picture, before another light is prepared
    undo_steps: int = 60  # length of the undo history
    scenes_kept: int = 24  # edited scenes: moving the last step must not replay those before
    kept_bytes: float = 3e8  # of the bodies in them
    triangles: int = 12_000  # of all bodies in a sketch; of a finer mesh every n-th
    drawn_pixels: int = 300_000  # of a region that the page shades, which takes 150 bytes of each
    jpeg_quality: int = 88  # of live pictures
    video_frames: int = 24  # of the turning light
    lamp_share: float = 0.75  # of the way from the camera to the surface: there a new lamp hangs


SETTINGS = StudioSettings()


@cache
def asset(name: str) -> str:
    """The text of a file in assets."""
    return (files("materialist.studio") / "assets" / name).read_text("utf-8")
