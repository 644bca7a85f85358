"""A vision-language model behind an OpenAI-compatible endpoint, as a policy of skill calls."""
