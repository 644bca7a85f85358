"""Worlds of objects that are not built in: packs made from a user's own files.

A pack (`robospa.tasks.packs.Pack`) gives models for assets. `official` is that of the official
archive, whose files `archive`, `mesh_files`, `urdf` and `placing` read.
"""
