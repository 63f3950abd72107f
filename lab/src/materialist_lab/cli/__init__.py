"""The commands `bench` and `train`, which `materialist` finds through the entry points `materialist.commands`."""
