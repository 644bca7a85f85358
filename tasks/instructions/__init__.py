"""How instructions are written: templates, phrasings, and what they are composed of."""
