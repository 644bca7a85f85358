"""Stack_Blocks_Color_Order, Size_Order, Length_Order: a tower in a given order."""
