"""Training of RefractionNet: shapes, their thickness along camera rays, and the trainer."""
