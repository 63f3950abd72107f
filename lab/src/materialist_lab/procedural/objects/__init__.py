"""Procedural objects: meshes and furniture."""
