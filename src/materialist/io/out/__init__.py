"""Pictures out: encodings, colours, EXIF and layers of files that are written."""
