"""MobileSAM: the masks that a click or a box in a photo may mean."""
