"""The tasks of Cross-Action Composition: several kinds of action, one after the other."""
