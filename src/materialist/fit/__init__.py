"""Light and materials fitted to the photo (paper, Progressive Differentiable Rendering)."""
