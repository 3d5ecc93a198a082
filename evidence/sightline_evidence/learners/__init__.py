"""Learners of two families: ``trees`` (LightGBM, anew for each placement), ``unet`` (PyTorch, shared)."""
