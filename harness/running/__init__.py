"""A run: the driver, its scheduler and workers, and what they write."""
