"""How much may be stored in the studio: by the address that it comes from, and by the disk."""

import ipaddress
import shutil
import threading
import time
from pathlib import Path

from materialist.errors import InputError
from materialist.studio import SETTINGS

HOUR = 3600.0
"""Seconds."""


class Quota:
    """Bytes that each sender stored within the last hour. Its methods may be called from any thread."""

    def __init__(self, *places: Path) -> None:
        """places: folders whose disks must not be filled."""
        self.places = places
        self._claims: list[tuple[float, str, int]] = []
        """When, by whom, and how many bytes."""
        self._lock = threading.Lock()

    def claim(self, sender: str, size: int) -> None:
        """Count bytes that a sender is about to store.

        Raises InputError above what one sender may store within an hour, and where the disk is full.
        """
        now = time.monotonic()
        with self._lock:
            self._claims = [one for one in self._claims if now - one[0] < HOUR]
            stored = sum(bytes_ for _, who, bytes_ in self._claims if who == sender)
            if stored + size > SETTINGS.storage_quota:
                limit = f"{SETTINGS.storage_quota / 1e9:g} GB"
                raise InputError(f"You have stored {limit} here within an hour; go on later.")
            self.check_disk(size)
            self._claims.append((now, sender, size))

    def check_disk(self, size: int = 0) -> None:
        """Raise InputError where so many bytes more would fill a disk."""
        free = min(shutil.disk_usage(place).free for place in self.places)
        if free - size < SETTINGS.disk_left:
            raise InputError("The disk of the studio is full; it takes no more files.")


def sender_of(address: str) -> str:
    """The name under which an IP address is counted: itself, and of IPv6 its network of 64 bits, which one has."""
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return address
    if ip.version == 4:
        return str(ip)
    mapped = ip.ipv4_mapped
    return str(mapped) if mapped else str(ipaddress.ip_network((ip, 64), strict=False))


def folder_size(folder: Path) -> int:
    """Bytes of the files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
