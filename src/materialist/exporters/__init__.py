"""Scenes as glTF, Blender, USD, Mitsuba and HTML files."""
