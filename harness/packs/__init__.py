"""Worlds of objects that are not built in: packs made from a user's own files.

A pack (`robospa.tasks.packs.Pack`) gives models for assets. `official` reads the official archive:

    archive     the folder, its parts, missing files, and the cache of what was made of files
    mesh_files, urdf   what the archive's files say, and what of them is refused
    visuals, convex    a mesh as a drawing, also of robots' links, and as convex pieces
    placing     the archive's frames and points as ours, and grasps from them
    official    the pack, what a folder holds, and which tasks can run with it
"""
