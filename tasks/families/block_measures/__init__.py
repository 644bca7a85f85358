"""Pick_Blocks_Size, Height, Length, Area: the block of a named rank in one measure."""
