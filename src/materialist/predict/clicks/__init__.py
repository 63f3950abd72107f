"""ClickNet: the object at a click, from the photo and its maps."""
