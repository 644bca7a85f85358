"""Move_Blocks_Apart, Move_Playing_Cards_Away, Separate_Fries_Bread: things to two sides."""
