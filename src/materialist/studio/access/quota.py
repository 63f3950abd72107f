"""What one sender may store, open and have computed at a time. A sender is the address that requests come from."""

import ipaddress
import shutil
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from materialist.errors import InputError
from materialist.studio import SETTINGS

HOUR = 3600.0
"""Seconds."""
MIN_BYTES = 65_536
"""Bytes that a file counts at least: very many small ones would fill a disk, too."""


@dataclass(eq=False)
class Claim:
    """Bytes that a sender stores, or is about to."""

    time: float
    """When, by the monotonic clock."""
    size: int


class Quota:
    """Bytes that each sender stored within the last hour, and files that are being opened.

    Its methods may be called from any thread.
    """

    def __init__(self, *places: Path, patient: bool = False) -> None:
        """places: folders whose disks must not be filled.

        patient: whether a file waits for the one that is being opened, as on one's own machine; strangers are refused.
        """
        self.places = places
        self._patient = patient
        self._turn = threading.Lock()
        self._claims: dict[str, deque[Claim]] = {}
        self._running: Counter[tuple[str, str]] = Counter()
        """(What is done, for which sender) -> how often at present."""
        self._lock = threading.Lock()

    def claim(self, sender: str, size: int) -> "Claim":
        """Count bytes that a sender is about to store.

        Raises InputError above what one sender may store within an hour, and where the disk is full.
        """
        size = max(size, MIN_BYTES)
        with self._lock:
            if self._stored(sender) + size > SETTINGS.storage_quota:
                limit = f"{SETTINGS.storage_quota / 1e9:g} GB"
                raise InputError(f"You have stored {limit} here within an hour; go on later.")
            self.check_disk(size)
            claim = Claim(time.monotonic(), size)
            self._claims.setdefault(sender, deque()).append(claim)
            return claim

    def settle(self, claim: "Claim", stored: int) -> None:
        """Let a claim count what was stored of it, at least MIN_BYTES where that is anything."""
        with self._lock:
            claim.size = min(claim.size, max(stored, MIN_BYTES) if stored else 0)

    def _stored(self, sender: str) -> int:
        """Bytes of the last hour; senders who stored nothing in it are forgotten."""
        hour_ago = time.monotonic() - HOUR
        for who in list(self._claims):
            claims = self._claims[who]
            while claims and claims[0].time < hour_ago:
                # Claims come in the order of their time.
                claims.popleft()
            if not claims:
                del self._claims[who]
        return sum(claim.size for claim in self._claims.get(sender, ()))

    def check_disk(self, size: int = 0) -> None:
        """Raise InputError where so many bytes more would fill a disk."""
        # Of several disks the fullest decides.
        free = min(shutil.disk_usage(place).free for place in self.places)
        if free - size < SETTINGS.disk_left:
            raise InputError("The disk of the studio is full; it takes no more files.")

    @contextmanager
    def opening(self, sender: str) -> Iterator[None]:
        """A place among the few files that are opened at a time. Raises InputError where there is none."""
        refusal = "Another file from your address is being opened; wait until it is there, then send this one again."
        turn = self._patient and self._turn.acquire(timeout=SETTINGS.opening_seconds)
        try:
            with self._place("opening", sender, 1, refusal):
                with self._lock:
                    opening = sum(
                        count
                        for (activity, _), count in self._running.items()
                        if activity == "opening"
                    )
                # Checked after counting oneself: two at once cannot both pass.
                if opening > SETTINGS.openings:
                    raise InputError(
                        "The studio is opening the files of others; try again in a moment."
                    )
                yield
        finally:
            if turn:
                self._turn.release()

    @contextmanager
    def uploading(self, sender: str) -> Iterator[None]:
        """A place among the uploads of a sender. Raises InputError where there is none."""
        with self._place(
            "upload", sender, SETTINGS.uploads, "Too many uploads at once; send them one by one."
        ):
            yield

    @contextmanager
    def request(self, sender: str) -> Iterator[None]:
        """A place among the requests of a sender. Raises InputError where there is none."""
        with self._place(
            "request", sender, SETTINGS.requests, "Too many changes at once; wait for the picture."
        ):
            yield

    @contextmanager
    def _place(self, activity: str, sender: str, limit: int, refusal: str) -> Iterator[None]:
        """One of the `limit` times that something may be done for a sender at once. Raises InputError: refusal."""
        # Counted before the work begins: two requests at once cannot both pass.
        key = (activity, sender)
        with self._lock:
            if self._running[key] >= limit:
                raise InputError(refusal)
            self._running[key] += 1
        try:
            yield
        finally:
            with self._lock:
                self._running[key] -= 1
                if not self._running[key]:
                    del self._running[key]


class Allowance:
    """The quota of one person, for whoever works for them; of their sender at the time of each call."""

    def __init__(self, quota: Quota | None = None, sender: Callable[[], str] = str) -> None:
        """sender: gives the person's sender. Without a quota everything is allowed."""
        self._quota = quota
        self._sender = sender

    def claim(self, size: int) -> None:
        """Count bytes that are about to be stored; raises InputError as `Quota.claim`."""
        if self._quota is not None:
            self._quota.claim(self._sender(), size)

    @contextmanager
    def opening(self) -> Iterator[None]:
        """As `Quota.opening`."""
        if self._quota is None:
            yield
            return
        with self._quota.opening(self._sender()):
            yield


def sender_of(address: str) -> str:
    """The name under which an IP address is counted: itself, and of IPv6 its network of 64 bits, which one has.

    A port behind an IPv4 address does not count.
    """
    host, _, port = address.rpartition(":")
    if port.isdigit() and host.count(".") == 3:
        address = host
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return address
    if ip.version == 4:
        return str(ip)
    # A provider gives each customer a whole network of 64 bits.
    mapped = ip.ipv4_mapped
    return str(mapped) if mapped else str(ipaddress.ip_network((ip, 64), strict=False))


def folder_size(folder: Path) -> int:
    """Bytes of the files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
