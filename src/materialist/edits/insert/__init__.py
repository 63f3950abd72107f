"""Inserting mesh files into the photo."""
