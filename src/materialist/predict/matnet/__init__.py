"""The paper's MatNet: one DINOv2 encoder, two DPT decoders (section "Material Prediction Network")."""
