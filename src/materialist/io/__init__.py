"""Files in and out: photos, maps, scene packages. Knows nothing of rendering."""
