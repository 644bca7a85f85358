"""Demonstrations: recording, reading, replaying them, and what a replay tells of conventions."""
