"""RefractionNet: how thick an object is behind what a photo shows of it (paper, Thickness Prior Prediction)."""
