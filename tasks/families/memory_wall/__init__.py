"""Observe_Blocks_Move_Memory, Observe_Objects_Click_Memory, Remember_Orientation_Restore.

Something is shown, and a wall hides it before motion is allowed.
"""
