"""Selecting a region of the photo: click, box, SAM 2."""
