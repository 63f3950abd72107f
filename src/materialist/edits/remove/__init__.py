"""Removing an object: the background behind it in photo, maps and depth."""
