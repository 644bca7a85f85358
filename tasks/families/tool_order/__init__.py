"""Hit_Blocks_Hammer_Order and Stamp_Seals_Order: a tool used in a given order."""
