"""What is made to be looked at: galleries, sheets, the page of tasks, videos."""
