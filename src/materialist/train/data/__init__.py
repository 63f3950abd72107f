"""The procedural data set: scenes, labels, storage."""
