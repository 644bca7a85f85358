"""Pick_Leftmost_Block, the worked example of docs/adding-a-task.md."""
