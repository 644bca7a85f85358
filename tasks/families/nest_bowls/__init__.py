"""Place_Bowls_Plates: a stack of bowls on a plate."""
