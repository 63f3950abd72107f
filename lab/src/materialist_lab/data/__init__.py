"""Sets of labelled pictures: procedural samples in folders, and InteriorVerse."""
