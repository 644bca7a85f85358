"""Pick_*_Distance: the k-th farthest object from a named one."""
