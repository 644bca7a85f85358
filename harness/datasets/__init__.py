"""Data sets of demonstrations: episodes as values, how they are made, and the formats they are in.

| module | |
|---|---|
| `episode`, `episode_file` | a verified demonstration as a value, and its file |
| `episode_maker`, `encoding`, `subtasks` | making one: expert, replay, pictures |
| `jobs`, `ray_makers`, `open_pool` | making many: processes, Ray |
| `settings`, `identity`, `disk_use` | what is collected, with what, and the room that it takes |
| `collect`, `store`, `collection_progress` | the collection: what is done on disk, and going on |
| `pack`, `features`, `tables`, `statistics`, `films`, `numbered_files` | packing, for all formats |
| `lerobot_v3`, `lerobot_v21`, `robotwin` | one format each |
| `manifest`, `card`, `card_pictures` | what a finished data set says of itself |
| `packed`, `verify` | reading data sets back; whether one is what was collected |
"""
