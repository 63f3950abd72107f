"""Bringing an edited rendering back into the photo."""
