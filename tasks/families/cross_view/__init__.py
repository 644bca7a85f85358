"""Pick_*_Multi_View and Basic_Position_*: the extreme object as a named viewer sees it."""
