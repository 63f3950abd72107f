"""The training of ClickNet."""
