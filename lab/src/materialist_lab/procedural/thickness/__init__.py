"""Views of shapes with the thickness that camera rays find in them: what RefractionNet learns from and is scored on."""
