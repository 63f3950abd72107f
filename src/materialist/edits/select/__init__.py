"""Selecting a region of the photo: click or box."""
