"""Basic_Color_*: the object of a named colour."""
