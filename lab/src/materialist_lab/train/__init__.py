"""Training of the bundled network: its procedural data set and the trainer."""
