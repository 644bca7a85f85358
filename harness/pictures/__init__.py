"""Pictures: galleries, object sheets, the page of tasks, videos."""
