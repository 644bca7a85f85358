"""Rank_Blocks_Height, Color, Size: a row of blocks in a given order."""
