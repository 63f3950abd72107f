"""Edits of a scene: pure functions Scene -> Scene, and the composite that brings them back into the photograph."""
