"""What every edit needs: the checked region, notes in the provenance, and renderings beside the fitted scene."""
