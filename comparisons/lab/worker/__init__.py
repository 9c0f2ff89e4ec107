"""What a worker process of a study loads besides its task, and nothing else, so that it starts quickly."""
