"""Pick_*_Relational: the object on a named side of another one."""
