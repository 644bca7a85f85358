"""Pick_*_Canonical and Basic_Ordinal_*: a place counted in a grid of objects."""
