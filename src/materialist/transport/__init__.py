"""Cached light transport: rays traced once, after which every light and every material is cheap."""
