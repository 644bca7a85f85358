"""The simulator: SAPIEN worlds, bodies, drives, cameras, and what drawing needs."""
