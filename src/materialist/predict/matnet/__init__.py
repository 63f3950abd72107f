"""The paper's MatNet: one DINOv2 encoder, two DPT decoders (section "Material Prediction Network").

Its modules load torch, so nothing is imported here.
"""
