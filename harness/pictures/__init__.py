"""Pictures: galleries of scenes, and videos of trials."""
