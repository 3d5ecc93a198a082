"""Benchmark of searches: `sightline optimize` beside optimizers of other projects on the same problems."""
