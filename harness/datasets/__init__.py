"""Data sets of demonstrations: episodes as values, how they are made, and the formats they are in.

| module | |
|---|---|
| `episode`, `pictures` | a verified demonstration as a value, its file, its films and stills |
| `workers`, `maker` | making one: expert, replay, pictures |
| `settings`, `collect` | what is collected, and the collection on disk, which can go on |
| `pack`, `lerobot`, `robotwin` | the formats, each with its writer and its reader |
| `features`, `statistics` | the columns of LeRobot's formats, and their statistics |
| `manifest`, `card`, `verify` | what a finished data set says of itself, and whether it is so |
| `imports` | official recordings as data sets |
"""
