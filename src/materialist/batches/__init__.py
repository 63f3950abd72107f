"""Many photos: scenes and edited photos by several workers, resumable."""
