"""Press_Stapler_Memory: each stapler of a row is pressed its own number of times."""
