"""Recipes, and the making, storing, verifying, loading and previewing of datasets."""

from gibench.datasets.loading import Dataset, Frame, open_dataset
from gibench.datasets.recipes import Recipe, load_preset, load_recipe

__all__ = ["Dataset", "Frame", "Recipe", "load_preset", "load_recipe", "open_dataset"]
