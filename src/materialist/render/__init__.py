"""Path tracing with Mitsuba: the material model, scenes that are built once, denoising. `variant` starts it."""
